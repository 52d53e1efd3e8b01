"""The state of a batch: records with a leading axis E, with the meaning of each field.

E = worlds, N = trackers, M = obstacles, D = radio delay in steps, m = message size. In each array the data of one world
are contiguous, for locality of memory access. The dtypes do not depend on any size, so kernels are compiled once for
all scenarios of the same declarations.

A thread's scratch memory is one record whose fields are float32 arrays. Loops run over blocks of eight, so their
lengths are multiples of eight, including padding of the last block.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.declarations import SENSORS, TARGET_MOTIONS, Declarations
from posse.numeric import WIDTH, FloatArray, Lanes, Records, record_type
from posse.scenarios import Scenario
from posse.scenarios.scenario import FORMATIONS, MAX_BEAMS, MAX_OBSTACLES, MAX_TRACKERS, SAFE_MARGIN, UNLIMITED

BIT: Final = np.uint64(1)
NO_BITS: Final = np.uint64(0)
NEVER: Final = np.int32(2**30)
"""A control step later than any."""


_F, _I, _U = np.float32, np.int32, np.uint64

_NUMERIC: Final = {"int": _I, "bool": _I, "float": _F}


def _frame_turn(s: Scenario) -> float:
    """Return the greatest turn of the slot frame in a control step, rad."""
    return min(s.slot_turn_rate * s.control_step, math.pi / 2)


def _whole_arcs(s: Scenario) -> bool:
    """Return whether a robot with nothing near moves on one arc for the whole control step."""
    turn = max(*s.tracker_turn_rates, s.target_turn_rate) * s.control_step
    unlimited = math.isinf(s.tracker_acceleration) and math.isinf(s.tracker_turn_acceleration)
    return turn <= 1.0 and unlimited and s.actuator_lag == 0


def _share(time: float, constant: float) -> float:
    """Return the share by which a first-order lag of a time constant comes nearer to its goal in a time."""
    return 1 - math.exp(-time / constant) if constant > 0 else 1.0


_Numbers = dict[str, tuple[type, Callable[[Scenario], Any]]]

DERIVED: Final[_Numbers] = {
    **{name: (_I, attrgetter(name)) for name in ("neighbours", "physics_steps", "outage_steps", "walled")},
    **{name: (_I, attrgetter(name)) for name in ("drifts", "perfect_radio", "target_is_agent")},
    "settle_steps": (_I, lambda s: min(max(1, round(s.settle_time / s.control_step)), s.horizon)),
    "forget_steps": (_I, lambda s: int(s.forget_after / s.control_step + 1e-6)),
    "break_from": (_I, lambda s: round(s.break_window[0] * s.horizon)),
    "break_until": (_I, lambda s: round(s.break_window[1] * s.horizon)),
    "break_nearest": (_I, lambda s: s.break_choice == "nearest"),
    "motion": (_I, lambda s: TARGET_MOTIONS.of(s.target_motion).index(TARGET_MOTIONS[s.target_motion])),
    "mirrored": (_I, lambda s: TARGET_MOTIONS[s.target_motion].mirrored and s.walled),
    "sensor": (_I, lambda s: SENSORS.of(s.sensor).index(SENSORS[s.sensor])),
    "fix_bearing": (_I, lambda s: SENSORS[s.sensor].fix == "bearing"),  # 1: a fix is a bearing, else a position
    # 0: sensors return the target's true position
    "measured": (_I, lambda s: s.range_noise > 0 or s.bearing_noise > 0 or SENSORS[s.sensor].measure is not None),
    "all_round": (_I, lambda s: s.field_of_view >= 2 * math.pi - 1e-9),
    "formation": (_I, lambda s: FORMATIONS.index(s.formation)),
    "whole_arcs": (_I, _whole_arcs),
    "position_step": (_F, lambda s: s.odometry_drift * math.sqrt(s.control_step)),
    "heading_step": (_F, lambda s: s.heading_drift * math.sqrt(s.control_step)),
    "followed": (_F, lambda s: _share(s.physics_step, s.actuator_lag)),  # share of a command reached in a physics step
    "fastest": (_F, lambda s: max(s.tracker_speeds)),
    "speed_change": (_F, lambda s: s.tracker_acceleration * np.float32(s.physics_step)),
    "turn_change": (_F, lambda s: s.tracker_turn_acceleration * np.float32(s.physics_step)),
    "per_acceleration": (_F, lambda s: 1 / s.tracker_acceleration),  # 0: no limit
    "per_turn_acceleration": (_F, lambda s: 1 / s.tracker_turn_acceleration),
    "frame_c": (_F, lambda s: math.cos(_frame_turn(s))),
    "frame_s": (_F, lambda s: math.sin(_frame_turn(s))),
    "start_distance_least": (_F, lambda s: s.start_distance[0]),
    "start_distance_most": (_F, lambda s: s.start_distance[1]),
    "obstacle_radius_least": (_F, lambda s: s.obstacle_radius[0]),
    "obstacle_radius_most": (_F, lambda s: s.obstacle_radius[1]),
    "slots_reach": (_F, lambda s: max(math.hypot(*slot) for slot in s.slot_offsets)),
    "half_width": (_F, lambda s: s.half_sides[0]),
    "half_height": (_F, lambda s: s.half_sides[1]),
    "target_extent_x": (_F, lambda s: s.target_extent[0]),
    "target_extent_y": (_F, lambda s: s.target_extent[1]),
    "safe_distance": (_F, lambda s: s.robot_radius + SAFE_MARGIN),
    "view_cosine": (_F, lambda s: math.cos(s.field_of_view / 2)),
    # of half a beam's width, with an overlap, since rounding would hide what is exactly between two beams
    "beam_cosine": (_F, lambda s: math.cos(math.pi / s.sonar_beams) - 3e-7 if s.sonar_beams else 1.0),
    "smoothing": (_F, lambda s: _share(s.control_step, s.velocity_smoothing)),
}
"""What kernels read of a scenario beside its numbers: type and value."""


_SETTINGS: Final[_Numbers] = {
    name: (_NUMERIC[setting.kind], attrgetter(name))
    for name, setting in Scenario.settings().items()
    if setting.kind in _NUMERIC
}
_NUMBERS: Final = {**_SETTINGS, **DERIVED}

CONFIG: Final = record_type(*((name, kind) for name, (kind, _) in _NUMBERS.items()))
"""The scenario, for kernels: its numbers by the names of its settings, then :data:`DERIVED`; inf is ``UNLIMITED``."""

# Blocks of eight fields, which kernels read and write at once, as eight consecutive numbers of 4 bytes.


class Pose(NamedTuple):
    """Pose, motion and limits of eight trackers."""

    x: Lanes
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    turn_rate: Lanes
    max_speed: Lanes  # its own limits, from the scenario
    max_turn_rate: Lanes


class TargetPose(NamedTuple):
    """Pose and motion of the target of eight worlds, and two whole numbers."""

    x: Lanes
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    turn_rate: Lanes
    step: Lanes  # control steps since the start
    in_contact: Lanes  # 1: it is an agent, and touches anything


class Condition(NamedTuple):
    """Whole numbers of eight trackers."""

    broken_at: Lanes  # control step at which it broke, NEVER while it works
    sensor_dead_from: Lanes  # start of outages of outage_time
    radio_dead_from: Lanes
    sees: Lanes  # 1: its sensor sees the target
    near: Lanes  # 1: something may touch it in the next step
    touching: Lanes  # 1: it touches anything
    onsets: Lanes  # contacts that began in this step
    fix_step: Lanes  # when its best fix was taken; -1: none yet


class Fix(NamedTuple):
    """The fixes of eight trackers, in the common frame; a sensor of bearings gives the first two alone."""

    x: Lanes  # where the target was, m; a bearing: a unit vector
    y: Lanes
    cos: Lanes  # its heading; a bearing: 0
    sin: Lanes
    frame_cos: Lanes  # the slot frame ψ; a bearing: 0
    frame_sin: Lanes
    vx: Lanes  # m/s, from successive fixes
    vy: Lanes


class Heard(NamedTuple):
    """The last messages that eight trackers received from a team-mate; the first six fields are those of a pose."""

    x: Lanes
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    turn_rate: Lanes
    step: Lanes  # when it was sent; -1: never heard
    unused: Lanes  # makes a block of eight


class Odometry(NamedTuple):
    """How far the own poses of eight trackers, as they know them, are from the true ones."""

    x: Lanes  # m
    y: Lanes
    cos: Lanes  # of the heading's error
    sin: Lanes
    heading: Lanes  # rad
    unused_1: Lanes  # make a block of eight
    unused_2: Lanes
    unused_3: Lanes


_WORLD: Final = (
    ("seed", _U),  # as given by the user
    ("split", _I),  # index into SPLITS
    ("index", np.int64),  # number of the world within the seed
    ("episode", np.int64),  # number of the episode within the world
    ("key", _U),  # key of the episode's random draws
    ("over", _I),  # 1: the episode has ended, the world must be reset
    ("terminated", _I),
    *((name, _I if name in ("step", "in_contact") else _F) for name in TargetPose._fields),
    ("frame_cos", _F),
    ("frame_sin", _F),  # the slot frame, ψ
    ("goal_cos", _F),
    ("goal_sin", _F),  # goal heading of a scripted target
    ("touching", _U),  # bit mask of the trackers that touch the target
    ("onsets", _I),  # contacts of the target with trackers that began in the current step
    ("near", _I),  # 1: something may touch the target in the next step
    ("undrawn", _I),  # bits of what found no place at the start (posse.rules.start)
    ("break_step", _I),  # when the next tracker breaks (break_choice "nearest")
    ("breaks_left", _I),
    # inputs of the metrics
    ("working", _I),  # number of working trackers
    ("score", _F),  # of the current step
    ("tracker_steps", _I),  # control steps of all working trackers
    ("held", _I),  # consecutive steps with each working tracker in its own slot
    ("settled_at", _I),
    ("detected_at", _I),
    ("lost_at", _I),
    ("recovered_at", _I),
    ("contacts_tracker", _I),
    ("contacts_obstacle", _I),
    ("contacts_target", _I),
    ("least_gap", _F),
)


@functools.cache
def world_record(declared: Declarations) -> np.dtype[Any]:
    """Return the record of one world, with the memories of the declared motions and the sums of the metrics.

    Raise DeclarationError if a memory has the name of another field.
    """
    sums: dict[str, Any] = {metric.sum_name: np.float64 for metric in declared.metrics if metric.summed}
    memories: dict[str, Any] = {}
    for motion in declared.motions:
        for memory in motion.memory:
            if memory in {**dict(_WORLD), **sums, **memories}:
                raise motion.error(f"a world has a field {memory!r}: choose another name for this memory")
            memories[memory] = _F
    # Reversed, so that users' come before the built-in ones: numba warns if one record is the beginning of another.
    return record_type(*_WORLD, *reversed(memories.items()), *reversed(sums.items()))


FIX: Final = record_type(*((name, _F) for name in Fix._fields))
"""A fix of the target: a position or a bearing, depending on the sensor (:func:`posse.sensor`)."""

TRACKER: Final = record_type(
    *((name, _F) for name in Pose._fields),
    ("breaks_at", _I),  # control step at which it will break (break_choice "drawn")
    *((name, _I) for name in Condition._fields),
    ("slot", _I),  # number of the slot that it occupies; -1: none
    ("could_arrive", _I),  # 1: on a straight line at full speed it could have reached a slot
    ("touching_trackers", _U),
    ("touching_obstacles", _U),  # bit masks; bits 60 to 63: walls
    ("fix", FIX),  # its best fix of the target, from its sensor or by radio
    # inputs of score and rewards, with slot and could_arrive
    ("slot_distance", _F),  # to the nearest slot that no other tracker occupies
    ("slot_progress", _F),  # decrease of slot_distance in this step
    ("start_x", _F),
    ("start_y", _F),
)
"""One tracker: :class:`Pose`, :class:`Condition`, its fix and more."""

OBSTACLE: Final = record_type(("x", _F), ("y", _F), ("radius", _F))

SLOT: Final = record_type(("x", _F), ("y", _F))
"""Position of a slot in the slot frame; one table for all worlds."""

HEARD: Final = record_type(*((name, _I if name == "step" else _F) for name in Heard._fields))
"""The last message that a tracker received from a team-mate: (E, receiver, sender)."""

ODOMETRY: Final = record_type(*((name, _F) for name in Odometry._fields))
"""The error of a tracker's own pose."""

BROADCAST: Final = record_type(
    ("sent", _I),  # 0: its radio was silent
    *((name, _F) for name in Pose._fields[:6]),
    ("fix_step", _I),
    ("odometry", ODOMETRY),  # a receiver is told the pose with this error
    ("fix", FIX),  # a receiver works out the velocity from its own previous fix
)
"""A tracker's message, kept until it is received: (E, D + 1, N), by step modulo D + 1."""


def _begin(record: np.dtype[Any], name: str) -> int:
    fields: Any = record.fields
    return int(fields[name][1])


TARGET_POSE_AT: Final = _begin(record_type(*_WORLD), TargetPose._fields[0])
POSE_AT: Final = _begin(TRACKER, Pose._fields[0])
CONDITION_AT: Final = _begin(TRACKER, Condition._fields[0])
FIX_AT: Final = _begin(TRACKER, "fix")
"""Where the blocks begin in the records that hold more, bytes."""


class WorldArrays(NamedTuple):
    """The arrays of a batch, which together with the scenario are its complete state."""

    world: Records  # (E,) world_record()
    tracker: Records  # (E, N) TRACKER
    obstacle: Records  # (E, M) OBSTACLE
    heard: Records  # (E, N, N) HEARD; (E, 0, 0) if the radio is perfect, which stores nothing
    broadcast: Records  # (E, D + 1, N) BROADCAST; (E, 0, 0) if the radio is perfect
    heard_message: FloatArray  # numbers that policies added, (E, N, N, m) float32, by receiver and sender
    message: FloatArray  # the same of what was sent, (E, D + 1, N, m) float32, by step modulo D + 1
    odometry: Records  # (E, N) ODOMETRY; (E, 0) if nothing drifts
    command: FloatArray  # commands not yet executed, (E, d, N, 2) float32, by step modulo d = command_delay

    @classmethod
    def allocate(cls, scenario: Scenario, num_worlds: int) -> WorldArrays:
        """Return zeroed arrays for a number of worlds."""
        n, m = scenario.num_trackers, scenario.message_size
        kept = 0 if scenario.perfect_radio else n
        delay = scenario.radio_delay + 1
        tracker = np.zeros((num_worlds, n), TRACKER)
        tracker["max_speed"], tracker["max_turn_rate"] = scenario.tracker_speeds, scenario.tracker_turn_rates
        return cls(
            world=np.zeros(num_worlds, world_record(Declarations.of(scenario))),
            tracker=tracker,
            obstacle=np.zeros((num_worlds, scenario.num_obstacles), OBSTACLE),
            heard=np.zeros((num_worlds, kept, kept), HEARD),
            broadcast=np.zeros((num_worlds, delay if kept else 0, kept), BROADCAST),
            heard_message=np.zeros((num_worlds, kept, kept, m), np.float32),
            message=np.zeros((num_worlds, delay, n, m), np.float32),
            odometry=np.zeros((num_worlds, n if scenario.drifts else 0), ODOMETRY),
            command=np.zeros((num_worlds, scenario.command_delay, n, 2), np.float32),
        )

    def copy(self) -> WorldArrays:
        """Return a copy that shares no memory."""
        return WorldArrays(*(array.copy() for array in self))

    def write(self, other: WorldArrays) -> None:
        """Overwrite these arrays with another's contents, in place."""
        for mine, theirs in zip(self, other, strict=True):
            mine[...] = theirs

    def by_name(self) -> dict[str, npt.NDArray[Any]]:
        """Return every field of every array by name, e.g. ``"tracker_x"`` (E, N), as views."""
        return {name: part for name, array in zip(self._fields, self, strict=True) for name, part in parts(name, array)}


def parts(name: str, array: npt.NDArray[Any]) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """Yield every field of an array of records, or the array itself, by name, as a view."""
    if array.dtype.names is None:
        yield name, array.view()
    for part in array.dtype.names or ():
        yield from parts(f"{name}_{part}", array[part])


def slot_records(scenario: Scenario) -> Records:
    """Return the slots as (N,) :data:`SLOT`."""
    return np.array(scenario.slot_offsets, np.float32).view(SLOT).reshape(-1)


def beam_directions(scenario: Scenario) -> FloatArray:
    """Return cosine and sine of each sonar beam's direction in the robot's frame, (2, S)."""
    angles = 2 * np.pi * np.arange(scenario.sonar_beams) / max(1, scenario.sonar_beams)
    return np.stack([np.cos(angles), np.sin(angles)]).astype(np.float32)


def config_record(scenario: Scenario) -> Records:
    """Return the scenario for kernels, an array of one :data:`CONFIG`."""
    config = np.zeros(1, CONFIG)
    for name, (_, read) in _NUMBERS.items():
        value = read(scenario)
        config[name] = UNLIMITED if value == math.inf else value
    return config


ROBOTS: Final = MAX_TRACKERS + WIDTH
"""Length of rows of trackers, target and padding."""
DISCS: Final = ROBOTS + -(-MAX_OBSTACLES // WIDTH) * WIDTH
"""Length of rows of robots, obstacles and padding."""

SCRATCH: Final = record_type(
    # Discs: trackers, the target, obstacles.
    ("x", _F, DISCS),  # common frame, m
    ("y", _F, DISCS),
    ("radius", _F, DISCS),  # m
    ("index", _F, ROBOTS),  # 0, 1, 2, …
    # The sonar's beams.
    ("beam_cos", _F, MAX_BEAMS),
    ("beam_sin", _F, MAX_BEAMS),
    ("reading", _F, MAX_BEAMS),  # m
    # Trackers.
    ("gap", _F, MAX_TRACKERS),  # clearance to the nearest disc, m
    ("excess", _F, MAX_TRACKERS),  # above 0 only if nothing is near; a sign alone, m² to robots and m to obstacles
    ("slot", _F, MAX_TRACKERS),  # number of the nearest slot, or of the nearest free one
    ("slot_distance", _F, MAX_TRACKERS),  # distance to it, m
    ("slot_distance2", _F, MAX_TRACKERS),  # squared, m²
    # Motion.
    ("worth", _F, 2 * WIDTH),  # value of each direction considered by a smart target
    # Observations: eight numbers, one for each of eight worlds.
    ("team_x", _F, (MAX_TRACKERS, WIDTH)),  # of each tracker
    ("team_y", _F, (MAX_TRACKERS, WIDTH)),
    ("mate_number", _F, (MAX_TRACKERS, WIDTH)),  # of the team-mate in each place; -1: none
    ("mate_distance", _F, (MAX_TRACKERS, WIDTH)),  # m
)
"""Scratch memory of a thread."""


def new_scratch(scenario: Scenario, threads: int) -> Records:
    """Return (threads,) :data:`SCRATCH`, with what is the same in all worlds of a scenario."""
    memory = np.zeros(threads * SCRATCH.itemsize + 64, np.uint8)
    start = -memory.ctypes.data % 64  # of a cache line, so that blocks of eight lie within one
    scratch = memory[start : start + threads * SCRATCH.itemsize].view(SCRATCH)
    scratch["index"], scratch["radius"] = np.arange(ROBOTS), scenario.robot_radius
    for name, values in zip(("beam_cos", "beam_sin"), beam_directions(scenario), strict=True):
        scratch[name][:, : scenario.sonar_beams] = values
    return scratch
