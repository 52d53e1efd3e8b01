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
from posse_baselines.ddcs.memory import CONVERGING, EXCHANGING, FLOCKING, SEARCHING


@compiled
def may_change(s: Record, task: int, wanted: int) -> bool:
    """Return whether a transition is allowed (ablations forbid some)."""
    return (int(s.forbidden) >> (4 * task + wanted)) & 1 == 0


@compiled
def next_task(s: Record, d: Record) -> int:
    """Return the next task.

    Converging and flocking change with hysteresis: flocking begins within ``near`` of the place
    and ends beyond ``far`` of it. Under PNGL the excess of the
    range counts, with separate limits: chase and maintenance.
    """
    task = int(d.task)
    if d.known == 0:
        wanted = SEARCHING
    elif d.exchanges > 0 and d.confirmed == 0 and task != SEARCHING:
        wanted = EXCHANGING
    else:
        near, far = (s.range_near, s.range_far) if d.pursues else (s.near, s.far)
        limit = far if task == FLOCKING else near
        wanted = FLOCKING if 0.0 <= d.error <= limit else CONVERGING
    return wanted if wanted == task or may_change(s, task, wanted) else task
