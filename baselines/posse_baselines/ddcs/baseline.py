"""The baseline, PNGL + l-φ: one control step, in order, and the settings that make it and its family.

A step of one tracker is :func:`propose`, monitoring and tracking, then :func:`carry_out`, actuation. Between the two, a
wanted velocity may be corrected: before the safeguard, so that a corrected team avoids contact as well as the team
itself does. What ``pngl-l-phi`` does, with equation numbers of the paper:

===============================  ======================================================  =======================
who, when                        law                                                     where
===============================  ======================================================  =======================
everyone, target unknown         explores what the team has not covered yet              ``motion.wander``
leader, far (converging)         PNGL, θ = K σ + c, at full speed: (5), (6), (12)        ``motion.pursue``,
                                                                                         ``laws.guidance``
leader, near (flocking)          PNGL, the speed of (13) with a correction of the range  ``motion.pursue``
follower, far (converging)       intercepts its place on the leader at full speed        ``motion.move``,
                                                                                         ``laws.steering``
follower, near (flocking)        l-φ on the leader, figure 6                             ``motion.follow``,
                                                                                         ``laws.formation``
everyone, leader exchanged       holds the flock's course until it hears the new leader  ``motion.move``
everyone, always                 regulates its heading, section 3.3; avoids contact      ``laws.guidance``,
                                                                                         ``laws.safeguard``
===============================  ======================================================  =======================

The leader is the tracker nearest to the target (nearest-neighbour rule); it takes the first slot, and the
others take slots by least total time (:mod:`~posse_baselines.ddcs.roles`).
"""

from __future__ import annotations

from typing import Any, Final

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.actuation import correct, detour, execute_safely, foresee, surround
from posse_baselines.ddcs.memory import Team, Work, for_each, is_due, read_body
from posse_baselines.ddcs.monitoring import update_mates, watch_target, write_message
from posse_baselines.ddcs.motion import begin_search, look_around, move, next_task, want
from posse_baselines.ddcs.roles import choose_slot, settle_lead
from posse_baselines.ddcs.settings import CENTRALIZED, FLOCKING, NO_EXCHANGE, SEARCHING, Settings
from posse_baselines.laws.geometry import length, scaled

BASELINE: Final = Settings(
    model="centralized",
    guidance="pngl",
    navigation_constant=1.1,  # K, at the upper end of the paper's range
    deviation="occupant",  # c = the heading of the slot's occupant - K σ_d, so that the leader holds its slot
    turn_share=1.0,  # the slot frame turns at the target's full measured turn rate
    follower_law="l-phi",
    follower_frame="slot-frame",  # φ_d is constant in the slot frame, not in the leader's: the wedge stays behind
)
"""The settings of PNGL + l-φ; the others keep their defaults (:class:`~posse_baselines.ddcs.settings.Settings`)."""

_PURSUIT: Final[dict[str, Any]] = {"guidance": "pngl", "turn_share": 1.0}
_CENTRALIZED: Final[dict[str, Any]] = {"model": "centralized", "follower_frame": "slot-frame"}

FAMILY: Final[dict[str, Settings]] = {
    "pngl-l-phi": BASELINE,
    # As printed: c = 0, and φ from the leader's heading. The leader then follows from any side and the wedge turns with
    # it, so that only a target that drives straight ahead is held.
    "pngl-l-phi-literal": BASELINE.replace(deviation="none", follower_frame="leader"),
    "pngl": Settings(deviation="slot", spread=0.1, **_PURSUIT),
    "deviated-pursuit": Settings(deviation="slot", **_PURSUIT),
    "velocity-pursuit": Settings(deviation="none", **_PURSUIT),
    "ddcs-centralized-pursuit": Settings(deviation="none", **_CENTRALIZED, **_PURSUIT),
    "ddcs-distributed": Settings(),
    "ddcs-centralized": Settings(**_CENTRALIZED),
    "ddcs-centralized-l-l": Settings(follower_law="l-l", **_CENTRALIZED),
    "ddcs-centralized-no-exchange": Settings(forbidden=NO_EXCHANGE, **_CENTRALIZED),
    "ddcs-no-radio": Settings(radio=False),
}
"""The members of the DDCS family, the baseline first."""


@compiled
def monitor(team: Team, me: Record, mates: Records, row: FloatArray) -> None:
    """Read what one tracker observes."""
    read_body(team, me, row)
    watch_target(team, me, row)
    update_mates(team, me, mates, row)


@compiled
def propose(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, proposal: FloatArray) -> None:
    """Monitor and track: write the velocity that one tracker wants, ahead and left, in shares of its top speed."""
    monitor(team, me, mates, row)
    look_around(team, me, mates)
    foresee(team, me)
    if team.settings.model == CENTRALIZED:
        settle_lead(team, me, mates)
    if me.known == 0:
        me.slot = -1
        if me.task != SEARCHING:
            begin_search(team, me)
    elif me.slot < 0 or is_due(team, me, team.settings.replan_time):
        choose_slot(team, me, mates, work)
    me.task = next_task(team, me, mates)
    move(team, me, mates)
    own = me.wish * me.heading.conjugate()
    proposal[0], proposal[1] = own.real / me.max_speed, own.imag / me.max_speed


@compiled
def carry_out(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Actuate: write the action (2 + m,) of one tracker, whose first two numbers are a correction of what it wants."""
    correct(me, complex(float(action[0]), float(action[1])))
    discs = work.discs[: surround(team, me, mates, row, work.discs)]
    velocity = me.wish
    if team.settings.detour > 0.0 and me.task != FLOCKING:
        velocity = detour(team, me, discs, velocity)
    execute_safely(team, me, discs, velocity, action)
    write_message(team, me, row, action)


@compiled
def guard(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Make a wanted velocity safe that is not the script's: it stands in the action (2 + m,), which is overwritten.

    It is relative to the observed heading, and carried out from the pose at which the command is executed.
    """
    monitor(team, me, mates, row)
    wanted = complex(float(action[0]), float(action[1]))
    wanted = scaled(wanted * me.heading, me.max_speed / max(1.0, length(wanted)))
    foresee(team, me)
    want(me, wanted, 0.0)
    execute_safely(team, me, work.discs[: surround(team, me, mates, row, work.discs)], wanted, action)


propose_all, carry_out_all, guard_all = for_each(propose), for_each(carry_out), for_each(guard)
