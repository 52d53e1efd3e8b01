"""The settings of a world: one frozen dataclass, and the checks of its fields against each other.

Scenarios with equal fields define the same benchmark. Named ones are in :mod:`posse.scenarios.named`.

A slot of the formation is a polar offset (r, β) from the target in the slot frame ψ; β = π is behind the target. The
frame follows the target's heading at a limited rate, so that a robot that does not reverse can follow every slot
(:attr:`Scenario.slot_turn_rate`).
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import math
import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from posse.declarations import (
    FIELDS,
    METRICS,
    REWARD_TERMS,
    SENSORS,
    TARGET_MOTIONS,
    Declarations,
    Registry,
    field,
    metric,
    reward_term,
    unknown,
)
from posse.scenarios.setting import Setting, UnknownSettingError, fail, setting

FORMATIONS: Final = ("wedge", "ring", "rows")

# The limits of all scenarios, including those of float32.
MAX_BEAMS: Final = 64
MAX_TRACKERS: Final = 64  # contacts and radio links are bits of one 64-bit word
MAX_OBSTACLES: Final = 60  # the four walls use the last bits

SAFE_MARGIN: Final = 0.1
"""Clearance that a scripted target keeps to obstacles and walls, m."""
OPEN_PLANE_EXTENT: Final = 10.0
"""On the open plane the target starts within this of the origin along each axis, m.

The common frame of the trackers is that of the world: if the target started at the origin, odometry
would reveal its position.
"""

SLACK: Final = 1.001
"""Factor by which bounds of observations and states are widened to allow for float32 rounding."""

# Beyond these, increments and squares would be lost to rounding.
SMALL: Final = 1e-3
WIDE: Final = 1e4
UNLIMITED: Final = 1.0e6
"""Value of an unlimited range in the kernels, far beyond any distance of robots, m."""
FARTHEST: Final = 500.0
"""Greatest coordinate of a robot, m: the spacing of float32 there, 3e-5 m, keeps contact exact to 1e-4 m."""
LONGEST_MOVE: Final = 2000.0
"""Greatest square of the distance in a physics step per radius, m: d² <= 2,000 r.

In float32 the squares of the sweep have an error of about 2^-22 d², and hence the contact point of
discs of radius r one of 2^-22 d² / (4 r): 1.2e-4 m at most.
"""

_WEIGHT: Final = ("1", -1e6, 1e6)  # terms are below 1e4, so sums stay far below 3e38


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One benchmark: team, target, environment, sensing, radio, faults and reward.

    Lengths are in metres, times in seconds, speeds in m/s, angles in radians, turn rates in rad/s. Every field can be
    overridden by keyword: ``posse.parallel_env("smart", num_trackers=8)``. :meth:`settings` lists the fields with unit,
    range and meaning. An invalid field, or one that does not fit the others, is a :class:`ScenarioError`.
    """

    name: str = setting(dataclasses.MISSING, "name in results and policy cards")
    meaning: str = setting("", "what the scenario asks of a team, in one sentence", compare=False)
    version: int = setting(1, "incremented when the behaviour of the named scenario changes", "1", 1, 1e6)

    # The team
    num_trackers: int = setting(5, "robots in the team (paper, section 4: five)", "1", 1, MAX_TRACKERS)
    tracker_speed: float | tuple[float, ...] = setting(
        1.0, "greatest speed of a tracker, or of each; above target_speed (paper, assumption ii)", "m/s", SMALL, 1000
    )
    tracker_turn_rate: float | tuple[float, ...] = setting(
        2.0, "greatest turn rate of a tracker, or of each", "rad/s", SMALL, WIDE
    )
    tracker_acceleration: float = setting(
        math.inf, "greatest change of a tracker's speed; inf: no limit", "m/s²", SMALL, UNLIMITED, infinite=True
    )
    tracker_turn_acceleration: float = setting(
        math.inf, "greatest change of a tracker's turn rate; inf: no limit", "rad/s²", SMALL, UNLIMITED, infinite=True
    )
    actuator_lag: float = setting(
        0.0, "time constant with which a tracker's speed and turn rate follow the command; 0: at once", "s", 0, 100
    )
    command_delay: int = setting(0, "control steps after which a tracker executes a command", "steps", 0, 100)
    wheel_base: float = setting(
        0.0,
        "distance b of a tracker's two wheels: V + |ω| b / 2 is at most its greatest speed; 0: no such limit",
        "m",
        0,
        WIDE,
    )
    robot_radius: float = setting(0.15, "radius of every robot's disc, trackers and target", "m", SMALL, WIDE)

    # The target
    target_motion: str = setting(
        "constant", "how the target moves (paper, section 2); agent: a policy controls it", choices=TARGET_MOTIONS
    )
    target_speed: float = setting(0.6, "speed of the target; an agent's greatest", "m/s", 0, 1000)
    target_turn_rate: float = setting(1.0, "greatest turn rate of the target", "rad/s", SMALL, WIDE)

    # The formation
    formation: str = setting(
        "wedge", "wedge: behind the target, as in the paper; ring: around it; rows: a block behind", choices=FORMATIONS
    )
    formation_distance: float = setting(
        1.2, "from the target to the nearest slot (ring: least radius; rows: first row)", "m", 0, FARTHEST, above=True
    )
    formation_spacing: float = setting(
        1.2, "between neighbouring slots (ring: at least); more than twice the tolerance", "m", 0, FARTHEST, above=True
    )
    tolerance: float = setting(0.3, "a slot is occupied when a tracker is within this distance", "m", SMALL, WIDE)
    settle_time: float = setting(
        3.0, "the team has settled when all slots were held for this long, or for the episode", "s", 0, 1e8, above=True
    )

    # Time
    control_step: float = setting(0.1, "between two actions; a whole multiple of physics_step", "s", 1e-4, 100)
    physics_step: float = setting(0.05, "between two checks of what blocks a robot", "s", 1e-4, 100)
    horizon: int = setting(600, "control steps in an episode", "steps", 1, 1_000_000)
    terminate_on_contact: bool = setting(False, "whether the episode ends when any tracker touches anything")

    # The arena
    arena: float | tuple[float, float] = setting(
        math.inf,
        "side of the walled square, or width and height of the walled rectangle, along x and y; inf: the open plane",
        "m",
        0,
        2 * FARTHEST,
        above=True,
        infinite=True,
    )
    num_obstacles: int = setting(0, "discs in the arena; require an arena", "1", 0, MAX_OBSTACLES)
    obstacle_radius: tuple[float, float] = setting(
        (0.4, 0.8), "least and greatest radius of an obstacle", "m", 0, 2 * FARTHEST, above=True
    )
    obstacle_gap: float = setting(
        1.2, "least clearance between two obstacles, and between an obstacle and a wall", "m", 0, WIDE
    )
    start_distance: tuple[float, float] = setting(
        (4.0, 10.0), "least and greatest distance of a tracker from the target at the start", "m", 0, 2 * FARTHEST
    )

    # Sensing
    sensor: str = setting("range-bearing", "kind of the target sensor", choices=SENSORS)
    sensing_range: float = setting(
        math.inf, "a tracker sees the target up to this distance; inf: at any", "m", 0, WIDE, above=True, infinite=True
    )
    field_of_view: float = setting(
        2.0 * math.pi, "full angle of the target sensor about the heading", "rad", 0, 2 * math.pi + 1e-9, above=True
    )
    range_noise: float = setting(
        0.0, "standard deviation of a measured range, as a share of the range; truncated at three", "1", 0, 0.3
    )
    bearing_noise: float = setting(0.0, "standard deviation of a measured bearing; truncated at three", "rad", 0, 0.5)
    velocity_smoothing: float = setting(
        0.0, "time constant of the velocity estimated from fixes of every step; 0: none", "s", 0, WIDE
    )
    heading_noise: float = setting(
        0.0, "standard deviation of the target's measured heading and ψ; truncated at three", "rad", 0, 0.5
    )
    odometry_drift: float = setting(
        0.0, "random walk of a tracker's own position, which it observes and broadcasts", "m/√s", 0, 1
    )
    heading_drift: float = setting(0.0, "the same of its own heading", "rad/√s", 0, 1)
    sonar_beams: int = setting(8, "beams of the sonar ring, evenly spaced from straight ahead", "1", 0, MAX_BEAMS)
    sonar_range: float = setting(2.0, "range of the sonar, from the robot's rim", "m", SMALL, WIDE)

    # Radio
    radio_range: float = setting(
        math.inf, "trackers hear each other up to this distance; inf: at any", "m", 0, WIDE, above=True, infinite=True
    )
    radio_delay: int = setting(0, "delay of messages; 0: received in the observation after the step", "steps", 0, 100)
    radio_loss: float = setting(0.0, "probability that a message is lost, for each pair and step", "1", 0, 0.999)
    message_size: int = setting(0, "numbers that a policy can add to each broadcast", "1", 0, 64)
    forget_after: float = setting(
        5.0, "time after which a silent team-mate is dropped from the observation", "s", 0, WIDE, above=True
    )
    num_neighbours: int | None = setting(
        None, "places for team-mates in an observation; None: min(num_trackers - 1, 8)", "1", 0, MAX_TRACKERS - 1
    )

    # Faults
    breaks: int = setting(0, "trackers that break during an episode, below num_trackers", "1", 0, MAX_TRACKERS - 1)
    break_choice: str = setting(
        "nearest",
        "which one breaks: the nearest to the target then (usually the leader), or any",
        choices=("nearest", "drawn"),
    )
    break_window: tuple[float, float] = setting(
        (0.4, 0.6), "interval of the time of a break, as shares of the horizon", "1", 0, 1
    )
    sensor_outages: float = setting(
        0.0, "probability that a tracker's target sensor fails once for outage_time", "1", 0, 1
    )
    radio_outages: float = setting(0.0, "probability that a tracker's radio fails once for outage_time", "1", 0, 1)
    outage_time: float = setting(
        5.0, "length of an outage; its start is drawn over the episode", "s", 0, WIDE, above=True
    )

    # Declarations of the user's own
    extra_fields: tuple[str, ...] = setting((), "observation fields of your own, by name: docs/extend.md", "1")
    metrics: tuple[str, ...] = setting((), "metrics of your own, by name: docs/extend.md", "1")

    # Reward
    reward_weights: Mapping[str, float] | tuple[tuple[str, float], ...] = setting(
        (("slot", 1.0), ("progress", 0.5), ("contact", -0.2)),
        "weight of each reward term by name (posse.REWARD_TERMS); others: 0",
        *_WEIGHT,
    )
    target_reward_weights: Mapping[str, float] | tuple[tuple[str, float], ...] = setting(
        (("team", -1.0),), "the same for a target that is an agent: contact, effort, team", *_WEIGHT
    )

    def __post_init__(self) -> None:
        for name, declared in self.settings().items():
            object.__setattr__(self, name, declared.accept(name, getattr(self, name)))
        # Whether a start can be drawn is found at the reset (posse.rules.start.check_drawn).
        for conflicts in (_in_team, _in_time_and_space, _in_declarations):
            for name, why in conflicts(self):
                fail(name, getattr(self, name), why)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the settings, and which modules of a user's they need."""
        return _unpickled, (Declarations.of(self).modules, self.__dict__.copy())

    @staticmethod
    @functools.cache
    def settings() -> Mapping[str, Setting]:
        """Return the declaration of every field by name: unit, range, meaning."""
        return {field.name: field.metadata["setting"](kind=field.type) for field in dataclasses.fields(Scenario)}

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
    def duration(self) -> float:
        """Length of an episode, s."""
        return self.horizon * self.control_step

    @property
    def outage_steps(self) -> int:
        """Control steps of an outage."""
        return max(1, round(self.outage_time / self.control_step))

    @property
    def num_agents(self) -> int:
        """Rows of an action: the trackers, and the target where it is an agent."""
        return self.num_trackers + self.target_is_agent

    @property
    def target_is_agent(self) -> bool:
        """Whether a policy controls the target."""
        return self.target_motion == "agent"

    @property
    def target_clearance(self) -> float:
        """Distance from every wall at which the target starts, m: room to turn either way."""
        return 2 * self.target_speed / self.target_turn_rate + self.robot_radius + SAFE_MARGIN

    @property
    def half_sides(self) -> tuple[float, float]:
        """Half the width and half the height of the arena, along x and y, m; ``inf``: the open plane."""
        width, height = self.arena if isinstance(self.arena, tuple) else (self.arena, self.arena)
        return width / 2, height / 2

    @property
    def walled(self) -> bool:
        """Whether there is an arena."""
        return self.arena != math.inf

    @property
    def start_extent(self) -> tuple[float, float]:
        """Greatest absolute x and y of any robot at the start, m."""
        if self.walled:
            return self.half_sides
        extent = OPEN_PLANE_EXTENT + self.start_distance[1]
        return extent, extent

    @property
    def target_extent(self) -> tuple[float, float]:
        """Greatest absolute x and y of the target at the start, m."""
        if not self.walled:
            return OPEN_PLANE_EXTENT, OPEN_PLANE_EXTENT
        clearance = self.robot_radius if self.target_is_agent else self.target_clearance
        x, y = self.half_sides
        return x - clearance, y - clearance

    @property
    def position_bound(self) -> float:
        """Greatest absolute coordinate that any robot can reach, m."""
        if self.walled:
            return max(self.half_sides)
        return max(self.start_extent) + max(self.tracker_speeds) * self.duration

    @property
    def range_bound(self) -> float:
        """Greatest distance between any two reachable positions, m."""
        x, y = self.half_sides if self.walled else (self.position_bound, self.position_bound)
        # By the ratio of the sides, so that a square's is √2 times its side to the last bit.
        return 2 * math.hypot(1.0, min(x, y) / max(x, y)) * max(x, y)

    @property
    def drifts(self) -> bool:
        """Whether a tracker's own pose, as it knows it, drifts away from the true one."""
        return self.odometry_drift > 0 or self.heading_drift > 0

    @property
    def perfect_radio(self) -> bool:
        """Whether working trackers always receive each other's messages without delay."""
        reliable = self.radio_delay == 0 and self.radio_loss == 0 and self.radio_outages == 0 and self.breaks == 0
        return reliable and not self.drifts and math.isinf(self.radio_range)

    @property
    def drift_bound(self) -> float:
        """Greatest error of a tracker's own position along an axis, m."""
        return 3 * self.odometry_drift * math.sqrt(self.control_step) * self.horizon

    @property
    def slot_offsets(self) -> list[tuple[float, float]]:
        """The (x, y) of each slot in the slot frame, m; x points ahead.

        ========== ====================================================================================
        wedge      the first slot straight behind the target, the others alternating on two wings that
                   extend backwards at 45 degrees, ``formation_spacing`` apart
        ring       evenly around the target, the first slot behind it; the radius grows with the team so
                   that neighbours are ``formation_spacing`` apart, and is at least ``formation_distance``
        rows       a block behind the target, as wide as deep, ``formation_spacing`` apart
        ========== ====================================================================================
        """
        number, distance, spacing = self.num_trackers, self.formation_distance, self.formation_spacing
        if self.formation == "ring":
            radius = max(distance, spacing / (2 * math.sin(math.pi / number))) if number > 1 else distance
            bearings = [math.pi + 2 * math.pi * i / number for i in range(number)]
            return [(radius * math.cos(b), radius * math.sin(b)) for b in bearings]
        if self.formation == "rows":
            width = math.ceil(math.sqrt(number))
            rows = [range(start, min(start + width, number)) for start in range(0, number, width)]
            return [
                (-distance - spacing * depth, spacing * (column - (len(row) - 1) / 2))
                for depth, row in enumerate(rows)
                for column in range(len(row))
            ]
        wing = spacing * math.sqrt(0.5)
        return [
            (-distance - wing * ((i + 1) // 2), wing * ((i + 1) // 2) * (1 if i % 2 else -1)) for i in range(number)
        ]

    @property
    def slot_turn_rate(self) -> float:
        """Greatest turn rate of the slot frame, rad/s.

        ω_s = min(0.8 (V - v_t), v_t) / ρ_max with V of the slowest tracker, so that no slot moves
        backwards or faster than a tracker.
        """
        rho = max(math.hypot(x, y) for x, y in self.slot_offsets)
        slowest = min(self.tracker_speeds)
        return min(0.8 * (slowest - self.target_speed), self.target_speed) / rho

    def replace(self, **overrides: Any) -> Scenario:
        """Return a copy with some fields changed; an unknown one is a ScenarioError that suggests similar ones."""
        for key in overrides:
            if key not in self.settings():
                # Libraries that try a keyword of their own look for the words of Python's TypeError.
                message = unknown("setting", key, self.settings())
                raise UnknownSettingError(f"unexpected keyword argument {reprlib.repr(key)}: {message}")
        return dataclasses.replace(self, **overrides)

    def to_dict(self) -> dict[str, Any]:
        """Return every field by name, as plain values (``inf`` stays a float)."""
        values = dataclasses.asdict(self)
        values["reward_weights"] = dict(self.reward_weights)
        values["target_reward_weights"] = dict(self.target_reward_weights)
        return values


def _unpickled(modules: list[str], settings: dict[str, Any]) -> Scenario:
    """Return a pickled scenario, and import the modules that its declarations come from."""
    for module in modules:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name != module:  # it is there, and lacks something itself
                raise
    return Scenario(**settings)  # which says what is not declared


_Conflicts = Iterator[tuple[str, str]]
"""Settings that do not fit the others, and why."""


def _in_team(s: Scenario) -> _Conflicts:
    for name in ("tracker_speed", "tracker_turn_rate"):
        each = getattr(s, name)
        if isinstance(each, tuple) and len(each) != s.num_trackers:
            yield name, f"{len(each)} values for num_trackers={s.num_trackers}: give one number, or one for each"
    slowest = min(s.tracker_speeds)
    if s.target_speed > 0.9999 * slowest:
        why = "by 0.01 % at least: a slower team cannot catch up (paper, assumption ii)"
        yield "target_speed", f"it must be below tracker_speed={slowest:g}, {why}"
    if s.target_speed < SMALL and s.target_motion != "constant":
        yield "target_speed", f"only a target of constant motion may rest: choose at least {SMALL:g}"
    for speed, rate in zip(s.tracker_speeds, s.tracker_turn_rates, strict=False):
        if rate * s.wheel_base / 2 > speed:
            why = f"wheels would turn at {rate * s.wheel_base / 2:.3g} m/s on the spot, tracker_speed is {speed:g}"
            yield "wheel_base", f"{why}: lower it, or tracker_turn_rate"
    if s.breaks >= s.num_trackers:
        yield "breaks", f"at most num_trackers - 1 = {s.num_trackers - 1}"
    offsets = s.slot_offsets
    apart = min((math.dist(a, b) for i, a in enumerate(offsets) for b in offsets[:i]), default=math.inf)
    if apart <= 2 * max(s.tolerance, s.robot_radius) + 1e-9:
        limits = f"tolerance={s.tolerance:g} and robot_radius={s.robot_radius:g}"
        why = f"slots of the {s.formation} lie {apart:.3g} m apart, which must be more than twice {limits}"
        yield "formation_spacing", f"{why}: raise it, or lower them"
    nearest = min(math.hypot(*slot) for slot in offsets)
    if nearest <= 2 * s.robot_radius:
        why = f"a slot lies {nearest:.3g} m from the target, which robots of robot_radius={s.robot_radius:g} touch"
        yield "formation_distance", f"{why}: raise it"


def _in_time_and_space(s: Scenario) -> _Conflicts:
    steps, fastest = s.control_step / s.physics_step, max(s.tracker_speeds)
    if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
        yield "control_step", f"it must be a whole multiple of physics_step={s.physics_step:g}"
    for name, rate in (("tracker_turn_rate", max(s.tracker_turn_rates)), ("target_turn_rate", s.target_turn_rate)):
        turn = rate * s.physics_step
        if turn > 1.0:
            most = f"at most 1 is possible: choose physics_step <= {1 / rate:.3g}"
            yield name, f"{rate:g} rad/s turns {turn:.2f} rad in a physics step, {most}"
    move, longest = fastest * s.physics_step, math.sqrt(LONGEST_MOVE * s.robot_radius)
    if move > longest:
        exact = f"contact of robots of robot_radius={s.robot_radius:g} is exact up to {longest:.3g} m"
        fix = f"choose physics_step <= {longest / fastest:.3g}"
        yield "tracker_speed", f"{fastest:g} m/s moves {move:.3g} m in a physics step, {exact}: {fix}"
    if s.position_bound > FARTHEST:
        come = f"robots could come {s.position_bound:.3g} m from the origin along an axis, at most {FARTHEST:g} m"
        others = f"tracker_speed={fastest:g}, control_step={s.control_step:g} or start_distance={s.start_distance}"
        yield "horizon", f"{come} is possible: lower it, {others}, or set an arena"
    if s.breaks and round(s.break_window[0] * s.horizon) + s.breaks > s.horizon:
        yield "break_window", f"it begins too late for breaks={s.breaks} in {s.horizon} steps: let it begin earlier"
    if s.start_distance[0] <= 2 * s.robot_radius:
        yield "start_distance", f"trackers must start clear of the target, beyond {2 * s.robot_radius:g} m"
    if s.num_obstacles and not s.walled:
        yield "num_obstacles", "obstacles need an arena: set arena to its side in m"
    if min(s.target_extent) <= 0:
        why = f"it is too small for a target that needs {s.target_clearance:.3g} m to turn away from a wall"
        yield "arena", f"{why}: raise arena or target_turn_rate, or lower target_speed"


def _in_declarations(s: Scenario) -> _Conflicts:
    of_target = Registry({name: term for name, term in REWARD_TERMS.items() if term.of_target is not None})
    for where, names, kind, known in (
        ("extra_fields", s.extra_fields, field.kind, FIELDS),
        ("metrics", s.metrics, metric.kind, METRICS),
        ("reward_weights", dict(s.reward_weights), reward_term.kind, REWARD_TERMS),
        ("target_reward_weights", dict(s.target_reward_weights), "term of a target", of_target),
    ):
        for name in names:
            if known is of_target and name in REWARD_TERMS and name not in known:
                yield where, f"{name!r} has no formula for a target: declare one by target=, or leave it out"
            elif name not in known:
                yield where, unknown(kind, name, known)
    for name in (name for name in s.extra_fields if FIELDS[name].built_in):
        yield "extra_fields", f"{name!r} is in every observation: leave it out"
