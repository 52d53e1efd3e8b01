"""One real robot in the place of a tracker: its measurements become an observation, an action its command."""

import math
import warnings
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.declarations import SENSORS, is_number
from posse.engine.arguments import as_float32, in_box, real_numbers
from posse.engine.batch import Batch
from posse.engine.kernels import START
from posse.numeric import FloatArray, Records, kernel
from posse.rules.kinematics import follow_heading
from posse.rules.senses.sensing import take_fix
from posse.rules.state import BROADCAST
from posse.scenarios import Scenario, ScenarioError, get_scenario
from posse.scenarios.scenario import UNLIMITED
from posse.scenarios.setting import check_count
from posse.signals.layout import ObservationLayout

_BARELY_LOSSY: Final = 1e-9  # loss of a radio whose messages a world keeps with their ages
_ECHO: Final = 0.8  # steps; a fix that team-mates, whose steps begin at other times, tell again seems newer by less


class TargetFix(NamedTuple):
    """A measurement of the target in the team's common frame."""

    x: float
    """m, in the robots' own metres, as everything here."""
    y: float
    heading: float
    """rad."""
    age: float = 0.0
    """s since it was taken."""
    frame: float | None = None
    """Slot frame ψ then, rad; ``None``: unknown, and the robot estimates it from the headings."""


class Heard(NamedTuple):
    """What a robot broadcasts, and what its team-mates hear of it."""

    number: int
    """Its number in the team."""
    x: float
    """m, common frame."""
    y: float
    heading: float
    """rad."""
    speed: float
    """m/s."""
    turn_rate: float
    """rad/s, positive to the left."""
    message: tuple[float, ...] = ()
    """``message_size`` numbers of its policy."""
    fix: TargetFix | None = None
    """Its best fix of the target."""
    age: float = 0.0
    """s since it was sent."""


class Command(NamedTuple):
    """What a robot does until its next observation."""

    speed: float
    """m/s."""
    turn_rate: float
    """rad/s, positive to the left."""
    message: tuple[float, ...]
    """What its broadcasts say from the next observation on, as a tracker's."""


class Robot:
    """One robot of a team, driven by a policy of posse in a world that is not posse's.

    Call :meth:`observe` once a control step (``scenario.control_step``, s), give the row to a policy, and carry out
    what :meth:`command` makes of its action. All robots share one common frame, whose origin is the middle of the
    arena if there is one, and count ages in seconds; clocks need not agree.

    Args:
        scenario: The scenario, or its name, whose settings describe the team: sizes, speeds, ranges, formation.
        number: The robot's number in the team, 0 to N - 1.
        scale: Scenario metres per metre of the robot. A robot of 0.055 m radius plays one of 0.15 m with 2.73.
        **overrides: Settings to change.

    Attributes:
        scenario: Its settings, in scenario metres.
        layout: The layout of its observation.
        steps: Control steps since the first observation; -1 before it.

    Raises:
        ScenarioError: An invalid setting, or a sensor that measures bearings alone.
        ValueError: ``number`` or ``scale`` is out of its range.
    """

    def __init__(self, scenario: str | Scenario, number: int, *, scale: float = 1.0, **overrides: Any) -> None:
        self.scenario = get_scenario(scenario, **overrides)
        if SENSORS[self.scenario.sensor].fix == "bearing":
            raise ScenarioError(f"sensor={self.scenario.sensor!r} gives bearings; a robot needs a sensor of positions")
        if check_count("number", number, 0) >= self.scenario.num_trackers:
            raise ValueError(f"number={number} must be from 0 to {self.scenario.num_trackers - 1}, one of the team's")
        if not (is_number(scale) and 1e-3 <= scale <= 1e3):
            raise ValueError(f"scale={scale!r:.80} must be from 0.001 to 1000: scenario metres per metre of the robot")
        self.number, self.scale = int(number), float(scale)
        self.layout = ObservationLayout(self.scenario)
        lossy = max(self.scenario.radio_loss, _BARELY_LOSSY)  # worlds with a perfect radio store no messages
        self._world = Batch(self.scenario.replace(radio_loss=lossy), 1, num_threads=1)
        self.reset()
        self.observe((0.0, 0.0, 0.0), 0.0, 0.0, TargetFix(0.0, 0.0, 0.0))  # compiles, which would halt a control loop
        self.command(np.zeros(2 + self.scenario.message_size))
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next observation is the first of an episode."""
        self._world._execute(START)  # no reset: where the robots are drawn plays no part
        self._world._started = True
        arrays = self._world.arrays
        arrays.heard["step"], arrays.heard_message[...] = -1, 0.0
        self._me.fix_step, self._me.sees = -1, 0
        self.steps = -1
        # In steps: when each team-mate's last pose was measured and, by the own number, the last fix.
        self._newest: dict[int, float] = {}
        self._message = (0.0,) * self.scenario.message_size
        self._sent: Heard | None = None

    @property
    def _me(self) -> Any:
        return self._world.arrays.tracker[0, self.number]

    def observe(
        self,
        pose: npt.ArrayLike,
        speed: float,
        turn_rate: float,
        target_fix: TargetFix | None = None,
        sonar: npt.ArrayLike | None = None,
        heard: Iterable[Heard] = (),
        *,
        touching: bool = False,
    ) -> FloatArray:
        """Return the observation (F,) of the next control step.

        Args:
            pose: Own x, y (m) and heading (rad) in the common frame, from odometry or a map. A warning tells of one
                that no robot of the scenario reaches.
            speed: Own speed, m/s.
            turn_rate: Own turn rate, rad/s, positive to the left.
            target_fix: What its own sensor measured of the target; ``None``: it does not see it. Then the last fix
                stays, and its age grows.
            sonar: (``sonar_beams``,) distance from its rim to the nearest thing, m. Beam k is a cone about the
                direction 2πk / S to the left of ahead, π / S to each side. A beam that contains the point of a body
                nearest to the robot reads the distance of that point; another one, the distance along its axis.
                Readings beyond ``sonar_range``, or ``None``: nothing is near.
            heard: What arrived since the last observation. Of each team-mate the newest stays, and its age grows. The
                newest of what is older than the first observation counts as being of that moment. A warning tells of
                what is heard later than ``radio_delay``, which policies do not expect.
            touching: Whether it touches a robot, an obstacle or a wall.

        Raises:
            ValueError: A measurement of a wrong shape, not finite, or of a robot that is not in the team. Nothing is
                changed.
        """
        x, y, heading = _finite("pose", pose, (3,))
        farthest = (self.scenario.position_bound + self.scenario.drift_bound) / self.scale
        if max(abs(x), abs(y)) > farthest:
            inside = f"{self.scenario.name!r} reaches {farthest:.3g} m from its middle"
            warnings.warn(f"the pose lies outside: {inside}; check the frame, the unit and scale", stacklevel=2)
        speed, turn_rate, touched = _finite("speed, turn_rate and touching", (speed, turn_rate, touching), (3,))
        beams = self.scenario.sonar_beams
        readings = np.full(beams, np.inf) if sonar is None else real_numbers("sonar", sonar).astype(np.float64)
        if readings.shape != (beams,) or not readings.min(initial=0.0) >= 0.0:
            raise ValueError(f"sonar={sonar!r} must be {beams} distances of at least 0 m")
        messages = [self._checked(message) for message in heard or ()]
        fix = None if target_fix is None else self._checked_fix(target_fix)

        self.steps += 1
        world, me = self._world.arrays.world[0], self._me
        world.step = self.steps
        _place(me, x * self.scale, y * self.scale, heading)
        me.speed, me.turn_rate, me.touching, me.sees = speed * self.scale, turn_rate, touched != 0, fix is not None
        if fix is not None:
            self._take(fix)
        # As a tracker, which sends before it hears.
        self._sent = Heard(self.number, x, y, heading, speed, turn_rate, self._message, self._best_fix())
        for message in messages:
            self._hear(message)
        row: FloatArray = self._world.observe()[0, self.number]
        if beams:
            row[self.layout.offsets["sonar"] :][:beams] = np.minimum(readings * self.scale, self.scenario.sonar_range)
        return row

    def command(self, action: npt.ArrayLike) -> Command:
        """Return what an action (2 + m,) in [-1, 1] commands, in the robot's own units.

        Raises:
            ValueError: An action of a wrong shape, not finite or outside [-1, 1].
        """
        numbers = as_float32("action", action, (2 + self.scenario.message_size,)).reshape(1, 1, -1)
        forward, turn, *message = in_box(numbers, False, "action[{2}]".format)[0, 0].tolist()
        self._message = tuple(message)
        s, turn_rate = self.scenario, turn * self.scenario.tracker_turn_rates[self.number]
        most = s.tracker_speeds[self.number]
        left = max(0.0, most - 0.5 * s.wheel_base * abs(turn_rate))  # by the turn, as in posse.rules.motion
        return Command(min((forward + 1) / 2 * most, left) / self.scale, turn_rate, self._message)

    def broadcast(self) -> Heard:
        """Return what team-mates should hear of it now: its last measurements, and what its policy said before."""
        if self._sent is None:
            raise ValueError("broadcast before the first observation: call observe() first")
        return self._sent

    def _best_fix(self) -> TargetFix | None:
        me = self._me
        if me.fix_step < 0:
            return None
        return TargetFix(
            float(me.fix.x) / self.scale,
            float(me.fix.y) / self.scale,
            math.atan2(me.fix.sin, me.fix.cos),
            (self.steps - self._newest[self.number]) * self.scenario.control_step,
            math.atan2(me.fix.frame_sin, me.fix.frame_cos),
        )

    def _checked(self, given: Any) -> Heard:
        if not isinstance(given, (tuple, list)) or not 6 <= len(given) <= len(Heard._fields):
            raise ValueError(f"heard {given!r:.80}: give a list of posse.Heard, as broadcast() returns them")
        message = Heard(*given)  # also of JSON's list
        said = tuple(np.atleast_1d(message.message))
        _finite("a message heard", (*message[1:6], *said), (5 + len(said),))
        _check_age(message.age)
        number = check_count("heard number", message.number, 0)
        if number >= self.scenario.num_trackers or number == self.number:
            raise ValueError(f"heard number={number}, which is no team-mate of {self.number}")
        if len(said) not in (0, self.scenario.message_size):
            raise ValueError(f"heard a message of {len(said)}, wanted {self.scenario.message_size} numbers")
        delay = self.scenario.radio_delay
        if message.age > (delay + 0.5) * self.scenario.control_step:
            late = f"messages arrive later than radio_delay={delay} steps, which policies expect"
            warnings.warn(f"{late}: set it to that of the real radio", stacklevel=2)  # one text, which is shown once
        return message._replace(message=said, fix=None if message.fix is None else self._checked_fix(message.fix))

    def _checked_fix(self, fix: Any) -> TargetFix:
        if not isinstance(fix, (tuple, list)) or not 3 <= len(fix) <= 5:
            raise ValueError(f"fix={fix!r} must be x, y, heading, and perhaps age and frame")
        checked = TargetFix(*fix)  # also of JSON's list
        _finite("a fix", [value for value in checked if value is not None], (5 - (checked.frame is None),))
        _check_age(checked.age)
        return checked

    def _when(self, number: int, age: float, apart: float = 0.0) -> float | None:
        """Return when (steps) a pose or fix was measured, at least 0; ``None``: not ``apart`` later than the last."""
        when = self.steps - age / self.scenario.control_step
        if when <= self._newest.get(number, -math.inf) + apart:
            return None
        self._newest[number] = when
        return max(0.0, when)

    def _take(self, fix: TargetFix) -> None:
        """Take a fix, if it is newer than the last one, as a tracker of a world does."""
        me, when = self._me, self._when(self.number, fix.age, _ECHO)
        if when is None:
            return
        # If it rounds to the step of the last fix, it counts as of the next one: a velocity needs two steps.
        step = max(round(when), min(math.ceil(when - 1e-6), int(me.fix_step) + 1))
        me.fix_step = min(me.fix_step, step - 1)  # where both are older than the first observation
        new = np.zeros(1, BROADCAST)
        new["fix_step"] = step
        _place(new[0].fix, fix.x * self.scale, fix.y * self.scale, fix.heading, "")
        frame = fix.heading if fix.frame is None else fix.frame
        new[0].fix.frame_cos, new[0].fix.frame_sin = math.cos(frame), math.sin(frame)
        trackers = self._world.arrays.tracker[0]
        _keep(self._world._fixed.config, trackers, self.number, new, fix.frame is None)

    def _hear(self, message: Heard) -> None:
        """Store a message, unless a later one of the same team-mate was heard, and take its fix."""
        arrays, when = self._world.arrays, self._when(message.number, message.age)
        heard = arrays.heard[0, self.number, message.number]
        if when is not None:
            heard.step = math.floor(when + 0.5)  # round() would alternate at halves
            _place(heard, message.x * self.scale, message.y * self.scale, message.heading)
            heard.speed, heard.turn_rate = message.speed * self.scale, message.turn_rate
            arrays.heard_message[0, self.number, message.number] = message.message or 0.0
        if message.fix is not None:
            self._take(message.fix._replace(age=message.fix.age + message.age))


@kernel
def _keep(config: Records, trackers: Records, number: int, news: Records, follows: bool) -> None:
    """Take the one fix of ``news``; if its slot frame ``follows``, that turns from the last one to its heading."""
    c, t, new = config[0], trackers[number], news[0]
    if follows and t.fix_step >= 0:
        cos, sin = t.fix.frame_cos, t.fix.frame_sin
        for _ in range(new.fix_step - t.fix_step):
            cos, sin = follow_heading(cos, sin, new.fix.cos, new.fix.sin, c.frame_c, c.frame_s)
        new.fix.frame_cos, new.fix.frame_sin = cos, sin
    take_fix(c, t, new)


def _place(record: Any, x: float, y: float, heading: float, prefix: str = "heading_") -> None:
    record.x, record.y = x, y
    setattr(record, f"{prefix}cos", math.cos(heading))
    setattr(record, f"{prefix}sin", math.sin(heading))


def _check_age(age: float) -> None:
    if not (is_number(age) and age >= 0.0):
        raise ValueError(f"age={age!r:.80} must be the seconds since then, at least 0")


def _finite(name: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    array = real_numbers(name, values).astype(np.float64)
    if array.shape != shape or not (np.abs(array) < UNLIMITED).all():  # also of nan
        raise ValueError(f"{name}={values!r} must be {shape[0]} numbers between -{UNLIMITED:g} and {UNLIMITED:g}")
    return array
