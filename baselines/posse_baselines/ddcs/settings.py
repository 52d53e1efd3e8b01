"""Every setting of the Distributed Decision Control System, with its unit."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posse.numeric import Records

MODELS: Final = ("distributed", "centralized")
GUIDANCE_LAWS: Final = ("cartesian", "polar", "pngl")
LEADER_LAWS: Final = ("pursuit", "slot")
FOLLOWER_LAWS: Final = ("l-phi", "l-l")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a team plays. Lengths in metres, times in seconds, gains in 1/s.

    Raises:
        ValueError: An unknown model or law, or a number out of its range.
    """

    model: str = "distributed"
    """``"distributed"``: everyone keeps its own slot on the target; ``"centralized"``: the leader
    keeps its place behind the target, the others theirs on the leader (``follower_law``)."""
    guidance: str = "cartesian"
    """How a slot on the target is approached: ``"cartesian"`` or ``"polar"``; ``"pngl"``: no slots,
    but the paper's own spread, by one navigation constant K a tracker."""
    leader_law: str = "slot"
    """Of the centralized model's leader: ``"pursuit"`` (velocity pursuit, K = 1, as in the paper,
    which is off its bearing while the target turns) or ``"slot"`` (it keeps the first slot)."""
    follower_law: str = "l-phi"
    """Of the centralized model's followers: ``"l-phi"`` (distance and direction from the leader) or
    ``"l-l"`` (from the third robot on, the distances from the leader and from a follower before it
    in the order of the slots)."""
    exchange: bool = True
    """Whether the lead ever passes on; without, the first leader stays leader, even broken."""
    radio: bool = True
    """Whether anything that was heard is used; without, each tracker is alone."""

    # monitoring
    speed_memory: float = 3.0
    """Time constant of the target's estimated speed."""
    mean_memory: float = 6.0
    """Time constant of the target's mean velocity, by which far slots are met."""
    weave_time: float = 1.5
    """How long the target is taken to keep its present velocity, before its mean one counts."""
    fix_trust: float = 0.6
    """Share of a new fix in the estimate of the position, (0, 1]."""
    lost_after: float = 1.5
    """A team-mate, or the leader's pulse, not heard for this long is gone."""
    unseen_memory: float = 2.5
    """The same, for team-mates who may just have had no place in the observation."""
    target_lost_after: float = 10.0
    """A fix older than this is no longer followed: the target is lost."""

    # the tasks
    time_lag: float = 1.0
    """Between two looks at who should lead."""
    lead_hysteresis: float = 0.6
    """How much nearer to the target another has to be to take the lead."""
    near: float = 0.6
    """Distance from its place at which converging ends and flocking begins."""
    far: float = 1.2
    """Distance from its place at which flocking ends and converging begins anew."""

    # slots
    replan_time: float = 0.5
    """Between two assignments."""
    loyalty: float = 0.6
    """How much sooner all would have to arrive with other slots for a tracker to change, s."""
    taken_cost: float = 8.0
    """How much later a tracker may arrive elsewhere than in a slot where its sonar finds somebody
    who is not heard, s."""
    sight_worth: float = 10.0
    """How much later a tracker may arrive in a slot from which the target is in sight, s."""
    close_in_after: float = 0.25
    """With a fix older than this, beyond the usual age, the team closes in on where the target may
    be, from all sides, to see it again."""
    hunt_growth: float = 0.3
    """How fast the ring grows on which it does so, m/s."""

    # laws
    gain: float = 1.5
    """Of the Cartesian slot law."""
    range_gain: float = 1.0
    """k_r of the polar law, and of the range in pursuit."""
    bearing_gain: float = 1.0
    """k_σ of the polar law."""
    alpha_1: float = 2.0
    """α_1 of the l-φ law."""
    alpha_2: float = 2.0
    """α_2 of the l-φ law."""
    point_offset: float = 0.15
    """How far ahead of its axle the point lies that a follower controls by l-φ or l-l."""
    least_crossing: float = 0.15
    """Sine of the angle, seen from a follower under l-l, between the two robots that it keeps its
    distances from, below which it keeps its place on the nearer one instead, (0, 0.5). In its place
    the sine has to be twice that."""
    spread: float = 0.1
    """η of the paper's spread: K from 1 - η to 1 + η over the team (pngl)."""
    enter_margin: float = 0.2
    """Range beyond the wanted one at which the chase ends (pursuit, pngl)."""
    leave_margin: float = 0.8
    """Range beyond the wanted one at which it begins again."""

    clearance: float = 0.75
    """Distance at which the way to a slot leads round the target."""

    # safeguard
    margin: float = 0.15
    """Free width that is kept to robots and walls."""
    target_margin: float = 0.2
    """Free width that is kept to the target."""
    age_margin: float = 0.15
    """By how much more the margin of a team-mate is widened, for each second of its message's age,
    m/s."""
    echo_margin: float = 0.25
    """Free width that is kept to what the sonar finds and nobody explains."""

    def __post_init__(self) -> None:
        for name, allowed in (
            ("model", MODELS), ("guidance", GUIDANCE_LAWS), ("leader_law", LEADER_LAWS),
            ("follower_law", FOLLOWER_LAWS),
        ):  # fmt: skip
            value = getattr(self, name)
            if value not in allowed:
                raise ValueError(f"{name}={value!r} is unknown; known: {', '.join(allowed)}")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, float) and not 0.0 <= value < float("inf"):
                raise ValueError(f"{field.name}={value!r} must be a finite number, at least 0")
        if not 0.0 < self.fix_trust <= 1.0:
            raise ValueError(f"fix_trust={self.fix_trust!r} must lie in (0, 1]")
        if not self.near < self.far:
            raise ValueError(f"near={self.near!r} must be below far={self.far!r}: a hysteresis")
        if not self.enter_margin < self.leave_margin:
            raise ValueError(
                f"enter_margin={self.enter_margin!r} must be below "
                f"leave_margin={self.leave_margin!r}: a hysteresis"
            )
        if not 0.0 <= self.spread <= 0.1:
            raise ValueError(f"spread={self.spread!r} must lie in [0, 0.1] (paper, section 3.3)")
        if self.point_offset <= 0.0:
            raise ValueError(f"point_offset={self.point_offset!r} must be above 0")
        if not 0.0 < self.least_crossing < 0.5:
            raise ValueError(f"least_crossing={self.least_crossing!r} must lie in (0, 0.5)")

    def replace(self, **overrides: Any) -> Settings:
        """Return a copy with some settings changed."""
        return dataclasses.replace(self, **overrides)


_CHOICES: Final = {
    "model": MODELS, "guidance": GUIDANCE_LAWS, "leader_law": LEADER_LAWS,
    "follower_law": FOLLOWER_LAWS,
}  # fmt: skip
SETTINGS: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                (field.name, np.float64 if isinstance(field.default, float) else np.int64)
                for field in dataclasses.fields(Settings)
            ]
        ),
    )
)
"""Settings as the kernels read them; a choice is its position among those allowed."""


def settings_record(settings: Settings) -> Records:
    """Return an array of one :data:`SETTINGS`."""
    record = np.zeros(1, SETTINGS)
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        record[field.name] = _CHOICES[field.name].index(value) if field.name in _CHOICES else value
    return record
