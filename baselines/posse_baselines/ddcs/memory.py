"""What a team knows in common, and the memory of its trackers, as records that compiled code reads by name.

Functions of the DDCS take ``team`` (:class:`Team`), ``me`` (:data:`MIND`, the tracker that decides), ``mates``
((N,) :data:`MATE`, by number) and, where they read the observation, its ``row`` (F,). Positions (m), velocities (m/s)
and headings are complex numbers (:mod:`~posse_baselines.laws.geometry`), in common axes unless said otherwise. A metre
(m) is that of robots of 0.15 m radius, as in laws and settings: what smaller and larger robots observe, and the
constants of their scenario, are converted once, to a unit of :func:`unit_of` metres.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import SENSORS, ObservationLayout, Scenario
from posse.declarations import FIELDS
from posse.numeric import BoolArray, FloatArray, OwnArrays, Record, Records, compiled, over_worlds, record_type
from posse.rules import beam_directions
from posse.scenarios.scenario import OPEN_PLANE_EXTENT, UNLIMITED
from posse_baselines.ddcs.settings import TASKS, Settings
from posse_baselines.laws.guidance import BODY
from posse_baselines.laws.steering import work_for
from posse_baselines.policy import PolicyError, check_observations

_F, _I, _C = np.float32, np.int32, np.complex64
_MOST_WAITING: Final = 10  # control steps; commands with a longer delay are not foreseen
_FIELDS: Final = (*(field.name for field in FIELDS.of()), "sonar", "neighbour_message")
_RADIUS: Final = 0.15  # m; of the robots that laws and settings are given for
_WIDER: Final = 1.2
_MOST_SIGHT: Final = 8.0  # units; obstacles hide more the farther one looks
_OPEN_AREA: Final = 1.4 * OPEN_PLANE_EXTENT
_SEEN_BEFORE: Final = 1.6  # times the range of sight, before a border at which robots that explore are pushed back
_HARDLY: Final = 1e-3  # probability
_RADIO_FAILS: Final = 3.0  # s; where radios fail, a silent robot may go on


def unit_of(scenario: Scenario) -> float:
    """Return the length (m) that the robots of a scenario take for a metre: 1 at a radius of 0.15 m."""
    return scenario.robot_radius / _RADIUS


def record(**values: Any) -> Records:
    """Return an array of one record that has these values, in their types."""
    arrays = {name: np.asarray(value) for name, value in values.items()}
    found = np.zeros(1, record_type(*((name, array.dtype, array.shape) for name, array in arrays.items())))
    for name, array in arrays.items():
        found[name] = array
    return found


def offsets_of(layout: ObservationLayout) -> Records:
    """Return where a layout has its fields, as an array of one record; -1: it has no such field.

    A team-mate's fields are those of the first place; the next ones follow ``stride`` apart.
    """
    at = {name: layout.offsets.get(name, -1) for name in _FIELDS}
    at |= {"neighbours": layout.neighbours, "stride": layout.stride}
    at |= {name: getattr(layout.scenario, name) for name in ("sonar_beams", "message_size")}
    return record(**{name: _I(value) for name, value in at.items()})


def constants_of(scenario: Scenario) -> Records:
    """Return what is constant of robots and arena, as an array of one record; a metre is a unit of :func:`unit_of`."""
    unit, dt, lag = unit_of(scenario), _F(scenario.control_step), scenario.actuator_lag
    delay = scenario.command_delay
    half_width, half_height = (min(half, UNLIMITED) / unit for half in scenario.half_sides)
    sight = min(scenario.sensing_range / unit, _MOST_SIGHT)
    unlisted = scenario.neighbours < scenario.num_trackers - 1
    return record(
        dt=dt,  # control step, s
        delay=_I(delay),  # control steps after which a command is executed
        lead=delay * float(dt),  # the same in s: how far decisions are ahead of the observation
        # share of a wanted change of the motion that a step brings; 1: no lag
        followed=1 - math.exp(-scenario.control_step / lag) if lag > 0 else 1.0,
        sonar_range=_F(scenario.sonar_range / unit),  # reading that means "nothing near", m
        # cosine of a little more than half a beam's width
        wide_beam=_F(math.cos(min(1.0, _WIDER / max(1, scenario.sonar_beams)) * math.pi)),
        radius=_F(scenario.robot_radius / unit),  # of a robot's disc, m
        slowest=float(_F(min(scenario.tracker_speeds)) / _F(unit)),  # greatest speed of the slowest tracker, m/s
        patience=patience_of(scenario),  # silence up to which a team-mate counts as working and in range, s
        walled=_I(scenario.walled),
        half_width=_F(half_width),  # of the arena, m
        half_height=_F(half_height),
        sight=_F(sight),  # how far its target sensor reaches, m
        # 1: more team-mates than places in an observation
        unlisted=_I(unlisted),
        # 1: what the sonar alone detects is a team-mate without a place: there are no obstacles
        strangers=_I(unlisted and scenario.num_obstacles == 0),
        drifts=_I(scenario.drifts),  # 1: each robot's own pose, as it knows it, drifts
        # half the width and half the height of the area that robots explore freely, m
        inner=_C(complex(_inner(half_width, sight), _inner(half_height, sight))),
        # rad/s, to either side, of a target that is an agent and may turn at any time
        target_turns=scenario.target_turn_rate if scenario.target_is_agent else 0.0,
        outermost=max(abs(complex(*slot) / unit) for slot in scenario.slot_offsets),  # slot's distance, m
    )


def patience_of(scenario: Scenario) -> float:
    """Return the silence (s) after which a robot is taken for broken: losses hardly explain it."""
    if scenario.radio_outages > 0.0:
        return _RADIO_FAILS
    lost = math.log(_HARDLY) / math.log(scenario.radio_loss) if scenario.radio_loss > 0.0 else 0.0
    return (scenario.radio_delay + lost + 1.5) * scenario.control_step


def _inner(half: float, sight: float) -> float:
    """Return how far from the middle (m) a border begins to push; from there it comes into sight soon."""
    half = min(half, _OPEN_AREA)
    return max(0.5 * half, half - _SEEN_BEFORE * sight)


def settings_of(settings: Settings) -> Records:
    """Return settings as an array of one record: numbers, and of the choices whether each is made.

    ``forbidden`` is a table of the transitions from a task (row) to another.
    """
    forbidden = np.zeros((len(TASKS), len(TASKS)), np.int64)
    for transition in settings.forbidden:
        before, after = transition.split(">")
        forbidden[TASKS.index(before), TASKS.index(after)] = 1
    values = dataclasses.asdict(settings)
    return record(
        forbidden=forbidden,
        centralized=settings.model == "centralized",
        pngl=settings.guidance == "pngl",
        deviates=settings.deviation != "none",
        as_occupant=settings.deviation == "occupant",
        by_slot_frame=settings.follower_frame == "slot-frame",
        **{name: float(value) for name, value in values.items() if isinstance(value, int | float)},
    )


class Team(NamedTuple):
    """What the trackers of a team have in common."""

    at: Record
    """:func:`offsets_of`: where each field is in an observation."""
    world: Record
    """:func:`constants_of`: robots and arena."""
    settings: Record
    """:func:`settings_of`."""
    slots: npt.NDArray[np.complex64]
    """(N,) place of each slot in the slot frame, m."""
    beams: npt.NDArray[np.complex64]
    """(S,) direction of each sonar beam in the robot's own axes."""


MIND: Final = record(
    step=_I(0),  # control steps since the episode began
    # this robot, from the observation of this step; heading, motion and limits are those of BODY
    number=_I(0),
    position=np.complex128(0),
    **BODY,
    # the target, as it was at the newest fix
    fix_step=_I(-1),  # own step of that fix; -1: none yet
    fix=_C(0),  # position
    fix_theta=_F(0),
    fix_psi=_F(0),
    target_speed=_F(0),  # estimated speed, m/s
    target_turn=_F(0),  # estimated turn rate, rad/s
    speed_known=_I(0),  # 1: the speed has been measured
    # the target, as it is taken to be now
    target=_C(0),  # position
    target_theta=_F(0),
    target_velocity=_C(0),
    psi_rate=_F(0),  # turn rate of the slot frame, rad/s
    psi_limit=_F(0),  # its greatest, rad/s
    frame=_C(0),  # heading of the slot frame
    fix_age=_F(0),  # s
    known=_I(0),  # 1: there is an estimate that is not too old
    horizon=_F(0),  # distance within which every team-mate that is heard is listed, m
    others=_I(0),  # how many team-mates count as working and in range
    # tracking
    task=_I(0),
    slot=_I(-1),  # -1: none
    pull=_C(0),  # in a search, to where the target may be, beside the own heading's of 1; of scripts 0
    closing=_I(0),  # 1: the law itself, not the safeguard, keeps the range to the target
    side=_I(0),  # of the last detour: 1 left, -1 right
    side_step=_I(0),  # own step of that detour
    # the tracking layer's result; float64, so that storing it changes no action
    wish=np.complex128(0),  # wanted velocity
    wish_speed=np.float64(0),  # its command: m/s, rad/s
    wish_omega=np.float64(0),
    # commands that wait for their execution, m/s and rad/s, by own step modulo the delay
    waiting=np.zeros(_MOST_WAITING, np.complex128),
    # leadership
    leader=_I(-1),  # -1: none yet
    term=_I(0),  # of its claim to know the leader, modulo 256; the higher one wins
    pulse=_I(0),  # the leader counts its steps, modulo 256; team-mates pass the count on
    pulse_step=_I(0),  # own step at which the count last went up
    confirmed=_I(0),  # 0: the leader has not been heard of since it was appointed
    exchanges=_I(0),  # times that the lead passed to another, as far as this one knows
)
"""Memory of one tracker at the start of an episode, an array of one record."""

MATE: Final = record(
    step=_I(-1),  # own step at which it sent what follows; -1: never heard
    heard=_I(-1),  # own step at which it was heard last
    position=_C(0),
    velocity=_C(0),
    heading=_C(0),
    turn=_F(0),  # turn rate, rad/s
    # when the command of this step is executed
    there=_I(0),  # 1: counts as working and in range
    place=np.complex128(0),
    # from its drifting frame to the own one, measured by the target that both see
    aligned=_I(0),  # 1: has been measured
    shift=_C(0),  # m
    twist=_F(0),  # rad
    leader=_I(-1),
    term=_I(-1),
    pulse=_I(-1),
    slot=_I(-1),  # -1: not said
)
"""Knowledge of a tracker about a team-mate at the start of an episode, an array of one record."""


class Minds(OwnArrays):
    """The memory of a team of N trackers in each of E worlds, or of R robots of it.

    Attributes:
        layout: Of the observations.
        team: What the trackers have in common; ``at``, ``world`` and ``settings`` are arrays of one record.
        me: (E, R) :data:`MIND`.
        mates: (E, R, N) :data:`MATE`, by the mate's number; nothing is ever heard of oneself.
    """

    def __init__(self, layout: ObservationLayout, settings: Settings, num_worlds: int, robots: int) -> None:
        self.layout, unit = layout, unit_of(layout.scenario)
        if layout.scenario.command_delay > _MOST_WAITING:
            least = f"at most {_MOST_WAITING}: a longer control_step makes it fewer steps"
            raise PolicyError(f"the DDCS foresees no command_delay={layout.scenario.command_delay}, but {least}")
        if SENSORS[layout.scenario.sensor].fix == "bearing":
            why = f"sensor={layout.scenario.sensor!r} measures bearings alone"
            raise PolicyError(f"DDCS and safeguard need positions of the target, and {why}: choose another sensor")
        cosines, sines = beam_directions(layout.scenario)
        self.team = Team(
            offsets_of(layout),
            constants_of(layout.scenario),
            settings_of(settings),
            np.array([complex(*slot) / unit for slot in layout.scenario.slot_offsets], np.complex64),
            (cosines + 1j * sines).astype(np.complex64),
        )
        self._units = np.ones(layout.size, np.float32)
        for field in layout.fields:
            if field.unit in ("m", "m/s"):
                layout.views(self._units)[field.name][...] = unit
        self.me: Records = np.full((num_worlds, robots), MIND)
        self.mates: Records = np.full((num_worlds, robots, layout.scenario.num_trackers), MATE)

    def restart(self, mask: BoolArray) -> None:
        """Forget all in the worlds of a mask (E,), whose episodes restart."""
        self.me[mask], self.mates[mask] = MIND, MATE

    def run(self, kernel: Callable[..., None], part: int, observations: FloatArray, out: FloatArray) -> None:
        """Do a part of a control step with a kernel, on observations (E, R, F); it writes to ``out`` (E, R, ...)."""
        rows = check_observations(observations, self.me.shape, self.layout)
        if unit_of(self.layout.scenario) != 1.0:
            rows = rows / self._units
        minds, works = (self.team, self.me, self.mates), work_for(self.layout.scenario.num_trackers)
        over_worlds(kernel, (minds, works, (rows, out), part), *self.me.shape)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        arrays: dict[str, npt.NDArray[Any]] = {}
        for name, records in (("me", self.me), ("mates", self.mates)):
            arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names or ()}
        return arrays


@compiled
def pair(row: FloatArray, at: int) -> complex:
    """Return the vector whose two components stand at a place of an observation."""
    return complex(row[at], row[at + 1])


@compiled
def is_due(team: Team, me: Record, period: float) -> bool:
    """Return whether what is done once a period (s) is done in this control step."""
    return bool(me.step % max(1, round(period / team.world.dt)) == 0)


@compiled
def since(team: Team, me: Record, step: int) -> float:
    """Return the time (s) since an own step."""
    return float((me.step - step) * team.world.dt)
