"""The baseline, PNGL + l-φ, and the other members of the DDCS family: one program, different settings.

What ``pngl-l-phi`` does in a control step (:mod:`~posse_baselines.ddcs.step`), equation numbers of the paper:

===============================  ======================================================  =======================
who, when                        law                                                     where
===============================  ======================================================  =======================
everyone, target unknown         explores what the team has not covered yet              ``searching.wander``
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

from posse_baselines.ddcs.settings import NO_EXCHANGE, Settings

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
