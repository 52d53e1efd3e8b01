"""What a team knows in common, and the memory of its trackers, as records that compiled code reads by name.

Functions of the DDCS take ``team`` (:class:`Team`), ``me`` (:data:`MIND`, the tracker that decides), ``mates``
((N,) :data:`MATE`, by number) and, where they read the observation, its ``row`` (F,). Positions (m), velocities (m/s)
and headings are complex numbers (:mod:`~posse_baselines.laws.geometry`), in common axes unless said otherwise. A metre
(m) is that of robots of 0.15 m radius, as in laws and settings: what smaller and larger robots observe, and the
constants of their scenario, are converted once, to a unit of :func:`unit_of` metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse.numeric import (
    MOST_THREADS,
    BoolArray,
    FloatArray,
    OwnArrays,
    Record,
    Records,
    compiled,
    kernel,
    over_worlds,
    record_type,
)
from posse.rules import beam_directions
from posse.scenarios.setting import OPEN_PLANE_EXTENT
from posse_baselines.ddcs.settings import Settings, settings_record
from posse_baselines.laws.guidance import BODY
from posse_baselines.laws.safeguard import DISC
from posse_baselines.laws.steering import WORK_ROWS

Kernel = Callable[..., None]
_F, _I, _C = np.float32, np.int32, np.complex64
_MOST_DISCS: Final = 32
_MOST_WAITING: Final = 10  # control steps; a longer delay is not foreseen
GRID: Final = 16
"""Cells of a tracker's map of covered areas, along each axis."""
UNLIMITED: Final = 1e4  # m/s² or rad/s²: what stands for no limit


# --- what a team has in common -------------------------------------------------------------------

_FIELDS: Final = (
    *("heading", "position", "speed", "turn_rate", "number"),
    *("max_speed", "max_turn_rate", "acceleration_time", "turn_acceleration_time"),
    *("target_known", "target_seen", "target_age", "target_range", "target_bearing"),
    *("target_heading", "target_frame", "target_velocity", "sonar"),
    *("neighbour_number", "neighbour_age", "neighbour_range", "neighbour_bearing"),
    *("neighbour_heading", "neighbour_speed", "neighbour_turn_rate", "neighbour_message"),
)
_RADIUS: Final = 0.15  # m; of the robots that laws and settings are given for
_WIDER: Final = 1.2
_MOST_SIGHT: Final = 8.0  # units; obstacles hide more the farther one looks
_OPEN_AREA: Final = 1.4 * OPEN_PLANE_EXTENT

OFFSETS: Final = record_type(
    *((name, np.int32) for name in _FIELDS),  # -1: the layout has no such field
    ("neighbours", np.int32),  # places for team-mates
    ("stride", np.int32),  # length of one team-mate's part
    ("sonar_beams", np.int32),
    ("message_size", np.int32),
)
"""Offsets of the fields of a layout.

A team-mate's fields are those of the first place; the next ones follow ``stride`` apart.
"""

CONSTANTS: Final = record_type(
    ("dt", np.float32),  # control step, s
    ("delay", np.int32),  # control steps after which a command is executed
    ("followed", np.float64),  # share of a wanted change of the motion that a step brings; 1: no lag
    ("sonar_range", np.float32),  # reading that means "nothing near", m
    ("wide_beam", np.float32),  # cosine of a little more than half a beam's width
    ("radius", np.float32),  # of a robot's disc, m
    ("walled", np.int32),
    ("half_width", np.float32),  # of the arena, m
    ("half_height", np.float32),
    ("sight", np.float32),  # how far its target sensor reaches, m
    ("searches", np.int32),  # 1: it may have to be searched for
    ("drifts", np.int32),  # 1: each robot's own pose, as it knows it, drifts
    ("area_x", np.float32),  # half the width of the rectangle that is to be searched, m
    ("area_y", np.float32),  # half its height
    ("outermost", np.float64),  # distance of the outermost slot from the target, m
)
"""Of a scenario: constants of robots and arena; a metre is a unit of :func:`unit_of`."""


def unit_of(scenario: Scenario) -> float:
    """Return the length (m) that the robots of a scenario take for a metre: 1 at a radius of 0.15 m."""
    return scenario.robot_radius / _RADIUS


def in_units(layout: ObservationLayout, observations: FloatArray) -> FloatArray:
    """Return observations (E, R, F) whose lengths and speeds are in units of :func:`unit_of`."""
    unit = unit_of(layout.scenario)
    if unit == 1.0:
        return observations
    converted = observations.copy()
    views = layout.views(converted)
    for field in layout.fields:
        if field.unit in ("m", "m/s"):
            views[field.name] /= unit
    return converted


def offsets_of(layout: ObservationLayout) -> Records:
    """Return an array of one :data:`OFFSETS`."""
    record, scenario = np.zeros(1, OFFSETS), layout.scenario
    for name in _FIELDS:
        record[name] = layout.offsets.get(name, -1)
    record["neighbours"], record["stride"] = layout.neighbours, layout.stride
    record["sonar_beams"] = scenario.sonar_beams
    record["message_size"] = scenario.message_size
    return record


def constants_of(scenario: Scenario) -> Records:
    """Return an array of one :data:`CONSTANTS`."""
    record, unit = np.zeros(1, CONSTANTS), unit_of(scenario)
    record["dt"] = scenario.control_step
    lag = scenario.actuator_lag
    record["delay"], record["followed"] = scenario.command_delay, 1.0
    if lag > 0:
        record["followed"] = 1 - math.exp(-scenario.control_step / lag)
    record["wide_beam"] = math.cos(_WIDER * math.pi / max(1, scenario.sonar_beams))
    record["sonar_range"] = scenario.sonar_range / unit
    record["radius"] = scenario.robot_radius / unit
    record["sight"] = min(scenario.sensing_range / unit, _MOST_SIGHT)
    half_width, half_height = (half / unit for half in scenario.half_sides)
    record["half_width"], record["half_height"] = half_width, half_height
    record["area_x"], record["area_y"] = min(half_width, _OPEN_AREA), min(half_height, _OPEN_AREA)
    record["searches"] = math.isfinite(scenario.sensing_range)
    record["drifts"] = scenario.drifts
    record["walled"] = scenario.walled
    return record


class Team(NamedTuple):
    """What the trackers of a team have in common."""

    at: Record
    """:data:`OFFSETS`: where each field is in an observation."""
    world: Record
    """:data:`CONSTANTS`: robots and arena."""
    settings: Record
    """:data:`~posse_baselines.ddcs.settings.SETTINGS`."""
    slots: npt.NDArray[np.complex64]
    """(N,) place of each slot in the slot frame, m."""
    beams: npt.NDArray[np.complex64]
    """(S,) direction of each sonar beam in the robot's own axes."""


def team_of(layout: ObservationLayout, settings: Settings) -> Team:
    """Return what a team has in common; ``at``, ``world`` and ``settings`` are arrays of one record."""
    scenario = layout.scenario
    slots = [complex(*slot) / unit_of(scenario) for slot in scenario.slot_offsets]
    cosines, sines = beam_directions(scenario)
    world = constants_of(scenario)
    world["outermost"] = max(map(abs, slots))
    if settings.foresight == 0.0 or scenario.command_delay > _MOST_WAITING:
        world["delay"] = 0
    return Team(
        offsets_of(layout),
        world,
        settings_record(settings),
        np.array(slots, np.complex64),
        (cosines + 1j * sines).astype(np.complex64),
    )


# --- memory --------------------------------------------------------------------------------------


class Work(NamedTuple):
    """Arrays that a step works in, one of each for a thread."""

    cost: npt.NDArray[np.float64]
    """(N, N) cost of each slot for each tracker, s."""
    assigning: npt.NDArray[np.float64]
    """(WORK_ROWS, N + 1) for the assignment."""
    discs: Records
    """(32,) :data:`~posse_baselines.laws.safeguard.DISC`: what is near."""


def work_for(num_trackers: int) -> Work:
    """Return the arrays of all threads."""
    n, threads = num_trackers, MOST_THREADS
    cost, assigning = np.empty((threads, n, n)), np.empty((threads, WORK_ROWS, n + 1))
    return Work(cost, assigning, np.empty((threads, _MOST_DISCS), DISC))


def _fields(*fields: tuple[str, Any, int]) -> tuple[np.dtype[Any], Any]:
    """Return a record type, and a record with the value that each field has at the start of an episode."""
    dtype = record_type(*((name, kind) for name, kind, _ in fields))
    start = np.zeros((), dtype)
    for name, _, value in fields:
        start[name] = value
    return dtype, start


MIND, MIND_AT_START = _fields(
    ("step", _I, 0),  # control steps since the episode began
    # this robot, from the observation of this step; heading, motion and limits are those of BODY
    ("number", _I, 0),
    ("position", np.complex128, 0),
    *((name, BODY[name], 0) for name in BODY.names or ()),
    # the target, as it was at the newest fix
    ("fix_step", _I, -1),  # own step of that fix; -1: none yet
    ("fix", _C, 0),  # estimated position
    ("raw", _C, 0),  # position by the fix alone
    ("fix_theta", _F, 0),
    ("fix_psi", _F, 0),
    ("target_speed", _F, 0),  # estimated speed, m/s
    ("target_turn", _F, 0),  # estimated turn rate, rad/s
    ("target_mean", _C, 0),  # mean velocity
    ("speed_known", _I, 0),  # 1: the speed has been measured
    # the target, as it is taken to be now
    ("target", _C, 0),  # position
    ("target_theta", _F, 0),
    ("target_velocity", _C, 0),
    ("psi_rate", _F, 0),  # turn rate of the slot frame, rad/s
    ("psi_limit", _F, 0),  # its greatest, rad/s
    ("frame", _C, 0),  # heading of the slot frame
    ("fix_age", _F, 0),  # s
    ("known", _I, 0),  # 1: there is an estimate that is not too old
    ("horizon", _F, 0),  # distance within which every team-mate that is heard is listed, m
    ("usual_gap", _F, 0),  # about the longest silence of a team-mate lately, s
    ("usual_age", _F, 0),  # about the usual age of the fix, s
    # tracking
    ("task", _I, 0),
    ("slot", _I, -1),  # -1: none
    ("taken", np.uint64, 0),  # bit set of slots in which the sonar detected a robot not heard
    ("closing", _I, 0),  # 1: the law itself, not the safeguard, keeps the range to the target
    ("side", _I, 0),  # of the last detour: 1 left, -1 right
    ("side_step", _I, 0),  # own step of that detour
    # the tracking layer's result; float64, so that storing it changes no action
    ("wish", np.complex128, 0),  # wanted velocity
    ("wish_speed", np.float64, 0),  # its command: m/s, rad/s
    ("wish_omega", np.float64, 0),
    # commands that wait for their execution, m/s and rad/s, by own step modulo the delay
    ("waiting", (np.complex128, (_MOST_WAITING,)), 0),
    ("lead", np.float64, 0),  # s; how far position, heading and target are ahead of the observation
    ("moved", np.complex128, 0),  # by then, m
    ("turned", np.complex128, 1),  # by then, as a rotation
    # leadership
    ("leader", _I, -1),  # -1: none yet
    ("term", _I, 0),  # how often the lead has passed, modulo 256; the higher claim wins
    ("pulse", _I, 0),  # the leader counts its steps, modulo 256; team-mates pass the count on
    ("pulse_step", _I, 0),  # own step at which the count last went up
    ("confirmed", _I, 0),  # 0: the leader has not been heard of since it was appointed
    ("exchanges", _I, 0),  # times that the lead passed to another, as far as this one knows
    # searching
    ("goal", _C, 0),
    ("goal_step", _I, -1),  # own step at which the goal was chosen; -1: there is none
    ("lost_step", _I, -1),  # when the target was lost; -1: never seen yet
    ("area", _C, 0),  # middle of the area that is searched
    ("seen", (np.uint16, (GRID * GRID,)), 0),  # map of it: own step + 1 at which a cell was last covered
)
"""Memory of one tracker, and its value at the start of an episode."""

MATE, MATE_AT_START = _fields(
    ("step", _I, -1),  # own step at which it sent what follows; -1: never heard
    ("fresh", _I, 0),  # 1: heard in this step
    ("position", _C, 0),
    ("velocity", _C, 0),
    ("heading", _C, 0),
    ("turn", _F, 0),  # turn rate, rad/s
    # from its drifting frame to the own one, measured by the target that both see
    ("aligned", _I, 0),  # 1: has been measured
    ("shift", _C, 0),  # m
    ("twist", _F, 0),  # rad
    ("task", _I, -1),
    ("leader", _I, -1),
    ("term", _I, -1),
    ("pulse", _I, -1),
    ("slot", _I, -1),  # -1: not said
)
"""Knowledge of a tracker about a team-mate, and its value at the start of an episode."""


class Minds(OwnArrays):
    """The memory of a team of N trackers in each of E worlds, or of R robots of it.

    Args:
        layout: Of the observations.
        settings: Of the team.
        num_worlds: E.
        robots: R.

    Attributes:
        layout: Of the observations.
        team: What the trackers have in common; ``at``, ``world`` and ``settings`` are arrays of one record.
        me: (E, R) :data:`MIND`.
        mates: (E, R, N) :data:`MATE`, by the mate's number; nothing is ever heard of oneself.
    """

    def __init__(self, layout: ObservationLayout, settings: Settings, num_worlds: int, robots: int) -> None:
        self.layout, self.team = layout, team_of(layout, settings)
        self.me: Records = np.full((num_worlds, robots), MIND_AT_START)
        self.mates: Records = np.full((num_worlds, robots, layout.scenario.num_trackers), MATE_AT_START)

    def restart(self, mask: BoolArray) -> None:
        """Forget all in the worlds of a mask (E,), whose episodes restart."""
        self.me[mask], self.mates[mask] = MIND_AT_START, MATE_AT_START

    def run(self, kernel: Kernel, observations: FloatArray, out: FloatArray) -> None:
        """Run a kernel of :func:`for_each` on observations (E, R, F); it writes to ``out`` (E, R, ...)."""
        work, rows = work_for(self.mates.shape[2]), in_units(self.layout, observations)
        over_worlds(kernel, ((self.team, self.me, self.mates), work, rows, out), *self.me.shape)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        arrays: dict[str, npt.NDArray[Any]] = {}
        for name, records in (("me", self.me), ("mates", self.mates)):
            arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names or ()}
        return arrays


def for_each(function: Kernel) -> Kernel:
    """Return a kernel that calls ``function(team, me, mates, row, work, out)`` for every tracker."""

    @kernel
    def run(minds: Any, works: Work, rows: FloatArray, out: FloatArray, thread: int, first: int, end: int) -> None:
        shared, me, mates = minds
        team = Team(shared.at[0], shared.world[0], shared.settings[0], shared.slots, shared.beams)
        work = Work(works.cost[thread], works.assigning[thread], works.discs[thread])
        for e in range(first, end):
            for i in range(rows.shape[1]):
                function(team, me[e, i], mates[e, i], rows[e, i], work, out[e, i])

    return run


@compiled
def pair(row: FloatArray, at: int) -> complex:
    """Return the vector whose two components stand at a place of an observation."""
    return complex(row[at], row[at + 1])


@compiled
def is_due(team: Team, me: Record, period: float) -> bool:
    """Return whether what is done once a period (s) is done in this control step."""
    return bool(me.step % max(1, round(period / team.world.dt)) == 0)


@compiled
def read_body(team: Team, me: Record, row: FloatArray) -> None:
    """Read the robot's number, pose, motion and limits from its observation (F,), once a step."""
    at = team.at
    me.number = int(row[at.number])
    me.position, me.heading = pair(row, at.position), pair(row, at.heading)
    me.speed, me.omega = row[at.speed], row[at.turn_rate]
    me.max_speed, me.max_omega = row[at.max_speed], row[at.max_turn_rate]
    me.acceleration, me.turn_acceleration = UNLIMITED, UNLIMITED
    if row[at.acceleration_time] > 0.0:
        me.acceleration = row[at.max_speed] / row[at.acceleration_time]
    if row[at.turn_acceleration_time] > 0.0:
        me.turn_acceleration = row[at.max_turn_rate] / row[at.turn_acceleration_time]
    me.dt = team.world.dt
