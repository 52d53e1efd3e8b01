"""The state of a batch: records with a leading axis E, with the meaning of each field.

E = worlds, N = trackers, M = obstacles, D = radio delay in steps, m = message size. The data of one
world are contiguous, for locality of memory access. The dtypes do not depend on any size, so
kernels are compiled once for all scenarios.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Lanes, Record, Records
from posse.registry import METRICS, SENSORS, TARGET_MOTIONS
from posse.scenarios import Scenario
from posse.scenarios.formation import FORMATIONS, slot_offsets
from posse.scenarios.limits import BREAK_CHOICES, FAR, SAFE_MARGIN

SPLITS: Final = ("train", "validation", "test")
NEVER: Final = np.int32(2**30)
"""A control step later than any."""


def _record(*fields: tuple[str, type]) -> np.dtype[Any]:
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


def block_at(record: np.dtype[Any], block: type[tuple[Any, ...]]) -> int:
    """Return where a block of eight fields begins in a record, bytes.

    Kernels read and write such a block at once, as eight consecutive numbers of 4 bytes.

    Args:
        record: The record.
        block: A named tuple with the names of the fields, in order.

    Raises:
        TypeError: The record does not have these fields one after the other.
    """
    names: tuple[str, ...] = block._fields  # type: ignore[attr-defined]
    fields: Any = record.fields or {}
    places = [(fields[name][1], fields[name][0].itemsize) if name in fields else (-1, 0) for name in names]
    if len(names) != 8 or places != [(places[0][0] + 4 * k, 4) for k in range(8)]:
        raise TypeError(f"{block.__name__}: a record must have {', '.join(names)} one after the other, 4 bytes each")
    return int(places[0][0])


_F, _I, _U, _S = np.float32, np.int32, np.uint64, np.int16

CONFIG: Final = _record(
    ("num_trackers", _I),
    ("num_agents", _I),
    ("num_obstacles", _I),
    ("neighbours", _I),
    ("message_size", _I),
    ("physics_steps", _I),
    ("horizon", _I),
    ("settle_steps", _I),
    ("outage_steps", _I),
    ("break_from", _I),
    ("break_until", _I),
    ("forget_steps", _I),
    ("radio_delay", _I),
    ("breaks", _I),
    ("break_nearest", _I),
    ("break_number", _I),
    ("motion", _I),
    ("mirrored", _I),
    ("target_agent", _I),
    ("sensor", _I),
    ("fix_bearing", _I),  # 1: a fix is a bearing, else a position
    ("measured", _I),  # 0: sensors return the target's true position
    ("terminate_on_contact", _I),
    ("walled", _I),
    ("sonar_beams", _I),
    ("all_round", _I),
    ("perfect_radio", _I),
    ("formation", _I),
    ("whole_arcs", _I),
    ("dt", _F),
    ("physics_dt", _F),
    ("fastest", _F),  # greatest speed of any tracker
    ("speed_change", _F),
    ("turn_change", _F),
    ("target_speed", _F),
    ("target_turn_rate", _F),
    ("target_least_speed", _F),
    ("radius", _F),
    ("tolerance", _F),
    ("frame_c", _F),
    ("frame_s", _F),
    ("slots_reach", _F),
    ("half_arena", _F),
    ("obstacle_least", _F),
    ("obstacle_most", _F),
    ("obstacle_gap", _F),
    ("start_least", _F),
    ("start_most", _F),
    ("target_extent", _F),
    ("safe_distance", _F),
    ("sensing_range", _F),
    ("view_cosine", _F),
    ("range_noise", _F),
    ("bearing_noise", _F),
    ("smoothing", _F),
    ("sonar_range", _F),
    ("beam_cosine", _F),
    ("radio_range", _F),
    ("radio_loss", _F),
    ("sensor_outages", _F),
    ("radio_outages", _F),
    ("formation_distance", _F),
    ("formation_spacing", _F),
    ("per_acceleration", _F),
    ("per_turn_acceleration", _F),  # 1 / limit; 0: no limit
    ("told_sensing_range", _F),
    ("told_arena", _F),  # as observed; -1: unlimited
)
"""The scenario, for kernels."""

_WORLD: Final = (
    ("seed", _U),  # as given by the user
    ("split", _I),  # index into SPLITS
    ("index", np.int64),  # number of the world within the seed
    ("episode", np.int64),  # number of the episode within the world
    ("key", _U),  # key of the episode's random draws
    ("step", _I),  # control steps since the start
    ("over", _I),  # 1: the episode has ended, the world must be reset
    ("terminated", _I),
    # the target
    ("x", _F),
    ("y", _F),
    ("heading_cos", _F),
    ("heading_sin", _F),
    ("speed", _F),
    ("turn_rate", _F),
    ("frame_cos", _F),
    ("frame_sin", _F),  # the slot frame, ψ
    ("goal_cos", _F),
    ("goal_sin", _F),  # goal heading of a scripted target
    ("touching", _U),  # bit mask of the trackers that touch the target
    ("onsets", _I),  # contacts of the target with trackers that began in the current step
    ("near", _I),  # 1: something may touch the target in the next step
    ("break_step", _I),  # when the next tracker breaks (break_choice "nearest")
    ("breaks_left", _I),
    # inputs of the metrics
    ("working", _I),  # number of working trackers
    ("score", _F),  # of the current step
    ("tracker_steps", _F),  # control steps of all working trackers
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
WORLD_NAMES: Final = tuple(name for name, _ in _WORLD)
"""Fields of every world, without those of declared metrics and motions."""


def world_record(scenario: Scenario) -> np.dtype[Any]:
    """Return the record of one world.

    It includes the memories of the target motions and the sums of the metrics, both of the built-in
    ones and of those that the scenario names.
    """
    return world_record_of(TARGET_MOTIONS.with_added(scenario.target_motion), METRICS.with_added(*scenario.metrics))


@functools.cache
def world_record_of(motions: tuple[Any, ...], metrics: tuple[Any, ...]) -> np.dtype[Any]:
    """Return the record of one world for declared motions and metrics."""
    return _record(
        *_WORLD,
        *(field for metric in metrics for field in metric.fields),
        *((memory.name, _F) for motion in motions for memory in motion.memory),
    )


FIX_STEP: Final = ("fix_step", _I)  # when it was taken; -1: none yet
FIX_FIELDS: Final = (
    ("fix_x", _F),
    ("fix_y", _F),  # where the target was, m; a bearing: a unit vector
    ("fix_cos", _F),
    ("fix_sin", _F),  # its heading; a bearing: 0
    ("fix_frame_cos", _F),
    ("fix_frame_sin", _F),  # the slot frame ψ; a bearing: 0
)
"""A fix of the target, in the common frame: a position or a bearing, depending on the sensor
(:mod:`posse.rules.senses.declaring`). Of a certain control step (``FIX_STEP``)."""

TRACKER: Final = _record(
    ("x", _F),
    ("y", _F),
    ("heading_cos", _F),
    ("heading_sin", _F),
    ("speed", _F),
    ("turn_rate", _F),
    ("max_speed", _F),
    ("max_turn_rate", _F),  # its own limits, from the scenario
    ("per_speed", _F),
    ("per_turn_rate", _F),  # 1 / max_speed, 1 / max_turn_rate
    ("breaks_at", _I),  # control step at which it will break (break_choice "drawn", "given")
    ("broken_at", _I),  # control step at which it broke, NEVER while it works
    ("sensor_dead_from", _I),
    ("radio_dead_from", _I),  # start of outages of outage_time
    ("sees", _I),  # 1: its sensor sees the target
    ("near", _I),  # 1: something may touch it in the next step
    ("touching", _I),  # 1: it touches anything
    ("onsets", _I),  # contacts that began in this step
    FIX_STEP,  # of its best fix
    ("slot", _S),  # number of the slot that it occupies; -1: none
    ("could_arrive", _S),  # 1: on a straight line at full speed it could have reached a slot
    ("touching_trackers", _U),
    ("touching_obstacles", _U),  # bit masks; bits 60 to 63: walls
    # its best fix of the target, from its sensor or by radio
    *FIX_FIELDS,
    ("fix_vx", _F),
    ("fix_vy", _F),  # m/s, from successive fixes
    # inputs of score and rewards, with slot and could_arrive
    ("slot_distance", _F),  # to the nearest slot that no other tracker occupies
    ("slot_progress", _F),  # decrease of slot_distance in this step
    ("start_x", _F),
    ("start_y", _F),
)
"""One tracker."""


class Pose(NamedTuple):
    """Pose, motion and limits of eight trackers."""

    x: Lanes
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    turn_rate: Lanes
    max_speed: Lanes
    max_turn_rate: Lanes


class Condition(NamedTuple):
    """Whole numbers of eight trackers."""

    broken_at: Lanes
    sensor_dead_from: Lanes
    radio_dead_from: Lanes
    sees: Lanes
    near: Lanes
    touching: Lanes
    onsets: Lanes
    fix_step: Lanes


class Fix(NamedTuple):
    """The fixes of eight trackers."""

    fix_x: Lanes
    fix_y: Lanes
    fix_cos: Lanes
    fix_sin: Lanes
    fix_frame_cos: Lanes
    fix_frame_sin: Lanes
    fix_vx: Lanes
    fix_vy: Lanes


class Heard(NamedTuple):
    """The last messages that eight trackers received from a team-mate."""

    x: Lanes
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    turn_rate: Lanes
    step: Lanes
    unused: Lanes


POSE: Final = block_at(TRACKER, Pose)
FIX: Final = block_at(TRACKER, Fix)
CONDITION: Final = block_at(TRACKER, Condition)

OBSTACLE: Final = _record(("x", _F), ("y", _F), ("radius", _F))

SLOT: Final = _record(("x", _F), ("y", _F))
"""Position of a slot in the slot frame; one table for all worlds."""

HEARD: Final = _record(
    ("x", _F),
    ("y", _F),
    ("heading_cos", _F),
    ("heading_sin", _F),
    ("speed", _F),
    ("turn_rate", _F),
    ("step", _I),  # when it was sent; -1: never heard
    ("unused", _I),  # makes a block of eight
)
"""The last message that a tracker received from a team-mate: (E, receiver, sender)."""
MESSAGE: Final = block_at(HEARD, Heard)

BROADCAST: Final = _record(
    ("sent", _I),  # 0: its radio was silent
    ("x", _F),
    ("y", _F),
    ("heading_cos", _F),
    ("heading_sin", _F),
    ("speed", _F),
    ("turn_rate", _F),
    FIX_STEP,
    *FIX_FIELDS,
)
"""A tracker's message, kept until it is received: (E, D + 1, N), by step modulo D + 1."""


class WorldArrays(NamedTuple):
    """The arrays of a batch, which together with the scenario are its complete state."""

    world: Records
    """(E,) :func:`world_record`."""
    tracker: Records
    """(E, N) :data:`TRACKER`."""
    obstacle: Records
    """(E, M) :data:`OBSTACLE`."""
    heard: Records
    """(E, N, N) :data:`HEARD`; (E, 0, 0) if the radio is perfect, which stores nothing."""
    broadcast: Records
    """(E, D + 1, N) :data:`BROADCAST`; (E, 0, 0) if the radio is perfect."""
    heard_message: FloatArray
    """Message parts written by policies, (E, N, N, m) float32, by receiver and sender."""
    message: FloatArray
    """The same of messages sent, (E, D + 1, N, m) float32, by step modulo D + 1."""

    @classmethod
    def allocate(cls, scenario: Scenario, num_worlds: int) -> WorldArrays:
        """Return zeroed arrays for a number of worlds."""
        n, m = scenario.num_trackers, scenario.message_size
        kept = 0 if perfect_radio(scenario) else n
        delay = scenario.radio_delay + 1
        tracker = np.zeros((num_worlds, n), TRACKER)
        for limit, inverse, values in (
            ("max_speed", "per_speed", scenario.tracker_speeds),
            ("max_turn_rate", "per_turn_rate", scenario.tracker_turn_rates),
        ):
            tracker[limit], tracker[inverse] = values, 1 / np.array(values)
        return cls(
            world=np.zeros(num_worlds, world_record(scenario)),
            tracker=tracker,
            obstacle=np.zeros((num_worlds, scenario.num_obstacles), OBSTACLE),
            heard=np.zeros((num_worlds, kept, kept), HEARD),
            broadcast=np.zeros((num_worlds, delay if kept else 0, kept), BROADCAST),
            heard_message=np.zeros((num_worlds, kept, kept, m), np.float32),
            message=np.zeros((num_worlds, delay, n, m), np.float32),
        )

    def copy(self) -> WorldArrays:
        """Return a copy that shares no memory."""
        return WorldArrays(*(array.copy() for array in self))

    def write(self, other: WorldArrays) -> None:
        """Overwrite these arrays with another's contents, in place."""
        for mine, theirs in zip(self, other, strict=True):
            mine[...] = theirs

    def __reduce__(self) -> tuple[Any, ...]:
        # Arrays unpickled out of band would be read-only and possibly unaligned.
        return _copied, tuple(self)

    @property
    def bytes_per_world(self) -> int:
        """Memory that one world takes, in bytes."""
        return sum(array.nbytes for array in self) // len(self.world)

    def by_name(self) -> dict[str, npt.NDArray[Any]]:
        """Return every field of every array by name, e.g. ``"tracker_x"`` (E, N), as views."""
        names: dict[str, npt.NDArray[Any]] = {}
        for name, array in zip(self._fields, self, strict=True):
            if array.dtype.names is None:
                names[name] = array.view()
            else:
                for part in array.dtype.names:
                    names[f"{name}_{part}"] = array[part]
        return names


def _copied(*arrays: npt.NDArray[Any]) -> WorldArrays:
    return WorldArrays(*arrays).copy()


def perfect_radio(scenario: Scenario) -> bool:
    """Return whether working trackers always receive each other's messages without delay."""
    return (
        math.isinf(scenario.radio_range)
        and scenario.radio_delay == 0
        and scenario.radio_loss == 0
        and scenario.radio_outages == 0
        and scenario.breaks == 0
    )


def slot_records(scenario: Scenario) -> Records:
    """Return the slots as (N,) :data:`SLOT`."""
    return np.array(slot_offsets(scenario), np.float32).view(SLOT).reshape(-1)


def beam_directions(scenario: Scenario) -> FloatArray:
    """Return cosine and sine of each sonar beam's direction in the robot's frame, (2, S)."""
    angles = 2 * np.pi * np.arange(scenario.sonar_beams) / max(1, scenario.sonar_beams)
    return np.stack([np.cos(angles), np.sin(angles)]).astype(np.float32)


def config_record(scenario: Scenario) -> Records:
    """Return the scenario for kernels, an array of one :data:`CONFIG`."""
    s = scenario
    config = np.zeros(1, CONFIG)
    c: Record = config[0]
    c.num_trackers, c.num_agents, c.num_obstacles = s.num_trackers, s.num_agents, s.num_obstacles
    c.neighbours, c.message_size = s.neighbours, s.message_size
    c.physics_steps, c.horizon = s.physics_steps, s.horizon
    c.settle_steps = max(1, round(s.settle_time / s.control_step))
    c.outage_steps = max(1, round(s.outage_time / s.control_step))
    c.break_from, c.break_until = (round(share * s.horizon) for share in s.break_window)
    c.forget_steps = int(s.forget_after / s.control_step + 1e-6)
    c.radio_delay, c.breaks = s.radio_delay, s.breaks
    c.break_nearest = s.break_choice == BREAK_CHOICES[0]
    c.break_number = s.break_number if s.break_choice == BREAK_CHOICES[2] else -1
    motions = TARGET_MOTIONS.with_added(s.target_motion)
    motion = TARGET_MOTIONS[s.target_motion]
    c.motion, c.target_agent = motions.index(motion), s.num_agents - s.num_trackers
    c.mirrored = motion.mirrored and math.isfinite(s.arena)
    sensor = SENSORS[s.sensor]
    c.sensor = SENSORS.with_added(s.sensor).index(sensor)
    c.fix_bearing = sensor.fix == "bearing"
    c.measured = s.range_noise > 0 or s.bearing_noise > 0 or sensor.measure is not None
    c.terminate_on_contact, c.walled = s.terminate_on_contact, math.isfinite(s.arena)
    c.sonar_beams = s.sonar_beams
    c.whole_arcs = s.whole_arcs
    c.all_round = s.field_of_view >= 2 * math.pi - 1e-9
    c.perfect_radio = perfect_radio(s)
    c.dt, c.physics_dt = s.control_step, s.control_step / s.physics_steps
    c.fastest = max(s.tracker_speeds)
    c.speed_change = min(s.tracker_acceleration * c.physics_dt, FAR)
    c.turn_change = min(s.tracker_turn_acceleration * c.physics_dt, FAR)
    c.target_speed, c.target_turn_rate = s.target_speed, s.target_turn_rate
    c.target_least_speed = s.target_least_speed
    c.radius = s.robot_radius
    c.tolerance = s.tolerance
    most = min(s.slot_turn_rate * s.control_step, math.pi / 2)
    c.frame_c, c.frame_s = math.cos(most), math.sin(most)
    c.slots_reach = max(math.hypot(x, y) for x, y in slot_offsets(s))
    c.half_arena = min(s.arena / 2, FAR)
    c.obstacle_least, c.obstacle_most = s.obstacle_radius
    c.obstacle_gap = s.obstacle_gap
    c.start_least, c.start_most = s.start_distance
    c.safe_distance = s.robot_radius + SAFE_MARGIN
    c.target_extent = s.target_extent
    c.sensing_range = min(s.sensing_range, FAR)
    c.view_cosine = math.cos(s.field_of_view / 2)
    c.range_noise, c.bearing_noise = s.range_noise, s.bearing_noise
    c.smoothing = 1.0
    if s.velocity_smoothing > 0:
        c.smoothing = 1 - math.exp(-s.control_step / s.velocity_smoothing)
    c.sonar_range = s.sonar_range
    c.beam_cosine = math.cos(math.pi / s.sonar_beams) if s.sonar_beams else 1.0
    c.radio_range, c.radio_loss = min(s.radio_range, FAR), s.radio_loss
    c.sensor_outages, c.radio_outages = s.sensor_outages, s.radio_outages
    c.formation = FORMATIONS.index(s.formation)
    c.formation_distance, c.formation_spacing = s.formation_distance, s.formation_spacing
    c.per_acceleration = 1 / s.tracker_acceleration
    c.per_turn_acceleration = 1 / s.tracker_turn_acceleration
    c.told_sensing_range = s.sensing_range if math.isfinite(s.sensing_range) else -1.0
    c.told_arena = s.arena if math.isfinite(s.arena) else -1.0
    return config
