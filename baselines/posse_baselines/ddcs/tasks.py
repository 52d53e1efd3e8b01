"""The four tasks of section 3.1, and their transitions (figure 1).

===================  =========================================================================
searching            the target is unknown: explore
converging           chase stage: at full speed to the own place
flocking             maintenance stage: the formation law, in the own place
leader exchange      another leader was appointed and has not been heard yet: hold the flock's
                     course (centralized model only)
===================  =========================================================================
"""

from __future__ import annotations

from posse.numeric import Record, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.settings import CONVERGING, EXCHANGING, FLOCKING, SEARCHING


@compiled
def may_change(team: Team, task: int, wanted: int) -> bool:
    """Return whether a transition is allowed (ablations forbid some)."""
    settings = team.settings
    return (int(settings.forbidden) >> (4 * task + wanted)) & 1 == 0


@compiled
def next_task(team: Team, me: Record) -> int:
    """Return the next task.

    Converging and flocking change with hysteresis: flocking begins within ``near`` of the place
    and ends beyond ``far`` of it. Under PNGL the excess of the
    range counts, with separate limits: chase and maintenance.
    """
    settings = team.settings
    task = int(me.task)
    if me.known == 0:
        wanted = SEARCHING
    elif me.exchanges > 0 and me.confirmed == 0 and task != SEARCHING:
        wanted = EXCHANGING
    else:
        near, far = (settings.range_near, settings.range_far) if me.pursues else (settings.near, settings.far)
        limit = far if task == FLOCKING else near
        wanted = FLOCKING if 0.0 <= me.error <= limit else CONVERGING
    return wanted if wanted == task or may_change(team, task, wanted) else task
