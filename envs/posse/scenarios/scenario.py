"""The settings of a world: one frozen, validated dataclass.

Scenarios with equal fields define the same benchmark. Named ones are in
:mod:`posse.scenarios.named`, checks across fields in :mod:`posse.scenarios.checks`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from posse.registry import SENSORS, TARGET_MOTIONS
from posse.scenarios.formation import FORMATIONS, slot_offsets
from posse.scenarios.limits import (
    BREAK_CHOICES,
    FAR,
    FARTHEST,
    MAX_OBSTACLES,
    MAX_TRACKERS,
    OPEN_PLANE_EXTENT,
    SAFE_MARGIN,
    SMALL,
    WIDE,
)
from posse.scenarios.setting import (
    ScenarioError,
    Setting,
    UnknownSettingError,
    check,
    declare,
    fail,
    flag,
    near,
    number,
    pair,
    setting_of,
    text,
    whole,
)
from posse.shown import shown


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One benchmark: team, target, environment, sensing, radio, faults and reward.

    Lengths are in metres, times in seconds, speeds in m/s, angles in radians, turn rates in rad/s.
    Every field can be overridden by keyword: ``posse.parallel_env("smart", num_trackers=8)``.
    :meth:`settings` lists the fields with unit, range, meaning and source.

    Raises:
        ScenarioError: An invalid field or combination of fields.
    """

    name: str = text(dataclasses.MISSING, "name in results and policy cards")
    version: int = whole(1, 1, math.inf, "incremented when the behaviour of the named scenario changes")

    # The team
    num_trackers: int = whole(5, 1, MAX_TRACKERS, "robots in the team", source="section 4: five trackers")
    tracker_speed: float | tuple[float, ...] = number(
        1.0,
        "m/s",
        SMALL,
        1000,
        "greatest speed of a tracker, or of each; above target_speed",
        per_tracker=True,
        source="section 2, assumption ii",
    )
    tracker_turn_rate: float | tuple[float, ...] = number(
        2.0, "rad/s", SMALL, WIDE, "greatest turn rate of a tracker, or of each", per_tracker=True
    )
    tracker_acceleration: float = number(
        math.inf, "m/s²", SMALL, FAR, "greatest change of a tracker's speed; inf: no limit", infinite=True
    )
    tracker_turn_acceleration: float = number(
        math.inf, "rad/s²", SMALL, FAR, "greatest change of a tracker's turn rate; inf: no limit", infinite=True
    )
    robot_radius: float = number(0.15, "m", SMALL, WIDE, "radius of every robot's disc, trackers and target")

    # The target
    target_motion: str = text(
        "constant", "how the target moves; agent: a policy controls it", lambda: TARGET_MOTIONS, source="section 2"
    )
    target_speed: float = number(0.6, "m/s", 0, 1000, "speed of the target; an agent's greatest")
    target_turn_rate: float = number(1.0, "rad/s", SMALL, WIDE, "greatest turn rate of the target")
    target_least_speed: float = number(
        0.0, "m/s", 0, 1000, "least speed of a target that is an agent, at most target_speed"
    )

    # The formation
    formation: str = text(
        "wedge",
        "wedge: behind the target; ring: around it; rows: compact, behind",
        lambda: FORMATIONS,
        source="section 3.3, figure 6",
    )
    formation_distance: float = number(
        1.2, "m", 0, WIDE, "from the target to the nearest slot (ring: the least radius of the ring)", above=True
    )
    formation_spacing: float = number(
        1.2, "m", 0, WIDE, "between neighbouring slots; more than twice the tolerance", above=True
    )
    tolerance: float = number(0.3, "m", SMALL, WIDE, "a slot is occupied when a tracker is within this distance")
    settle_time: float = number(
        3.0,
        "s",
        0,
        math.inf,
        "the team has settled when every slot has been held continuously for this long",
        above=True,
    )

    # Time
    control_step: float = number(0.1, "s", 1e-4, 100, "between two actions; a whole multiple of physics_step")
    physics_step: float = number(0.05, "s", 1e-4, 100, "between two contact checks")
    horizon: int = whole(600, 1, 1_000_000, "control steps in an episode", unit="steps")
    terminate_on_contact: bool = flag(False, "whether the episode ends when any tracker touches anything")

    # The arena
    arena: float = number(
        math.inf, "m", 0, 2 * FARTHEST, "side of the walled square; inf: the open plane", above=True, infinite=True
    )
    num_obstacles: int = whole(0, 0, MAX_OBSTACLES, "discs in the arena; require an arena")
    obstacle_radius: tuple[float, float] = pair((0.4, 0.8), "m", WIDE, "least and greatest radius of an obstacle")
    obstacle_gap: float = number(
        1.2, "m", 0, WIDE, "least clearance between two obstacles, and between an obstacle and a wall"
    )
    start_distance: tuple[float, float] = pair(
        (4.0, 10.0), "m", FARTHEST, "least and greatest distance of a tracker from the target at the start"
    )

    # Sensing
    sensor: str = text("range-bearing", "kind of the target sensor", lambda: SENSORS)
    sensing_range: float = number(
        math.inf, "m", 0, FAR, "a tracker sees the target up to this distance; inf: at any", above=True, infinite=True
    )
    field_of_view: float = number(
        2.0 * math.pi, "rad", 0, 2 * math.pi + 1e-9, "full angle of the target sensor about the heading", above=True
    )
    range_noise: float = number(
        0.0, "1", 0, 0.3, "standard deviation of a measured range, as a share of the range; truncated at three"
    )
    bearing_noise: float = number(0.0, "rad", 0, 0.5, "standard deviation of a measured bearing; truncated at three")
    velocity_smoothing: float = number(
        0.0, "s", 0, WIDE, "time constant of the velocity estimated from successive fixes; 0: none"
    )
    sonar_beams: int = whole(8, 0, 64, "beams of the sonar ring, evenly spaced from straight ahead")
    sonar_range: float = number(2.0, "m", SMALL, WIDE, "range of the sonar, from the robot's rim")

    # Radio
    radio_range: float = number(
        math.inf, "m", 0, FAR, "trackers hear each other up to this distance; inf: at any", above=True, infinite=True
    )
    radio_delay: int = whole(
        0, 0, 100, "delay of messages; 0: received in the observation after the step", unit="steps"
    )
    radio_loss: float = number(0.0, "1", 0, 0.999, "probability that a message is lost, for each pair and step")
    message_size: int = whole(0, 0, 64, "numbers that a policy can add to each broadcast")
    forget_after: float = number(
        5.0, "s", 0, WIDE, "time after which a silent team-mate is dropped from the observation", above=True
    )
    num_neighbours: int | None = whole(
        None, 0, MAX_TRACKERS - 1, "places for team-mates in an observation; None: min(num_trackers - 1, 8)", none=True
    )

    # Faults
    breaks: int = whole(0, 0, MAX_TRACKERS - 1, "trackers that break during an episode, below num_trackers")
    break_choice: str = text(
        "nearest",
        "which one breaks: the nearest to the target at that time (usually the leader), a random"
        " one, or the one given by number",
        lambda: BREAK_CHOICES,
    )
    break_number: int = whole(0, 0, MAX_TRACKERS - 1, "number of the tracker that breaks with break_choice given")
    break_window: tuple[float, float] = pair(
        (0.4, 0.6), "1", 1.0, "interval of the time of a break, as shares of the horizon"
    )
    sensor_outages: float = number(
        0.0, "1", 0, 1, "probability that a tracker's target sensor fails once for outage_time"
    )
    radio_outages: float = number(0.0, "1", 0, 1, "probability that a tracker's radio fails once for outage_time")
    outage_time: float = number(
        5.0, "s", 0, WIDE, "length of an outage; its start is drawn over the episode", above=True
    )

    # Declarations of the user's own
    extra_fields: tuple[str, ...] = declare(
        (), Setting("other", "1", "observation fields of your own, by name: docs/extend.md")
    )
    metrics: tuple[str, ...] = declare((), Setting("other", "1", "metrics of your own, by name: docs/extend.md"))

    # Reward
    reward_weights: Mapping[str, float] | tuple[tuple[str, float], ...] = declare(
        (("slot", 1.0), ("progress", 0.5), ("contact", -0.2)),
        Setting("other", "1", "weight of each reward term by name (posse.REWARD_TERMS); others: 0"),
    )
    target_reward_weights: Mapping[str, float] | tuple[tuple[str, float], ...] = declare(
        (("team", -1.0),), Setting("other", "1", "the same for a target that is an agent: contact, effort, team")
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "extra_fields", _names("extra_fields", self.extra_fields))
        for name in ("reward_weights", "target_reward_weights"):
            object.__setattr__(self, name, _weights(name, getattr(self, name)))
        further = tuple(dict.fromkeys(_names("metrics", self.metrics)))
        object.__setattr__(self, "metrics", further)
        for name, setting in self.settings().items():
            if setting.per_tracker and isinstance(getattr(self, name), list):
                object.__setattr__(self, name, tuple(getattr(self, name)))
            check(name, getattr(self, name), setting)
        for check_together in _CHECKS:
            check_together(self)

    @classmethod
    def settings(cls) -> dict[str, Setting]:
        """Return the declaration of every field by name: unit, range, meaning, source."""
        return {field.name: setting_of(field) for field in dataclasses.fields(cls)}

    @property
    def tracker_speeds(self) -> tuple[float, ...]:
        """Greatest speed of each tracker, m/s."""
        return self._of_each(self.tracker_speed)

    @property
    def tracker_turn_rates(self) -> tuple[float, ...]:
        """Greatest turn rate of each tracker, rad/s."""
        return self._of_each(self.tracker_turn_rate)

    def _of_each(self, value: float | tuple[float, ...]) -> tuple[float, ...]:
        return value if isinstance(value, tuple) else (value,) * self.num_trackers

    @property
    def neighbours(self) -> int:
        """Places for team-mates in an observation."""
        if self.num_neighbours is not None:
            return self.num_neighbours
        return min(self.num_trackers - 1, 8)

    @property
    def physics_steps(self) -> int:
        """Physics steps in a control step."""
        return round(self.control_step / self.physics_step)

    @property
    def whole_arcs(self) -> bool:
        """Whether a robot with nothing near moves on one arc for the whole control step."""
        turn = max(*self.tracker_turn_rates, self.target_turn_rate) * self.control_step
        limits = (self.tracker_acceleration, self.tracker_turn_acceleration)
        return turn <= 1.0 and all(math.isinf(limit) for limit in limits)

    @property
    def duration(self) -> float:
        """Length of an episode, s."""
        return self.horizon * self.control_step

    @property
    def num_agents(self) -> int:
        """Rows of an action: the trackers, and the target where it is an agent."""
        return self.num_trackers + (self.target_motion == "agent")

    @property
    def target_clearance(self) -> float:
        """Distance from every wall at which the target starts, m: room to turn either way."""
        return 2 * self.target_speed / self.target_turn_rate + self.robot_radius + SAFE_MARGIN

    @property
    def start_extent(self) -> float:
        """Greatest absolute coordinate of any robot at the start, m."""
        if math.isfinite(self.arena):
            return self.arena / 2
        return OPEN_PLANE_EXTENT + self.start_distance[1]

    @property
    def target_extent(self) -> float:
        """Greatest absolute coordinate of the target at the start, m."""
        if not math.isfinite(self.arena):
            return OPEN_PLANE_EXTENT
        if self.target_motion == "agent":
            return self.arena / 2 - self.robot_radius
        return self.arena / 2 - self.target_clearance

    @property
    def position_bound(self) -> float:
        """Greatest absolute coordinate that any robot can reach, m."""
        if math.isfinite(self.arena):
            return self.arena / 2
        return self.start_extent + max(self.tracker_speeds) * self.duration

    @property
    def range_bound(self) -> float:
        """Greatest distance between any two reachable positions, m."""
        return 2 * math.sqrt(2) * self.position_bound

    @property
    def slot_turn_rate(self) -> float:
        """Greatest turn rate of the slot frame, rad/s.

        ω_s = min(0.8 (V - v_t), v_t) / ρ_max with V of the slowest tracker, so that no slot moves
        backwards or faster than a tracker.
        """
        rho = max(math.hypot(x, y) for x, y in slot_offsets(self))
        slowest = min(self.tracker_speeds)
        return min(0.8 * (slowest - self.target_speed), self.target_speed) / rho

    def replace(self, **overrides: Any) -> Scenario:
        """Return a copy with some fields changed.

        Raises:
            ScenarioError: An unknown field (the message suggests similar ones) or an invalid value.
        """
        names = [field.name for field in dataclasses.fields(self)]
        for key in overrides:
            if key not in names:
                raise UnknownSettingError(
                    f"unknown setting {shown(key)}{near(key, names)}: unexpected keyword argument "
                    f"{shown(key)}; settings are: {', '.join(names)}"
                )
        return dataclasses.replace(self, **overrides)

    def to_dict(self) -> dict[str, Any]:
        """Return every field by name, as plain values (``inf`` stays a float)."""
        values = dataclasses.asdict(self)
        values["reward_weights"] = dict(self.reward_weights)
        values["target_reward_weights"] = dict(self.target_reward_weights)
        return values


_CHECKS: list[Callable[[Scenario], None]] = []


def checked_by(function: Callable[[Scenario], None]) -> Callable[[Scenario], None]:
    """Declare a function that raises ScenarioError where settings do not go together."""
    _CHECKS.append(function)
    return function


def _names(setting: str, given: object) -> tuple[str, ...]:
    """Return names in a tuple, whatever they were given in; a name alone is one of them."""
    names = tuple(given) if isinstance(given, (list, tuple)) else (given,)
    if not all(isinstance(name, str) for name in names):
        fail(setting, given, "it must be a tuple of names")
    return names


def _weights(name: str, given: object) -> tuple[tuple[str, float], ...]:
    """Return reward weights sorted by name, so that equal scenarios compare equal."""
    try:
        weights = dict(given)  # type: ignore[call-overload]
        return tuple(sorted(weights.items()))
    except (TypeError, ValueError):
        raise ScenarioError(f"{name}={shown(given)} is not possible: it must map names of terms to numbers") from None
