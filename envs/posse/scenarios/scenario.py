"""The settings of a world: one frozen, validated dataclass.

A scenario is everything that makes one benchmark different from another. It is a value: two
scenarios with equal fields are the same benchmark. Named ones are in :mod:`posse.scenarios.named`.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from posse.scenarios.formation import FORMATIONS, slot_offsets
from posse.signals.reward import REWARD_TERMS

TARGET_MOTIONS: Final = ("constant", "accelerating", "smart", "agent")
BREAK_CHOICES: Final = ("nearest", "drawn", "given")

MAX_TRACKERS: Final = 64  # contacts and radio links are bits of one 64-bit word
MAX_OBSTACLES: Final = 60  # the four walls take the last bits of the word


class ScenarioError(ValueError):
    """A setting that no world can have; the message names it, what is allowed and the mend."""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One benchmark: a team, a target, and what surrounds them.

    Lengths are in metres, times in seconds, speeds in m/s, angles in radians, turn rates in rad/s.
    ``math.inf`` means "no limit" where a field says so. Every field can be overridden by keyword:
    ``posse.parallel_env("smart", num_trackers=8)``.

    Raises:
        ScenarioError: A field, or a combination of fields, that no world can have.
    """

    name: str
    """What results and policy cards call it."""
    version: int = 1
    """Raised when the behaviour of the named scenario changes, and only then."""

    # The team
    num_trackers: int = 5
    """Robots in the team, 1 to 64 (paper, section 4: five)."""
    tracker_speed: float = 1.0
    """Greatest speed of a tracker, m/s. Must exceed ``target_speed`` (paper, assumption ii)."""
    tracker_turn_rate: float = 2.0
    """Greatest turn rate of a tracker, rad/s."""
    tracker_acceleration: float = math.inf
    """Greatest change of a tracker's speed, m/s²; ``inf``: at once."""
    tracker_turn_acceleration: float = math.inf
    """Greatest change of a tracker's turn rate, rad/s²; ``inf``: at once."""
    robot_radius: float = 0.15
    """Radius of every robot's disc, trackers and target, m."""

    # The target
    target_motion: str = "constant"
    """``"constant"``, ``"accelerating"`` or ``"smart"`` (paper, section 2), or ``"agent"``."""
    target_speed: float = 0.6
    """Speed of the target, m/s (of an agent: its greatest)."""
    target_turn_rate: float = 1.0
    """Greatest turn rate of the target, rad/s."""

    # The formation
    formation: str = "wedge"
    """``"wedge"`` (behind the target), ``"ring"`` (around it) or ``"rows"`` (compact, behind)."""
    formation_distance: float = 1.2
    """From the target to the nearest slot, m (ring: the least radius of the ring)."""
    formation_spacing: float = 1.2
    """Between neighbouring slots, m. More than twice ``tolerance``."""
    tolerance: float = 0.3
    """A slot is occupied when a tracker is this near to it, m."""
    settle_time: float = 3.0
    """The team has settled when every slot has been held for this long on end, s."""

    # Time
    control_step: float = 0.1
    """Between two actions, s. A whole multiple of ``physics_step``."""
    physics_step: float = 0.05
    """Between two contact checks, s."""
    horizon: int = 600
    """Control steps in an episode."""
    terminate_on_contact: bool = False
    """End the episode when any tracker touches anything."""

    # The place
    arena: float = math.inf
    """Side of the walled square, m; ``inf``: the open plane."""
    num_obstacles: int = 0
    """Discs in the arena, 0 to 60. Obstacles need an arena."""
    obstacle_radius: tuple[float, float] = (0.4, 0.8)
    """Least and greatest radius of an obstacle, m."""
    obstacle_gap: float = 1.2
    """Least free width between two obstacles, and between an obstacle and a wall, m."""
    start_distance: tuple[float, float] = (4.0, 10.0)
    """Least and greatest distance of a tracker from the target at the start, m."""

    # Sensing
    sensing_range: float = math.inf
    """A tracker sees the target up to this distance, m; ``inf``: at any."""
    field_of_view: float = 2.0 * math.pi
    """Full angle of the target sensor about the heading, rad, in (0, 2π]."""
    range_noise: float = 0.0
    """Standard deviation of a measured range, as a share of the range. Cut at three."""
    bearing_noise: float = 0.0
    """Standard deviation of a measured bearing, rad. Cut at three."""
    velocity_smoothing: float = 0.0
    """Time constant of the velocity worked out from successive fixes, s; 0: none."""
    sonar_beams: int = 8
    """Beams of the sonar ring, evenly spaced from straight ahead; 0 to 64."""
    sonar_range: float = 2.0
    """Reach of the sonar, from the robot's rim, m."""

    # Radio
    radio_range: float = math.inf
    """Trackers hear each other up to this distance, m; ``inf``: at any."""
    radio_delay: int = 0
    """Control steps between sending and hearing. 0: in the observation that follows the step."""
    radio_loss: float = 0.0
    """Probability that a message is lost, for each pair and step, in [0, 1)."""
    message_size: int = 0
    """Numbers that a policy may add to each broadcast."""
    forget_after: float = 5.0
    """A team-mate not heard for this long is dropped from the observation, s."""
    num_neighbours: int | None = None
    """Places for team-mates in an observation; ``None``: min(num_trackers - 1, 8)."""

    # Faults
    breaks: int = 0
    """Trackers that break for good during an episode, 0 to num_trackers - 1."""
    break_choice: str = "nearest"
    """Which one: ``"nearest"`` to the target at that moment (where a leader is), ``"drawn"``, or
    ``"given"`` by number."""
    break_number: int = 0
    """Number of the tracker that breaks where it is given."""
    break_window: tuple[float, float] = (0.4, 0.6)
    """When, as shares of the horizon: drawn between the two."""
    sensor_outages: float = 0.0
    """Probability that a tracker's target sensor goes dead for ``outage_time``, once."""
    radio_outages: float = 0.0
    """Probability that a tracker's radio goes dead for ``outage_time``, once."""
    outage_time: float = 5.0
    """Length of an outage, s; it starts at a time drawn over the episode."""

    # Reward
    reward_weights: Mapping[str, float] | tuple[tuple[str, float], ...] = (
        ("slot", 1.0),
        ("progress", 0.5),
        ("contact", -0.2),
    )
    """Weight of each reward term by name (``posse.REWARD_TERMS`` lists them); others weigh 0."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "reward_weights", _weights(self.reward_weights))
        _check(self)

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
        """Whether a robot far from anything moves on one arc for the whole control step."""
        turn = max(self.tracker_turn_rate, self.target_turn_rate) * self.control_step
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
        """How far from every wall the target starts, m: room to turn away either way."""
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
        return self.start_extent + self.tracker_speed * self.duration

    @property
    def range_bound(self) -> float:
        """Greatest distance between any two places that robots can reach, m."""
        return 2 * math.sqrt(2) * self.position_bound

    @property
    def slot_turn_rate(self) -> float:
        """Greatest turn rate of the slot frame, rad/s: what a robot in the outermost slot follows.

        ω_s = min(0.8 (V - v_t), v_t) / ρ_max, so that no slot ever has to move backwards nor
        faster than a tracker can.
        """
        rho = max(math.hypot(x, y) for x, y in slot_offsets(self))
        return min(0.8 * (self.tracker_speed - self.target_speed), self.target_speed) / rho

    def replace(self, **overrides: Any) -> Scenario:
        """Return a copy with some fields changed.

        Raises:
            ScenarioError: An unknown field (the message names near ones) or an impossible value.
        """
        names = [field.name for field in dataclasses.fields(self)]
        for key in overrides:
            if key not in names:
                raise ScenarioError(
                    f"unknown setting {key!r} of a scenario{_near(key, names)}; "
                    f"settings are: {', '.join(names)}"
                )
        return dataclasses.replace(self, **overrides)

    def to_dict(self) -> dict[str, Any]:
        """Return every field by name, as plain values (``inf`` stays a float)."""
        values = dataclasses.asdict(self)
        values["reward_weights"] = dict(self.reward_weights)
        return values


SAFE_MARGIN: Final = 0.1
"""Free width that a scripted target keeps to obstacles and walls, m."""

OPEN_PLANE_EXTENT: Final = 10.0
"""On the open plane the target starts within this of the origin along each axis, m.

The trackers' common frame is the world's; were the target to start at the origin, their odometry
would give its place away.
"""


def _near(name: str, names: list[str] | tuple[str, ...]) -> str:
    near = difflib.get_close_matches(name, names, n=3)
    return f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""


def _check(s: Scenario) -> None:
    _check_types(s)
    _check_ranges(s)
    _check_motion(s)
    _check_formation(s)
    _check_place(s)
    _check_rounding(s)
    _check_rewards(s)


def _weights(given: object) -> tuple[tuple[str, float], ...]:
    """Return reward weights in the one order that makes equal scenarios compare equal."""
    try:
        weights = dict(given)  # type: ignore[call-overload]
        return tuple(sorted(weights.items()))
    except (TypeError, ValueError):
        raise ScenarioError(
            f"reward_weights={given!r} is not possible: it must map names of terms to numbers"
        ) from None


def _fail(name: str, value: object, allowed: str) -> NoReturn:
    raise ScenarioError(f"{name}={value!r} is not possible: {allowed}")


_INTEGERS = (
    "version", "num_trackers", "horizon", "num_obstacles", "sonar_beams", "radio_delay",
    "message_size", "breaks", "break_number",
)  # fmt: skip
_GREATEST_WHOLE: Final = 2**62
_PAIRS = ("obstacle_radius", "start_distance", "break_window")
_TEXTS = ("name", "target_motion", "formation", "break_choice")
_MAY_BE_INFINITE = (
    "arena", "sensing_range", "radio_range", "tracker_acceleration", "tracker_turn_acceleration",
)  # fmt: skip


def _is_number(value: object) -> bool:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    return not isinstance(value, int) or abs(value) <= _GREATEST_WHOLE


def _check_types(s: Scenario) -> None:
    for field in dataclasses.fields(s):
        name, value = field.name, getattr(s, field.name)
        if name in _INTEGERS or (name == "num_neighbours" and value is not None):
            if not isinstance(value, int) or isinstance(value, bool):
                _fail(name, value, "it must be a whole number")
        elif name in _TEXTS:
            if not isinstance(value, str):
                _fail(name, value, "it must be a string")
        elif name in _PAIRS:
            if not (
                isinstance(value, tuple)
                and len(value) == 2
                and all(_is_number(v) and math.isfinite(v) for v in value)
                and 0 <= value[0] <= value[1]
            ):
                _fail(name, value, "it must be a tuple (least, greatest), 0 <= least <= greatest")
        elif name == "terminate_on_contact":
            if not isinstance(value, bool):
                _fail(name, value, "it must be True or False")
        elif name not in ("reward_weights", "num_neighbours"):
            if not _is_number(value) or math.isnan(value):
                _fail(name, value, "it must be a number")
            if math.isinf(value) and name not in _MAY_BE_INFINITE:
                _fail(name, value, "it must be finite")


# What float32 can work with: finer or wider than this, steps and squares would be lost to rounding.
_SMALL: Final = 1e-3
_WIDE: Final = 1e4
FAR: Final = 1.0e6
"""What stands for an unlimited range in the kernels; robots never come nearly as far apart, m."""
_FARTHEST: Final = 2000.0
"""Greatest coordinate of a robot, m: up to there float32 lie at most 1.2e-4 m apart."""
_LONGEST_MOVE: Final = 2000.0
"""Greatest square of the distance in a physics step per radius, m: d² <= 2,000 r.

In float32 the squares of the sweep are off by about 2^-22 d², and so the place where discs of
radius r meet by 2^-22 d² / (4 r): 1.2e-4 m at most.
"""
_LEAST_CHANGE: Final = 16
"""Least change in a physics step, in spacings of float32: rounding costs it at most 1/32."""
_MOST_WEIGHT: Final = 1e6
"""Of a reward term. Terms are below 1e4: an episode's sum stays far below float32's 3e38."""

# name -> (least, greatest, least is allowed)
_RANGES: Final[dict[str, tuple[float, float, bool]]] = {
    "version": (1, math.inf, True),
    "num_trackers": (1, MAX_TRACKERS, True),
    "tracker_speed": (_SMALL, 1000, True),
    "tracker_turn_rate": (_SMALL, _WIDE, True),
    "tracker_acceleration": (_SMALL, FAR, True),
    "tracker_turn_acceleration": (_SMALL, FAR, True),
    "robot_radius": (_SMALL, _WIDE, True),
    "target_speed": (0, 1000, True),
    "target_turn_rate": (_SMALL, _WIDE, True),
    "formation_distance": (0, _WIDE, False),
    "formation_spacing": (0, _WIDE, False),
    "tolerance": (_SMALL, _WIDE, True),
    "settle_time": (0, math.inf, False),
    "control_step": (1e-4, 100, True),
    "physics_step": (1e-4, 100, True),
    "horizon": (1, 1_000_000, True),
    "arena": (0, 2 * _FARTHEST, False),
    "num_obstacles": (0, MAX_OBSTACLES, True),
    "obstacle_gap": (0, _WIDE, True),
    "sensing_range": (0, FAR, False),
    "field_of_view": (0, 2 * math.pi + 1e-9, False),
    "range_noise": (0, 0.3, True),
    "bearing_noise": (0, 0.5, True),
    "velocity_smoothing": (0, _WIDE, True),
    "sonar_beams": (0, 64, True),
    "sonar_range": (_SMALL, _WIDE, True),
    "radio_range": (0, FAR, False),
    "radio_delay": (0, 100, True),
    "radio_loss": (0, 0.999, True),
    "message_size": (0, 64, True),
    "forget_after": (0, _WIDE, False),
    "num_neighbours": (0, MAX_TRACKERS - 1, True),
    "breaks": (0, MAX_TRACKERS - 1, True),
    "break_number": (0, MAX_TRACKERS - 1, True),
    "sensor_outages": (0, 1, True),
    "radio_outages": (0, 1, True),
    "outage_time": (0, _WIDE, False),
}
_GREATEST_OF_PAIR: Final = {
    "obstacle_radius": _WIDE,
    "start_distance": _FARTHEST,
    "break_window": 1.0,
}


def _check_ranges(s: Scenario) -> None:
    for name, (least, greatest, closed) in _RANGES.items():
        value = getattr(s, name)
        may_be_infinite = name in _MAY_BE_INFINITE
        if value is None or (may_be_infinite and value == math.inf):
            continue
        if value < least or value > greatest or (value == least and not closed):
            opening = "[" if closed else "("
            closing = ")" if math.isinf(greatest) else "]"
            or_not = ", or be inf" if may_be_infinite and math.isfinite(greatest) else ""
            _fail(name, value, f"it must lie in {opening}{least:g}, {greatest:g}{closing}{or_not}")
    for name, greatest in _GREATEST_OF_PAIR.items():
        if getattr(s, name)[1] > greatest:
            _fail(name, getattr(s, name), f"both must lie in [0, {greatest:g}]")
    for name, values in (
        ("target_motion", TARGET_MOTIONS),
        ("formation", FORMATIONS),
        ("break_choice", BREAK_CHOICES),
    ):
        value = getattr(s, name)
        if value not in values:
            raise ScenarioError(
                f"unknown {name}={value!r}{_near(value, values)}; known: {', '.join(values)}"
            )


def _check_motion(s: Scenario) -> None:
    if s.target_speed > 0.9999 * s.tracker_speed:
        raise ScenarioError(
            f"target_speed={s.target_speed:g} must be below tracker_speed={s.tracker_speed:g}, by "
            "0.01 % at least: a team that is no faster never catches up (paper, assumption ii)"
        )
    if s.target_speed == 0 and s.target_motion != "constant":
        _fail("target_speed", s.target_speed, "only a target of constant motion may rest")
    steps = s.control_step / s.physics_step
    if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
        raise ScenarioError(
            f"control_step={s.control_step:g} must be a whole multiple of "
            f"physics_step={s.physics_step:g}"
        )
    for name in ("tracker_turn_rate", "target_turn_rate"):
        turn = getattr(s, name) * s.physics_step
        if turn > 1.0:
            raise ScenarioError(
                f"{name}={getattr(s, name):g} turns {turn:.2f} rad in a physics step, at most 1 is "
                f"possible: choose physics_step <= {1 / getattr(s, name):.3g}"
            )
    if s.breaks >= s.num_trackers > 0 and s.breaks > 0:
        _fail("breaks", s.breaks, f"at most num_trackers - 1 = {s.num_trackers - 1}")
    if s.break_choice == "given" and s.breaks > 1:
        _fail("breaks", s.breaks, 'break_choice="given" names one tracker, break_number')
    if s.break_choice == "given" and s.break_number >= s.num_trackers:
        _fail("break_number", s.break_number, f"trackers are 0 to {s.num_trackers - 1}")
    if s.settle_time > s.duration:
        _fail(
            "settle_time", s.settle_time,
            f"an episode of horizon={s.horizon} steps of {s.control_step:g} s is over before that",
        )  # fmt: skip


def _check_formation(s: Scenario) -> None:
    offsets = slot_offsets(s)
    apart = min(
        (math.dist(a, b) for i, a in enumerate(offsets) for b in offsets[:i]), default=math.inf
    )
    if apart <= 2 * s.tolerance + 1e-9:
        raise ScenarioError(
            f"slots of the {s.formation} lie {apart:.3g} m apart, which must be more than twice "
            f"tolerance={s.tolerance:g}: raise formation_spacing={s.formation_spacing:g} "
            "or lower tolerance"
        )
    if apart <= 2 * s.robot_radius:
        raise ScenarioError(
            f"slots of the {s.formation} lie {apart:.3g} m apart, robots of "
            f"robot_radius={s.robot_radius:g} would touch: raise formation_spacing"
        )
    nearest = min(math.hypot(x, y) for x, y in offsets)
    if nearest <= 2 * s.robot_radius:
        raise ScenarioError(
            f"formation_distance={s.formation_distance:g} leaves a slot {nearest:.3g} m from the "
            f"target, which robots of robot_radius={s.robot_radius:g} touch: raise it"
        )


def _check_place(s: Scenario) -> None:
    if s.position_bound > _FARTHEST:
        raise ScenarioError(
            f"robots could come {s.position_bound:.3g} m from the origin along an axis, at most "
            f"{_FARTHEST:g} m is possible: lower tracker_speed={s.tracker_speed:g}, "
            f"horizon={s.horizon}, control_step={s.control_step:g} or "
            f"start_distance={s.start_distance}, or set an arena"
        )
    if s.start_distance[0] <= 2 * s.robot_radius:
        _fail(
            "start_distance", s.start_distance,
            f"trackers must start clear of the target, beyond {2 * s.robot_radius:g} m",
        )  # fmt: skip
    ring = math.pi * (s.start_distance[1] ** 2 - s.start_distance[0] ** 2)
    excluded = s.num_trackers * math.pi * (2 * s.robot_radius + START_CLEARANCE) ** 2
    if not math.isfinite(s.arena):
        if s.num_obstacles:
            raise ScenarioError(
                f"num_obstacles={s.num_obstacles} needs a walled place: set arena to its side in m"
            )
        if excluded > ring:
            raise ScenarioError(
                f"{s.num_trackers} trackers do not fit at start_distance={s.start_distance}: "
                "widen it, or lower num_trackers or robot_radius"
            )
        return
    if s.obstacle_radius[0] <= 0 and s.num_obstacles:
        _fail("obstacle_radius", s.obstacle_radius, "radii must be above 0")
    if s.target_extent <= 0 or s.arena / 2 <= s.start_distance[0]:
        raise ScenarioError(
            f"arena={s.arena:g} is too small for start_distance={s.start_distance} and a target "
            f"that needs {s.target_clearance:.3g} m to turn away from a wall: raise arena"
        )
    width = 2 * s.obstacle_radius[1] + s.obstacle_gap
    taken = s.num_obstacles * math.pi * width**2
    if taken > 0.9 * (s.arena - width) ** 2:
        raise ScenarioError(
            f"num_obstacles={s.num_obstacles} of obstacle_radius up to {s.obstacle_radius[1]:g} m "
            f"with obstacle_gap={s.obstacle_gap:g} do not fit in arena={s.arena:g}: "
            "lower their number, radius or gap, or raise arena"
        )
    circle = s.target_speed / s.target_turn_rate + s.robot_radius + SAFE_MARGIN
    blocked = s.num_obstacles * math.pi * (s.obstacle_radius[1] + circle) ** 2
    if s.target_motion != "agent" and blocked > 0.9 * (s.arena - 2 * circle) ** 2:
        raise ScenarioError(
            f"num_obstacles={s.num_obstacles} leave no room to a target that needs {circle:.3g} m "
            f"to turn round at target_turn_rate={s.target_turn_rate:g}: lower their number or "
            "target_speed, or raise target_turn_rate or arena"
        )
    room = _room_to_start(s)
    width = s.obstacle_radius[1] + s.robot_radius + START_CLEARANCE
    room *= 1 - min(1, s.num_obstacles * math.pi * width**2 / s.arena**2)
    if excluded > room:
        raise ScenarioError(
            f"{s.num_trackers} trackers do not fit at start_distance={s.start_distance} in "
            f"arena={s.arena:g}: widen them, or lower num_trackers or robot_radius"
        )


def _room_to_start(s: Scenario) -> float:
    """Return the area within the walls where trackers may start, for the worst place of the target.

    By summing over a grid of distances and bearings, m².
    """
    least, most = s.start_distance
    inner = s.arena / 2 - s.robot_radius - START_CLEARANCE
    distances = [least + (most - least) * (k + 0.5) / 16 for k in range(16)]
    bearings = [2 * math.pi * (k + 0.5) / 64 for k in range(64)]
    areas = []
    for at in (0.0, s.target_extent):  # the middle, and a corner
        area = 0.0
        for d in distances:
            inside = sum(
                abs(at + d * math.cos(b)) <= inner and abs(at + d * math.sin(b)) <= inner
                for b in bearings
            )
            area += inside / 64 * 2 * math.pi * d * (most - least) / 16
        areas.append(area)
    return min(areas)


def _check_rounding(s: Scenario) -> None:
    """Raise where the kernels' float32 would lose what the scenario asks for."""
    move, longest = s.tracker_speed * s.physics_step, math.sqrt(_LONGEST_MOVE * s.robot_radius)
    if move > longest:
        raise ScenarioError(
            f"tracker_speed={s.tracker_speed:g} moves {move:.3g} m in a physics step, contact of "
            f"robots of robot_radius={s.robot_radius:g} is exact up to {longest:.3g} m: choose "
            f"physics_step <= {longest / s.tracker_speed:.3g}"
        )
    for name, added_to, most in (
        ("tracker_speed", "a position", s.position_bound),
        ("target_speed", "a position", s.position_bound),
        ("tracker_turn_rate", "a heading", 1.0),
        ("target_turn_rate", "a heading", 1.0),
        ("tracker_acceleration", "a speed", s.tracker_speed),
        ("tracker_turn_acceleration", "a turn rate", s.tracker_turn_rate),
    ):
        value = getattr(s, name)
        least = _LEAST_CHANGE * _spacing(most) / s.physics_step
        if 0 < value < least:
            raise ScenarioError(
                f"{name}={value:g} adds {value * s.physics_step:.3g} to {added_to} of up to "
                f"{most:.3g} in a physics step, which float32 loses to rounding: choose {name} >= "
                f"{least:.3g}, or a longer physics_step={s.physics_step:g}"
            )
    outermost = max(math.hypot(x, y) for x, y in slot_offsets(s))
    if outermost > _FARTHEST:
        raise ScenarioError(
            f"formation_spacing={s.formation_spacing:g} and "
            f"formation_distance={s.formation_distance:g} put a slot {outermost:.3g} m from the "
            f"target, at most {_FARTHEST:g} m is possible: lower them or num_trackers"
        )


def _spacing(value: float) -> float:
    """Return how far the neighbouring float32 lie from a number."""
    return math.ulp(value) * 2.0**29  # a double has 29 more bits


START_CLEARANCE: Final = 0.2
"""Least free width between robots, and between a robot and an obstacle, at the start, m."""


def _check_rewards(s: Scenario) -> None:
    names = tuple(term.name for term in REWARD_TERMS)
    for name, weight in dict(s.reward_weights).items():
        if name not in names:
            raise ScenarioError(
                f"unknown reward term {name!r} in reward_weights{_near(str(name), names)}; "
                f"terms are: {', '.join(names)}"
            )
        if not _is_number(weight) or not math.isfinite(weight):
            _fail(f"reward_weights[{name!r}]", weight, "a weight must be a finite number")
        if abs(weight) > _MOST_WEIGHT:
            _fail(
                f"reward_weights[{name!r}]", weight,
                f"a weight must lie in [-{_MOST_WEIGHT:g}, {_MOST_WEIGHT:g}]: scale all of them",
            )  # fmt: skip
