"""Every setting of the Distributed Decision Control System, with unit, range and use in tuning."""

from dataclasses import dataclass
from typing import Final, Literal

from posse_baselines.fields import check, number, tuned

TASKS: Final = ("searching", "converging", "flocking", "exchange")
"""The four tasks of section 3.1 (:mod:`posse_baselines.ddcs.motion`); a tracker's memory holds the position."""
SEARCHING, CONVERGING, FLOCKING, EXCHANGING = range(len(TASKS))
TRANSITIONS: Final = tuple(f"{a}>{b}" for a in TASKS for b in TASKS if a != b and (a, b) != ("searching", "exchange"))
"""Changes of the task that can be forbidden, for ablations."""
NO_EXCHANGE: Final = ("converging>exchange", "flocking>exchange")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a team. Units, ranges and use in tuning are in each field's metadata.

    Lengths and speeds are those of robots of 0.15 m radius; for others they scale with ``robot_radius``. Times do not.

    Raises:
        ValueError: An unknown model, law or transition, or a number out of its range.
    """

    model: Literal["distributed", "centralized"] = "distributed"
    """``"distributed"``: every tracker is guided by the target (``guidance``); ``"centralized"``:
    only the leader is, the others follow it by l-φ."""
    guidance: Literal["slot", "pngl"] = "slot"
    """Law of trackers guided by the target: ``"slot"`` (Cartesian: the slot's velocity and a gain
    on its offset) or ``"pngl"`` (θ = K σ + c, and (13) with a correction of the range)."""
    deviation: Literal["none", "slot", "occupant"] = "slot"
    """c of PNGL: ``"none"`` (0, as in (5)), ``"slot"`` (ψ - K σ_d) or ``"occupant"`` (the heading
    of the slot's occupant, which differs from ψ while the frame turns, - K σ_d)."""
    navigation_constant: float = tuned(1.0, "", 0.9, 1.1)
    """K of PNGL: of the leader, and the mean of a distributed team."""
    spread: float = number(0.0, "", 0.0, 0.1)
    """By how much K differs from the mean at both ends of a distributed team, η in the paper."""
    follower_frame: Literal["leader", "slot-frame"] = "leader"
    """Frame in which a follower's φ_d is constant: the leader's heading (figure 6) or the slot frame."""
    radio: bool = True
    """Whether received messages are used."""
    forbidden: tuple[str, ...] = ()
    """Forbidden transitions of the task (``TRANSITIONS``), for ablations."""

    # monitoring
    turn_memory: float = tuned(1.0, "s", 0.1, 5.0)
    """Decay time constant of a measured turn rate of the target."""
    heading_trust: float = tuned(1.0, "", 0.02, 1.0)
    """Share of a new measurement in the slot frame's estimated heading. The target's has the same noise."""

    # the tasks
    time_lag: float = tuned(1.0, "s", 0.1, 10.0)
    """Time between two checks of the leadership."""
    lead_hysteresis: float = tuned(0.6, "m", 0.0, 3.0)
    """Difference of the distances to the target required for a handover."""
    lead_patience: float = tuned(0.2, "s", 0.0, 2.0)
    """Additional timeout of the leader compared with a team-mate."""
    near: float = tuned(1.0, "m", 0.02, 1.5)
    """Distance from its place at which converging ends and flocking begins."""
    far: float = tuned(1.2, "m", 0.1, 4.0, above="near")
    """Distance from its place at which flocking ends and converging begins again."""
    range_near: float = tuned(0.15, "m", 0.02, 1.5)
    """The same under PNGL, by which the range exceeds the wanted one: the chase ends."""
    range_far: float = tuned(0.8, "m", 0.1, 4.0, above="range_near")
    """The same under PNGL, by which the range exceeds the wanted one: the chase begins again."""

    # searching
    apart: float = tuned(2.0, "m²", 0.0, 20.0)
    """Push from a team-mate at a distance of 1 m, where the own heading pulls by 1; it falls as 1 / d²."""

    # slots
    close_in_after: float = tuned(0.25, "s", 0.0, 3.0)
    """With a fix older than this, beyond the patience with silent team-mates, the team moves to the predicted position
    of the target, to see it again."""

    # laws
    gain: float = tuned(1.5, "1/s", 0.2, 6.0)
    """Gain of the slot law."""
    aim_ahead: float = tuned(0.0, "m", -0.2, 0.3)
    """Offset ahead of a slot's centre, along the slot frame, at which the slot law aims."""
    detour: float = tuned(0.0, "m", 0.0, 1.0)
    """Clearance of ways past obstacles on the way to a slot or in the search; 0: no detours, the
    safeguard alone avoids them."""
    bearing_gain: float = tuned(0.0, "", 0.0, 4.0)
    """G of a deviation c = ... + G wrap(σ - σ_d): feedback on the bearing. 0 is the paper's law."""
    range_gain: float = tuned(1.0, "1/s", 0.1, 6.0)
    """Gain of the range correction in (13)."""
    alpha_1: float = tuned(2.0, "1/s", 0.2, 6.0)
    """α_1 of the l-φ law."""
    alpha_2: float = tuned(2.0, "1/s", 0.2, 6.0)
    """α_2 of the l-φ law."""
    point_offset: float = tuned(0.15, "m", 0.05, 0.5)
    """d, how far ahead of its axle the point lies that a follower controls by l-φ."""

    # safeguard
    margin: float = tuned(0.15, "m", 0.0, 0.6)
    """Clearance to robots and walls."""
    target_margin: float = tuned(0.2, "m", 0.0, 0.6)
    """Clearance to the target."""
    age_margin: float = tuned(0.15, "m/s", 0.0, 1.0)
    """Increase of the margin of a team-mate per second of its message's age."""
    echo_margin: float = tuned(0.25, "m", 0.0, 0.6)
    """Clearance to unexplained echoes of the sonar."""

    def __post_init__(self) -> None:
        check(self)
        given: object = self.forbidden
        if not isinstance(given, (tuple, list)) or any(transition not in TRANSITIONS for transition in given):
            raise ValueError(f"forbidden={given!r:.80} must be a tuple of some of: {', '.join(TRANSITIONS)}")
