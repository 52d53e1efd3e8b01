"""The belief planner: plays ahead as the planner does, in a world that each tracker keeps of what it observes.

What a tracker is told belongs to the moment at which it was measured or sent: it is written into the world as it was
then, and the world is stepped from there to the present with the actions that were planned meanwhile. So a late fix
corrects the present by what the engine makes of it, and is not rolled forward on a line.
"""

import math
from dataclasses import replace
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout, Scenario
from posse.numeric import BoolArray, FloatArray, Records, record_type
from posse.rules import DART_TURN, NEVER, PATIENCE, parts
from posse.scenarios.scenario import FARTHEST
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.memory import Minds, unit_of
from posse_baselines.ddcs.settings import Settings
from posse_baselines.policies.planner import PlannerSettings, Search
from posse_baselines.policy import Annotations, Memory
from posse_baselines.tuned import tuned_settings

_ROBOT: Final = ("x", "y", "heading_cos", "heading_sin", "speed", "turn_rate")
_AWAY: Final = 1e3  # m; where what is not known of stands
_STRAYS: Final = 0.002  # m; standard deviation of where a target is foreseen a step after a fix
_UNSEEN: Final = 0.012  # m; what each further step without a fix adds to that of the next step
_HEADING_TRUST: Final = 0.1  # share of the difference from the believed heading of the slot frame that is corrected
_LOST_AFTER: Final = 2.0  # s; age of a fix up to which the planned motion is played, then the script's
_UNSEEN_DELAY: Final = 30.0  # s; by how much later slots are filled from which the target cannot be seen
_AGREES: Final = 0.02  # rad; a heading foreseen this well leaves the goal that the target was believed to have
_TURNS: Final = 0.4  # share of its turn limit from which a target is taken to turn for a goal
_GAP: Final = 1.0  # s; over longer gaps no turn rate is measured
_SLOPE_TRUST: Final = 2.0  # correction of a weave's cosine for each rad/s by which its turn rate was foreseen wrong
_RATE_TRUST: Final = 0.1  # 1/s; correction of a weave's rate for each rad by which its phase was foreseen wrong
_SOON: Final = 0.8  # s; a turn that was not foreseen is a dart if one was due so soon
_PARTICLES: Final = 300  # of each tracker: places between the walls where the target may be
_BEND: Final = 0.5  # rad/s; standard deviation of the particles' turn rates
_FEW: Final = 0.05  # share of unseen particles below which all count as unseen again
_PULL: Final = 0.5  # of the particles in a search, where the own heading pulls by 1

_SEEN: Final = record_type(
    ("step", np.int64),  # own step of the newest fix that was written; NEVER before it: none
    ("theta", np.float64),  # heading then, rad
    ("variance", np.float64),  # of where the target is believed to be now, m²
)

_PARTICLE: Final = record_type(("place", np.complex128), ("course", np.complex128), ("unseen", np.bool_))


class _Told(NamedTuple):
    """What the trackers of R belief worlds were told of W moments, oldest first, and what was done then."""

    heard: BoolArray
    """(W, R, N) whose pose is known."""
    robots: FloatArray
    """(W, R, N, 6) by :data:`_ROBOT`, in the common frame."""
    fixed: BoolArray
    """(W, R) whether there is a fix of the target."""
    fix: npt.NDArray[np.complex64]
    """(W, R, 4) its position, heading, slot frame and velocity."""
    variance: npt.NDArray[np.float64]
    """(W, R) of that position, m²."""
    played: FloatArray
    """(W, R, rows, 2 + m) the actions."""


def believed(scenario: Scenario) -> Scenario:
    """Return the scenario of the belief worlds: robots, target and space of the real one; nothing hides or fails."""
    near, far = scenario.start_distance  # no start is played: wider, as far as there is room
    far += min(2 * scenario.num_trackers * scenario.robot_radius, 0.99 * (FARTHEST - scenario.position_bound))
    return scenario.replace(
        start_distance=(near, min(far, 2 * FARTHEST)),
        sensor="range-bearing",
        sonar_beams=0,
        num_neighbours=0,
        message_size=0,
        radio_range=math.inf,
        terminate_on_contact=False,
        num_obstacles=0,
        extra_fields=(),
        metrics=(),
        **dict.fromkeys(("range_noise", "bearing_noise", "heading_noise", "velocity_smoothing"), 0.0),
        **dict.fromkeys(("odometry_drift", "heading_drift", "radio_loss", "sensor_outages", "radio_outages"), 0.0),
        **dict.fromkeys(("radio_delay", "breaks"), 0),
    )


class Beliefs(Minds):
    """The memory of E teams of N trackers, R = E N: a belief world of each, and the search for the best way in them."""

    def __init__(
        self, layout: ObservationLayout, settings: Settings, num_worlds: int, plans: PlannerSettings | None
    ) -> None:
        scenario = layout.scenario
        super().__init__(layout, settings, num_worlds, scenario.num_trackers)
        self.dt, self.rows = scenario.control_step, num_worlds * scenario.num_trackers
        self.noise = max(scenario.range_noise, scenario.bearing_noise)
        self.late = scenario.radio_delay > 0 or scenario.radio_loss > 0 or math.isfinite(scenario.radio_range)
        window = 2 * scenario.radio_delay + 2 if self.late else 0
        assumed = believed(scenario)
        self.now = Batch(assumed, self.rows)
        self.now.reset(seed=0)
        self._past = self.now.arrays.copy()
        """The worlds as they were at the beginning of the window, before anything was written of that moment."""
        self._start = self.now.arrays.copy()  # every world starts as the first of these
        self._start.world["step"] = -window - 1
        self._start.tracker["x"], self._start.tracker["broken_at"], self._start.tracker["fix_step"] = _AWAY, 0, -1
        self._seen = np.zeros(self.rows, _SEEN)  # as of the past
        self.newest, self.age = np.zeros(self.rows, np.int64), np.zeros(self.rows, np.int64)
        shape = window + 1, self.rows, scenario.num_trackers
        self._told = _Told(
            np.zeros(shape, np.bool_),
            np.zeros((*shape, len(_ROBOT)), np.float32),
            np.zeros(shape[:2], np.bool_),
            np.zeros((*shape[:2], 4), np.complex64),
            np.zeros(shape[:2]),
            np.zeros((window + 1, *self.now.action_shape), np.float32),
        )
        # With more rounds, plans of trackers that know different things differ more: 0.01 to 0.02 less on radio.
        self.search = Search(plans or PlannerSettings(rounds=2 if self.late else 6), self.now)
        arms = [math.hypot(*slot) for slot in scenario.slot_offsets]
        self.search.teams.late[:] = _UNSEEN_DELAY * (np.array(arms) > scenario.sensing_range)
        rng, count = np.random.default_rng(0), _PARTICLES if scenario.walled else 0
        self._drawn = np.ones(count, _PARTICLE)
        x, y = rng.uniform(-1.0, 1.0, (2, count)) * np.reshape(scenario.half_sides, (2, 1))
        self._drawn["place"], self._drawn["course"] = x + 1j * y, np.exp(1j * rng.uniform(-np.pi, np.pi, count))
        self._bend = np.exp(1j * self.dt * _BEND * rng.normal(size=count))
        self._particles = np.tile(self._drawn, (self.rows, 1))
        self.restart(np.ones(num_worlds, np.bool_))

    def restart(self, mask: BoolArray) -> None:
        """Forget all in the worlds of a mask (E,)."""
        super().restart(mask)
        mask = np.repeat(mask, self.me.shape[1])
        for mine, start in zip(self._past, self._start, strict=True):
            mine[mask] = start[:1]
        self._seen[mask] = (-NEVER, 0.0, 0.0)
        self.newest[mask], self.age[mask] = -1, NEVER
        self._told.heard[:, mask], self._told.fixed[:, mask], self._told.played[:, mask] = False, False, 0.0
        self._particles[mask] = self._drawn
        self.search.restart(mask)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the memory, field by field, as views."""
        teams, held = self.search.teams, {"seen": self._seen, "newest": self.newest, "age": self.age}
        held |= {"particles": self._particles, "ways": teams.ways, "plans": teams.plans, **self._told._asdict()}
        fields = chain.from_iterable(parts(name, array) for name, array in held.items())
        return {**super().arrays(), **self._past.by_name(), **dict(fields)}

    def plan(self, observations: FloatArray) -> FloatArray:
        """Bring the worlds up to the present by observations (E, N, F); return each tracker's own action, (R, 2)."""
        worlds, rows, mates = self.now.arrays, np.arange(self.rows), self.mates.reshape(self.rows, -1)
        own = self.layout.views(observations)["number"].astype(np.int64).reshape(-1)
        working = mates["there"] != 0
        working[rows, own] = True
        worlds.write(self._past)
        worlds.tracker["broken_at"] = np.where(working, NEVER, 0)
        silent, last = ~working & (mates["step"] >= 0), unit_of(self.layout.scenario) * mates["position"]
        robots = worlds.tracker  # one that was taken to drive on meanwhile would stand in the way of others
        robots["x"][silent], robots["y"][silent], robots["speed"][silent] = last.real[silent], last.imag[silent], 0.0
        self._advance(self._seen, 0)
        self._past.write(worlds)
        for array in self._told:
            array[:-1], array[-1] = array[1:], 0
        self._listen(observations, own, mates)
        seen, present = self._seen.copy(), len(self._told.fixed) - 1
        for moment in range(present):
            self._advance(seen, moment)
        self._write(seen, present)
        worlds.tracker["near"], worlds.world["near"], worlds.world["over"] = 1, 1, 0
        actions = self.search.actions()
        self._told.played[-1] = actions
        return actions[rows, own, :2]

    def look_for(self) -> None:
        """Set the pull on each tracker in its search: to unseen particles that no team-mate is nearer to.

        Particles drive on arcs at the target's speed, and turn back at walls, until they come into the range of sight.
        """
        s, me = self.layout.scenario, self.me.reshape(-1)
        lost = np.flatnonzero(me["known"] == 0)
        particles, rows, own = self._particles[lost], np.arange(len(lost)), me["number"][lost]
        course = particles["course"] * self._bend
        place = particles["place"] + s.target_speed * self.dt * course
        at, ahead = (each.view(np.float64).reshape(*each.shape, 2) for each in (place, course))
        np.copyto(ahead, -np.copysign(ahead, at), where=np.abs(at) > s.half_sides)
        mates = self.mates.reshape(self.rows, -1)[lost]
        there = mates["there"] != 0
        there[rows, own] = True
        ways = place[:, None] - unit_of(s) * mates["place"][..., None]
        far = np.where(there[..., None], np.abs(ways), np.inf)
        near = far.min(axis=1)
        unseen = particles["unseen"] & (near > s.sensing_range)
        unseen[unseen.mean(axis=1) < _FEW] = True
        weight = np.where(unseen & (far[rows, own] == near), near, np.inf) ** -3.0
        way = (weight / near * ways[rows, own]).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9)
        me["pull"][lost] = _PULL * way
        particles["place"], particles["course"], particles["unseen"] = place, course, unseen
        self._particles["unseen"] = True
        self._particles[lost] = particles

    def planned(self) -> BoolArray:
        """Return whether each tracker plays what it planned, (E, N)."""
        return np.asarray(self.age.reshape(self.me.shape) * self.dt <= _LOST_AFTER)

    def _advance(self, seen: Records, moment: int) -> None:
        """Write what was told of a moment, and step the worlds from there."""
        self._write(seen, moment)
        self.now.arrays.world["over"] = 0
        self.now.step(self._told.played[moment])

    def _listen(self, observations: FloatArray, own: npt.NDArray[np.int64], mates: Records) -> None:
        """Sort what observations (E, N, F) of the trackers of numbers ``own`` (R,) say by its moments."""
        views = self.layout.views(observations)
        v = {name: view.reshape(self.rows, *view.shape[2:]) for name, view in views.items()}
        told, window = self._told, len(self._told.fixed) - 1
        heading, position = _complex(v["heading"]), _complex(v["position"])
        rows = np.arange(self.rows)
        told.heard[-1, rows, own] = True
        told.robots[-1, rows, own] = _poses(position, heading, v["speed"], v["turn_rate"])
        if self.layout.neighbours:
            age = np.where(v["neighbour_number"] >= 0, np.rint(v["neighbour_age"] / self.dt), -1)
            place = position[:, None] + v["neighbour_range"] * _complex(v["neighbour_bearing"]) * heading[:, None]
            turned = _complex(v["neighbour_heading"]) * heading[:, None]
            if self.layout.scenario.drifts:  # from the sender's frame to the own one
                sender = np.take_along_axis(mates, np.maximum(v["neighbour_number"], 0).astype(np.int64), axis=1)
                place = place + unit_of(self.layout.scenario) * sender["shift"]
                turned = turned * np.exp(1j * sender["twist"])
            known = np.nonzero((age >= 0) & (age <= window))
            which = window - age[known].astype(np.int64), known[0], v["neighbour_number"][known].astype(np.int64)
            told.heard[which] = True
            told.robots[which] = _poses(place, turned, v["neighbour_speed"], v["neighbour_turn_rate"])[known]
        age = np.rint(v["target_age"] / self.dt)
        self.age = np.where(v["target_known"] > 0, age, NEVER)
        step = self.me["step"].reshape(-1) - age
        fresh = (v["target_known"] > 0) & (v["target_range"] >= 0) & (step > self.newest)
        self.newest[fresh] = step[fresh]
        place = position + v["target_range"] * _complex(v["target_bearing"]) * heading
        theta, frame = (_complex(v[name]) * heading for name in ("target_heading", "target_frame"))
        velocity = _complex(v["target_velocity"]) * heading
        late = np.maximum(age - window, 0.0) * self.dt
        place = place + late * self.now.scenario.target_speed * theta
        fix = np.stack([place, theta, frame, velocity], axis=-1)
        at = window - np.minimum(age, window).astype(np.int64)[fresh], np.flatnonzero(fresh)
        told.fixed[at], told.fix[at] = True, fix[fresh]
        away = np.minimum(v["target_range"], self.layout.scenario.sensing_range)  # of who saw it: at most
        told.variance[at] = ((self.noise * away) ** 2)[fresh]

    def _write(self, seen: Records, moment: int) -> None:
        """Write what was told of the present moment of the worlds into them."""
        worlds, s = self.now.arrays, self.now.scenario
        told = _Told(*(array[moment] for array in self._told))
        w = worlds.world
        for k, name in enumerate(_ROBOT):
            worlds.tracker[name][told.heard] = told.robots[told.heard, k]
        here = told.fixed
        place, theta, frame, velocity = told.fix.T.astype(np.complex128)
        steps = w["step"] - seen["step"]
        gap = steps * self.dt
        first = gap > _LOST_AFTER
        if self.noise > 0.0:  # a Kalman filter, whose model is the world
            seen["variance"] += _STRAYS**2 + (_UNSEEN * (steps - 1)) ** 2
            foreseen, trust = w["x"] + 1j * w["y"], seen["variance"] / (seen["variance"] + told.variance)
            place = foreseen + trust * (place - foreseen)
            seen["variance"][here] = (trust * told.variance)[here]
        noise = self.layout.scenario.heading_noise
        if noise > 0.0:  # it is the same of both headings, and how the slot frame turns is known
            error = np.angle(frame / (w["frame_cos"] + 1j * w["frame_sin"]))
            excess = np.exp(-1j * np.where(first, 0.0, (1.0 - _HEADING_TRUST) * error))
            theta, frame, noise = theta * excess, frame * excess, _HEADING_TRUST * noise
        angle = np.angle(theta)
        turn = np.where(gap <= _GAP, _wrap(angle - seen["theta"]) / np.maximum(gap, self.dt), 0.0)
        turn = np.clip(turn, -s.target_turn_rate, s.target_turn_rate)
        surprise = _wrap(angle - np.arctan2(w["heading_sin"], w["heading_cos"]))
        speed = np.full(self.rows, s.target_speed)
        if s.target_is_agent:
            speed = np.minimum(np.abs(velocity), s.target_speed)
        goal = _complex(np.stack([w["goal_cos"], w["goal_sin"]], axis=-1))
        unforeseen = first | (np.abs(surprise) > max(_AGREES, 3.0 * noise))
        if s.target_motion == "smart":
            turning = np.abs(turn) > _TURNS * s.target_turn_rate
            goal = np.where(unforeseen, theta * np.exp(1j * np.where(turning, np.sign(turn), 0.0)), goal)
            pressed, wrong, dart = w["pressed"].copy(), here & unforeseen & ~first, -DART_TURN / s.target_turn_rate
            w["pressed"][wrong & turning & (pressed > PATIENCE - _SOON)] = dart
            w["pressed"][wrong & ~turning & (pressed < 0.9 * dart)] = PATIENCE - 0.5
        else:
            goal = np.where(first | (np.abs(surprise) > 10 * _AGREES), theta, goal * np.exp(1j * surprise))
        if s.target_motion == "accelerating":
            self._correct_weave(here & (gap <= _GAP), turn)
        w["x"][here], w["y"][here], w["speed"][here], w["turn_rate"][here] = (
            value[here] for value in (place.real, place.imag, speed, turn)
        )
        for name, direction in (("heading", theta), ("frame", frame), ("goal", goal)):
            w[f"{name}_cos"][here], w[f"{name}_sin"][here] = direction.real[here], direction.imag[here]
        seen["step"][here], seen["theta"][here] = w["step"][here], angle[here]

    def _correct_weave(self, here: BoolArray, turn: FloatArray) -> None:
        """Correct the weaves of the worlds of a mask (R,) by the turn rates (R,) that were measured."""
        w, limit = self.now.arrays.world, self.now.scenario.target_turn_rate
        mask = here & (np.abs(turn) < 0.95 * limit)  # a faster one turns from a wall
        amplitude, rate, turn = w["weave_amplitude"][mask], w["weave_rate"][mask], turn[mask]
        wave = amplitude * np.exp(1j * (w["weave_phase"][mask] - rate * self.dt))  # its imaginary part is the turn rate
        error = turn - wave.imag
        rate = np.clip(rate + _RATE_TRUST * error * wave.real / amplitude**2, 0.2, 0.8)
        wave += error * (1j + _SLOPE_TRUST)
        w["weave_amplitude"][mask], w["weave_rate"][mask] = np.clip(np.abs(wave), 0.4 * limit, 0.9 * limit), rate
        w["weave_phase"][mask] = (np.angle(wave) + rate * self.dt) % (2.0 * math.pi)


def _complex(pairs: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
    return np.asarray(pairs[..., 0] + 1j * pairs[..., 1], np.complex128)


def _poses(place: Any, heading: Any, speed: Any, turn_rate: Any) -> npt.NDArray[Any]:
    """Return robots as :data:`_ROBOT` lists them, (..., 6)."""
    return np.stack([place.real, place.imag, heading.real, heading.imag, speed, turn_rate], axis=-1)


def _wrap(angle: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    return np.asarray(np.angle(np.exp(1j * angle)))


class BeliefPlanner(DDCS):
    """Model-predictive control in a world that each tracker keeps from what it observes and is told.

    Where the target is known, a tracker plays the planner's choice for it in its own world; else it searches as
    ``ddcs-tuned`` does, pulled to where the target may still be. Monitoring, messages and safeguard are of that, too.
    """

    def __init__(self, settings: PlannerSettings | None = None) -> None:
        super().__init__(name="belief-planner")
        self.plans = settings

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return the settings of ``ddcs-tuned`` for a scenario, but for ``apart``, which keeps its default."""
        return replace(tuned_settings("ddcs-tuned", scenario), **{"apart": Settings.apart, **self._changes})

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` teams at the start of an episode; PolicyError as for :class:`DDCS`."""
        super().begin(layout, num_worlds)
        return Beliefs(layout, self.settings_for(layout.scenario), num_worlds, self.plans)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose`, then :meth:`carry_out`."""
        proposals, memory = self.propose(observations, memory)
        return self.carry_out(observations, memory, np.zeros_like(proposals))

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard; see :meth:`DDCS.propose`."""
        proposals, memory = super().propose(observations, memory)
        me, mates = memory.me, memory.mates
        plans = memory.search.teams.plans.reshape(mates.shape)
        if memory.late:  # where trackers know different things, they keep to what they tell each other
            claimed = mates["slot"] >= 0
            plans["slot"][claimed] = mates["slot"][claimed]
        actions = memory.plan(np.asarray(observations, np.float32)).reshape(*me.shape, 2)
        planned = memory.planned()
        if memory.layout.scenario.walled:
            memory.look_for()
        speed, omega = 0.5 * (actions[..., 0] + 1.0) * me["max_speed"], actions[..., 1] * me["max_omega"]
        # Plans make up for the lag of commands, and so does what carries them out.
        followed = memory.team.world["followed"][0]
        speed, omega = (old + followed * (new - old) for old, new in ((me["speed"], speed), (me["omega"], omega)))
        mine = np.take_along_axis(plans, me["number"][..., None], axis=-1)[..., 0]
        wish = mine["wish"] / unit_of(memory.layout.scenario)
        for name, value in {"wish": wish, "wish_speed": speed, "wish_omega": omega, "slot": mine["slot"]}.items():
            me[name] = np.where(planned, value, me[name])
        own = wish * me["heading"].conj() / me["max_speed"]
        proposals[planned] = np.stack([own.real, own.imag], axis=-1)[planned]
        return proposals, memory

    def annotations(self, memory: Memory) -> Annotations:
        """Return those of the DDCS, with the ``estimate`` as believed where the planned motion is played."""
        notes, world, planned = super().annotations(memory), memory.now.arrays.world, memory.planned()
        theta = np.arctan2(world["heading_sin"], world["heading_cos"])
        estimate = np.stack([world["x"], world["y"], theta], axis=-1).reshape(*planned.shape, 3)
        notes["estimate"] = np.where(planned[..., None], estimate, notes["estimate"])
        return notes
