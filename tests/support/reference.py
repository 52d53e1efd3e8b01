"""An independent computation of a world in plain numpy and float64.

Written from the contract and not from the kernels, and in another form wherever there is one:
complex numbers for directions, assignment for slots, graph routines for the radio, Python integers
for the random draws. It reads poses, speeds and faults off the engine's state, one world at a time,
and works out what follows from them.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import connected_components

import posse
from posse.scenarios.formation import FORMATIONS

State = dict[str, npt.NDArray[Any]]
"""Every state array by name: of a batch, or (without the first axis) of one world."""
Array = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

NEVER = 2**30
TOUCHING = 0.001  # m, of free width
_MASK = 2**64 - 1
_GOLDEN = 0x9E3779B97F4A7C15


# ------------------------------------------------------------------------------------ state


def snapshot(batch: posse.Batch) -> State:
    """Return a copy of every state array of a batch."""
    return {name: array.copy() for name, array in batch.state.items()}


def one_world(state: State, e: int) -> State:
    return {name: array[e] for name, array in state.items()}


def positions(state: State) -> Complexes:
    """Return x + iy of the trackers and, last, of the target, (N + 1,)."""
    x = np.append(state["tracker_x"], state["world_x"]).astype(np.float64)
    y = np.append(state["tracker_y"], state["world_y"]).astype(np.float64)
    return x + 1j * y


def headings(state: State) -> Complexes:
    """Return cos θ + i sin θ of the trackers and, last, of the target, (N + 1,)."""
    c = np.append(state["tracker_heading_cos"], state["world_heading_cos"]).astype(np.float64)
    s = np.append(state["tracker_heading_sin"], state["world_heading_sin"]).astype(np.float64)
    return c + 1j * s


def obstacles(state: State) -> tuple[Complexes, Array]:
    x, y = state["obstacle_x"].astype(np.float64), state["obstacle_y"].astype(np.float64)
    return x + 1j * y, state["obstacle_radius"].astype(np.float64)


def working(state: State) -> npt.NDArray[np.bool_]:
    return np.asarray(state["tracker_broken_at"] == NEVER)


# ------------------------------------------------------------------------------------ draws


def _mix(key: int, value: int) -> int:
    z = ((key + _GOLDEN) & _MASK) ^ (value * _GOLDEN & _MASK)
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & _MASK
    return z ^ (z >> 31)


def uniform(key: int, step: int, stream: int, index: int) -> float:
    """Return the engine's uniform draw, from the definition of SplitMix64's finalizer."""
    for value in (step, stream, index):
        key = _mix(key, value)
    return (key >> 40) / 2**24


def normal_pair(key: int, step: int, stream: int, index: int) -> tuple[float, float]:
    """Return the engine's pair of normal draws, cut at radius 3."""
    u = uniform(key, step, stream, 2 * index)
    angle = 2 * math.pi * uniform(key, step, stream, 2 * index + 1)
    cut = math.exp(-4.5)
    radius = math.sqrt(-2 * math.log(cut + (1 - cut) * u))
    return radius * math.cos(angle), radius * math.sin(angle)


# ------------------------------------------------------------------------------------ motion


def on_arc(
    place: complex, heading: complex, speed: float, turn_rate: float, time: float
) -> tuple[complex, complex]:
    """Return position and heading after a time on the circle of (V, ω)."""
    turned = heading * np.exp(1j * turn_rate * time)
    if turn_rate == 0.0:
        return place + speed * time * heading, turned
    # For a small turn the circle's centre is so far away that the difference of two points
    # relative to it is dominated by rounding.
    return place + heading * speed * np.expm1(1j * turn_rate * time) / (1j * turn_rate), turned


def free_motion(
    s: posse.Scenario, before: State, after: State, actions: npt.NDArray[Any]
) -> tuple[Complexes, Complexes, Array]:
    """Return all positions and headings after a step without contacts.

    And the speed and turn rate of the trackers, (2, N). What a scripted target decided is read off
    ``after``.
    """
    n, count = s.num_trackers, s.physics_steps
    dt = s.control_step / count
    place, heading = positions(before), headings(before)
    speeds = np.append(before["tracker_speed"], after["world_speed"]).astype(np.float64)
    turns = np.append(before["tracker_turn_rate"], after["world_turn_rate"]).astype(np.float64)
    if s.target_motion == "agent":
        speeds[n] = (float(actions[n, 0]) + 1) / 2 * s.target_speed
        turns[n] = float(actions[n, 1]) * s.target_turn_rate
    alive = working(after)
    for _ in range(count):
        for i in range(n + 1):
            if i < n:
                if not alive[i]:
                    speeds[i] = turns[i] = 0.0
                    continue
                wanted = (float(actions[i, 0]) + 1) / 2 * s.tracker_speeds[i]
                most = s.tracker_acceleration * dt
                speeds[i] += max(-most, min(most, wanted - speeds[i]))
                wanted = float(actions[i, 1]) * s.tracker_turn_rates[i]
                most = s.tracker_turn_acceleration * dt
                turns[i] += max(-most, min(most, wanted - turns[i]))
            place[i], heading[i] = on_arc(place[i], heading[i], speeds[i], turns[i], dt)
    return place, heading, np.stack([speeds[:n], turns[:n]])


def free_gaps(s: posse.Scenario, state: State) -> Array:
    """Return the clearance between every tracker and everything else, (N, N + 1 + M + 4), m.

    The others: the trackers (its own place holds inf), the target, the obstacles, the walls.
    """
    p, n = positions(state), s.num_trackers
    mates = np.abs(p[:n, None] - p[None, :]) - 2 * s.robot_radius
    mates[np.arange(n), np.arange(n)] = np.inf
    centres, radii = obstacles(state)
    discs = np.abs(p[:n, None] - centres[None, :]) - radii - s.robot_radius
    inner = s.arena / 2 - s.robot_radius
    x, y = p[:n].real, p[:n].imag
    walls = np.stack([inner - x, inner + x, inner - y, inner + y], axis=1)
    return np.concatenate([mates, discs, walls], axis=1)


def path_gaps(s: posse.Scenario, before: State, after: State, freely: Complexes) -> Array:
    """Return a lower bound of every robot's clearance during a step, (N + 1,), m."""
    n = s.num_trackers
    start, end = positions(before), positions(after)
    centres, radii = obstacles(before)
    least = np.full(n + 1, np.inf)
    way = np.maximum(np.abs(freely - start), np.abs(end - start))
    for i in range(n + 1):
        for j in range(n + 1):
            if i != j:
                gap = abs(start[i] - start[j]) - way[i] - way[j] - 2 * s.robot_radius
                least[i] = min(least[i], gap)
        if len(radii):
            gaps = np.abs(start[i] - centres) - way[i] - radii - s.robot_radius
            least[i] = min(least[i], float(gaps.min()))
        inner = s.arena / 2 - s.robot_radius
        least[i] = min(least[i], inner - max(abs(start[i].real), abs(start[i].imag)) - way[i])
    return least


# ------------------------------------------------------------------------------------ senses


def is_occluded(eye: complex, goal: complex, centres: Complexes, radii: Array) -> bool:
    """Return whether a disc intersects the segment between two points."""
    if not len(radii):
        return False
    along = np.clip(((centres - eye) * np.conj(goal - eye)).real / abs(goal - eye) ** 2, 0, 1)
    return bool((np.abs(eye + along * (goal - eye) - centres) < radii).any())


def can_see(s: posse.Scenario, state: State, i: int) -> bool:
    """Return whether tracker i's sensor sees the target."""
    p, h = positions(state), headings(state)
    step, dead = int(state["world_step"]), int(state["tracker_sensor_dead_from"][i])
    offset = p[-1] - p[i]
    return bool(
        working(state)[i]
        and not dead <= step < dead + round(s.outage_time / s.control_step)
        and abs(offset) <= s.sensing_range
        and abs(np.angle(offset / h[i])) <= s.field_of_view / 2
        and not is_occluded(p[i], p[-1], *obstacles(state))
    )


def radio_alive(s: posse.Scenario, state: State, i: int) -> bool:
    step, dead = int(state["world_step"]), int(state["tracker_radio_dead_from"][i])
    outage = dead <= step < dead + round(s.outage_time / s.control_step)
    return bool(working(state)[i]) and not outage


@dataclass
class Fix:
    """A fix of the target: time, position, heading, frame and velocity."""

    step: int = -1
    place: complex = 0.0
    heading: complex = 1.0
    frame: complex = 1.0
    velocity: complex = 0.0

    def newer(self, s: posse.Scenario, other: Fix) -> Fix:
        """Return the other fix with the velocity between the two."""
        steps, velocity = other.step - self.step, 0j
        if self.step >= 0 and steps * s.control_step <= 1.0 + 1e-6:
            velocity = (other.place - self.place) / (steps * s.control_step)
            if s.velocity_smoothing > 0:
                share = 1 - math.exp(-s.control_step / s.velocity_smoothing)
                velocity = self.velocity + min(1.0, share * steps) * (velocity - self.velocity)
            velocity *= min(1.0, max(s.tracker_speeds) / max(abs(velocity), 1e-12))
        return Fix(other.step, other.place, other.heading, other.frame, velocity)


@dataclass
class Said:
    """A message of one tracker."""

    step: int
    place: complex
    heading: complex
    speed: float
    turn_rate: float
    fix: Fix
    message: Array


@dataclass
class Senses:
    """Sensing and radio of one world, computed step by step from the start of its episode."""

    scenario: posse.Scenario
    sees: list[bool] = field(default_factory=list)
    fixes: list[Fix] = field(default_factory=list)
    heard: dict[tuple[int, int], Said] = field(default_factory=dict)
    sent: list[list[Said | None]] = field(default_factory=list)

    def follow(self, state: State, actions: npt.NDArray[Any] | None = None) -> None:
        """Process the state after the next step, and the actions of the step."""
        s, n = self.scenario, self.scenario.num_trackers
        key, step = int(state["world_key"]), int(state["world_step"])
        if not self.fixes:
            self.fixes = [Fix()] * n
        p, h = positions(state), headings(state)
        frame = complex(state["world_frame_cos"], state["world_frame_sin"])
        self.sees = [can_see(s, state, i) for i in range(n)]
        for i in range(n):
            if self.sees[i]:
                offset = p[n] - p[i]
                if s.range_noise or s.bearing_noise:
                    a, b = normal_pair(key, step, 5, i)
                    offset *= (1 + s.range_noise * a) * np.exp(1j * s.bearing_noise * b)
                seen = Fix(step, p[i] + offset, h[n], frame)
                self.fixes[i] = self.fixes[i].newer(s, seen)
        said: list[Said | None] = []
        for i in range(n):
            message = np.zeros(s.message_size)
            if actions is not None:
                message = actions[i, 2:].astype(np.float64)
            speed, turn = float(state["tracker_speed"][i]), float(state["tracker_turn_rate"][i])
            spoken = Said(step, p[i], h[i], speed, turn, self.fixes[i], message)
            said.append(spoken if radio_alive(s, state, i) else None)
        self.sent.append(said)
        if step < s.radio_delay:
            return
        for i in range(n):
            if not radio_alive(s, state, i):
                continue
            for j in range(n):
                words = self.sent[step - s.radio_delay][j]
                if i == j or words is None or abs(words.place - p[i]) > s.radio_range:
                    continue
                if uniform(key, step, 6, i * n + j) < s.radio_loss:
                    continue
                self.heard[i, j] = words
                if words.fix.step > self.fixes[i].step:
                    self.fixes[i] = self.fixes[i].newer(s, words.fix)


def sonar(s: posse.Scenario, state: State, i: int) -> Array:
    """Return the sonar ring of robot i (N: the target) by brute force, (S,) m.

    For each thing and beam: the thing's nearest point, if it lies in the beam's width; else where
    the beam's axis meets the thing.
    """
    p, h = positions(state), headings(state)
    centres, radii = obstacles(state)
    discs = [(p[j], s.robot_radius) for j in range(s.num_trackers + 1) if j != i]
    discs += list(zip(centres, radii, strict=True))
    half, r = s.arena / 2, s.robot_radius
    readings = np.full(s.sonar_beams, s.sonar_range)
    for k in range(s.sonar_beams):
        axis = h[i] * np.exp(2j * math.pi * k / s.sonar_beams)
        found = [s.sonar_range]
        for centre, radius in discs:
            offset = (centre - p[i]) / axis
            if abs(np.angle(offset)) <= math.pi / s.sonar_beams + 1e-7:
                found.append(abs(offset) - radius - r)
            elif abs(offset.imag) < radius and offset.real > 0:
                found.append(offset.real - math.sqrt(radius**2 - offset.imag**2) - r)
        if math.isfinite(half):
            for normal in (1, 1j, -1, -1j):
                away = half - (p[i] * np.conj(normal)).real
                towards = (axis * np.conj(normal)).real
                if towards >= math.cos(math.pi / s.sonar_beams) - 1e-7:
                    found.append(away - r)
                elif towards > 1e-9 and away < s.sonar_range + r:
                    found.append(away / towards - r)
        readings[k] = max(0.0, min(found))
    return readings


# ------------------------------------------------------------------------------------ observation


def _in_order(
    recent: list[tuple[float, int, Said]], told: npt.NDArray[Any]
) -> list[tuple[float, int, Said]]:
    """Return team-mates, nearest first; those equally near within rounding in the given order."""
    places = [int(number) for number in told]
    ordered = list(recent)
    for k in range(len(ordered)):
        ties = [m for m in ordered[k:] if m[0] - ordered[k][0] < 1e-5 and m[1] in places]
        if ties:
            first = min(ties, key=lambda m: places.index(m[1]))
            ordered.remove(first)
            ordered.insert(k, first)
    return ordered


def observation(
    s: posse.Scenario, state: State, i: int, senses: Senses, told: npt.NDArray[Any]
) -> dict[str, Array]:
    """Return the observation of tracker i by field name, as ``ObservationLayout.views``.

    ``told`` holds the numbers of the team-mates in the engine's order, for those equally far.
    """
    p, h, step = positions(state)[i], headings(state)[i], int(state["world_step"])

    def pair(z: complex) -> Array:
        return np.array([z.real, z.imag])

    def place(z: complex) -> tuple[float, Array]:
        away = (z - p) / h
        return abs(away), pair(away / abs(away)) if away else np.array([1.0, 0.0])

    fix = senses.fixes[i]
    known = fix.step >= 0
    target_range, target_bearing = place(fix.place) if known else (-1.0, np.zeros(2))
    values: dict[str, Any] = {
        "heading": pair(h),
        "position": pair(p),
        "speed": state["tracker_speed"][i],
        "turn_rate": state["tracker_turn_rate"][i],
        "touching": float((free_gaps(s, state)[i] <= TOUCHING).any()),
        "working": float(working(state)[i]),
        "formation": np.array([float(name == s.formation) for name in FORMATIONS]),
        "number": i,
        "team_size": s.num_trackers,
        "formation_distance": s.formation_distance,
        "formation_spacing": s.formation_spacing,
        "max_speed": s.tracker_speeds[i],
        "max_turn_rate": s.tracker_turn_rates[i],
        "acceleration_time": s.tracker_speeds[i] / s.tracker_acceleration,
        "turn_acceleration_time": s.tracker_turn_rates[i] / s.tracker_turn_acceleration,
        "tolerance": s.tolerance,
        "robot_radius": s.robot_radius,
        "control_step": s.control_step,
        "sensing_range": s.sensing_range if math.isfinite(s.sensing_range) else -1,
        "sonar_range": s.sonar_range,
        "arena": s.arena if math.isfinite(s.arena) else -1,
        "time_left": (s.horizon - step) * s.control_step,
        "target_known": float(known),
        "target_seen": float(senses.sees[i]),
        "target_age": (step - fix.step) * s.control_step if known else -1.0,
        "target_range": target_range,
        "target_bearing": target_bearing,
        "target_heading": pair(fix.heading / h) if known else np.zeros(2),
        "target_frame": pair(fix.frame / h) if known else np.zeros(2),
        "target_velocity": pair(fix.velocity / h) if known else np.zeros(2),
    }
    if s.sonar_beams:
        values["sonar"] = sonar(s, state, i)
        if s.sonar_beams == 1:
            values["sonar"] = values["sonar"][0]
    k, m = s.neighbours, s.message_size
    mates: dict[str, Array] = {
        "number": np.full(k, -1.0), "age": np.full(k, -1.0), "range": np.full(k, -1.0),
        "bearing": np.zeros((k, 2)), "heading": np.zeros((k, 2)),
        "speed": np.zeros(k), "turn_rate": np.zeros(k), "message": np.zeros((k, m)),
    }  # fmt: skip
    recent = [
        (abs(words.place - p), j, words)
        for (listener, j), words in senses.heard.items()
        if listener == i and (step - words.step) * s.control_step <= s.forget_after + 1e-6
    ]
    recent.sort(key=lambda found: found[:2])
    for spot, (_, j, words) in enumerate(_in_order(recent, told)[:k]):
        mates["number"][spot] = j
        mates["age"][spot] = (step - words.step) * s.control_step
        mates["range"][spot], mates["bearing"][spot] = place(words.place)
        mates["heading"][spot] = pair(words.heading / h)
        mates["speed"][spot], mates["turn_rate"][spot] = words.speed, words.turn_rate
        mates["message"][spot] = words.message
    if m == 0:
        del mates["message"]
    elif m == 1:
        mates["message"] = mates["message"][:, 0]
    values.update({f"neighbour_{name}": value for name, value in mates.items()})
    return {name: np.asarray(value, np.float64) for name, value in values.items()}


# ------------------------------------------------------------------------------------ score


def slots(s: posse.Scenario) -> Complexes:
    """Return the slots in the slot frame as x + iy, from their definition."""
    n, d, apart = s.num_trackers, s.formation_distance, s.formation_spacing
    if s.formation == "ring":
        radius = max(d, apart / (2 * math.sin(math.pi / n)) if n > 1 else d)
        return np.asarray(-radius * np.exp(2j * np.pi * np.arange(n) / n))
    if s.formation == "rows":
        wide = math.ceil(math.sqrt(n))
        places = []
        for k in range(n):
            row, column = divmod(k, wide)
            in_row = min(wide, n - row * wide)
            places.append(complex(-d - apart * row, apart * (column - (in_row - 1) / 2)))
        return np.array(places)
    wing = [-d + 0j]
    for k in range(1, n):
        arm = (k + 1) // 2 * apart
        wing.append(-d + arm * np.exp(1j * math.radians(135 if k % 2 else -135)))
    return np.array(wing)


@dataclass
class Episode:
    """Every metric of an episode, computed from its states."""

    scenario: posse.Scenario
    score: float = 0.0
    occupied: dict[int, int] = field(default_factory=dict)
    distance: Array = field(default_factory=lambda: np.zeros(0))
    progress: Array = field(default_factory=lambda: np.zeros(0))
    onsets: Array = field(default_factory=lambda: np.zeros(0))
    contacts: dict[str, int] = field(
        default_factory=lambda: {"tracker": 0, "obstacle": 0, "target": 0}
    )
    _start: Complexes | None = None
    _arrived: npt.NDArray[np.bool_] | None = None
    _touch: npt.NDArray[np.bool_] | None = None
    _touched: bool = False
    _lost_at: int | None = None
    _working: int = 0
    _held_from: int | None = None
    _settled_at: int | None = None
    _recovered_at: int | None = None
    _detected_at: int | None = None
    _least: float = math.inf
    _steps: int = 0
    _sums: dict[str, float] = field(default_factory=dict)

    def follow(self, state: State) -> None:
        """Process the state after the next step; the first one is the start of the episode."""
        s, n = self.scenario, self.scenario.num_trackers
        p, alive, step = positions(state), working(state), int(state["world_step"])
        first = self._start is None
        if self._start is None:
            self._start, self._arrived = p[:n].copy(), np.zeros(n, np.bool_)
            self._touch, self._working = np.zeros((n, n + 1 + s.num_obstacles + 4), np.bool_), n
        gaps = free_gaps(s, state)
        self._least = min(self._least, float(gaps.min()))
        self._count_contacts(gaps <= TOUCHING)
        frame = complex(state["world_frame_cos"], state["world_frame_sin"])
        places = p[n] + slots(s) * frame
        away = np.abs(p[:n, None] - places[None, :])
        near = (away <= s.tolerance) & (alive & ~(gaps <= TOUCHING).any(axis=1))[:, None]
        rows, columns = linear_sum_assignment(-near.astype(float))
        taken = {int(c) for r, c in zip(rows, columns, strict=True) if near[r, c]}
        self.occupied = {}
        for i in range(n):
            own = [c for c in range(n) if near[i, c] and c not in self.occupied.values()]
            if own:
                self.occupied[i] = own[0]
        assert set(self.occupied.values()) == taken, "which slots are taken does not depend on who"
        free = [c for c in range(n) if c not in taken]
        distance = np.array(
            [
                away[i, self.occupied[i]] if i in self.occupied
                else away[i, free].min() if free else away[i].min()
                for i in range(n)
            ]
        )  # fmt: skip
        self.progress = np.zeros(n) if first else self.distance - distance
        self.distance = distance
        sees = [can_see(s, state, i) for i in range(n)]
        if any(sees) and self._detected_at is None:
            self._detected_at = step
        count = int(alive.sum())
        if first:
            return
        self._steps += 1
        if count < self._working:
            self._working, self._held_from = count, None
            if self._lost_at is None:
                self._lost_at = step - 1
        self.score = min(1.0, len(taken) / count)
        if len(taken) < count:
            self._held_from = None
        elif self._held_from is None:
            self._held_from = step
        enough = max(1, round(s.settle_time / s.control_step))
        if self._held_from is not None and step - self._held_from + 1 >= enough:
            if self._settled_at is None:
                self._settled_at = self._held_from
            if self._lost_at is not None and self._recovered_at is None:
                self._recovered_at = self._held_from
        assert self._arrived is not None
        reach = np.array(s.tracker_speeds)[:, None] * step * s.control_step + s.tolerance
        could = (np.abs(self._start[:, None] - places[None, :]) <= reach).any(axis=1)
        self._arrived |= could & alive
        v = state["tracker_speed"].astype(np.float64) / s.tracker_speeds
        turn = state["tracker_turn_rate"].astype(np.float64) / s.tracker_turn_rates
        for name, value in (
            ("score", self.score),
            ("safe_score", 0.0 if self._touched else self.score),
            ("bound", (self._arrived & alive).sum() / count),
            ("error", distance[alive].sum()),
            ("effort", (v**2 + turn**2)[alive].sum()),
            ("sight", sum(sees)),
            ("tracker_steps", count),
            ("connected", self._connected(state)),
        ):
            self._sums[name] = self._sums.get(name, 0.0) + float(value)

    def _count_contacts(self, touch: npt.NDArray[np.bool_]) -> None:
        n = self.scenario.num_trackers
        assert self._touch is not None
        begun = touch & ~self._touch
        self._touch, self._touched = touch, self._touched or bool(touch.any())
        self.onsets = begun.sum(axis=1).astype(np.float64)
        self.contacts["tracker"] += int(begun[:, :n].sum()) // 2
        self.contacts["target"] += int(begun[:, n].sum())
        self.contacts["obstacle"] += int(begun[:, n + 1 :].sum())

    def _connected(self, state: State) -> bool:
        s = self.scenario
        members = np.flatnonzero(working(state))
        if len(members) < 2:
            return True
        p = positions(state)[members]
        can = np.array([radio_alive(s, state, i) for i in members.tolist()])
        links = (np.abs(p[:, None] - p[None, :]) <= s.radio_range) & can[:, None] & can[None, :]
        return bool(connected_components(links, directed=False)[0] == 1)

    def metrics(self) -> dict[str, float]:
        """Return every metric by name."""
        s, sums = self.scenario, self._sums

        def time(step: int | None) -> float:
            return math.nan if step is None else step * s.control_step

        recovery = math.nan
        if self._recovered_at is not None and self._lost_at is not None:
            recovery = (self._recovered_at - self._lost_at) * s.control_step
        return {
            "score": sums["score"] / self._steps,
            "safe_score": sums["safe_score"] / self._steps,
            "bound": sums["bound"] / self._steps,
            "detection_time": time(self._detected_at),
            "settling_time": time(self._settled_at),
            "recovery_time": recovery,
            "tracking_error": sums["error"] / sums["tracker_steps"],
            "time_in_sight": sums["sight"] / sums["tracker_steps"],
            "tracker_contacts": self.contacts["tracker"],
            "obstacle_contacts": self.contacts["obstacle"],
            "target_contacts": self.contacts["target"],
            "contact_free": float(not self._touched),
            "least_gap": self._least,
            "control_effort": sums["effort"] / sums["tracker_steps"],
            "time_connected": sums["connected"] / self._steps,
            "duration": self._steps * s.control_step,
        }


# ------------------------------------------------------------------------------------ recordings


@dataclass
class Recording:
    """An episode of one world: inputs and outputs of every step."""

    batch: posse.Batch
    states: list[State]
    actions: list[npt.NDArray[np.float32]]
    observations: list[npt.NDArray[np.float32]]
    rewards: list[npt.NDArray[np.float32]]
    infos: list[dict[str, Any]]

    @property
    def scenario(self) -> posse.Scenario:
        return self.batch.scenario


CASES: tuple[tuple[str, tuple[tuple[str, Any], ...]], ...] = (
    *((name, ()) for name in posse.scenario_names()),
    (
        "constant",
        (
            ("num_trackers", 12),
            ("num_neighbours", 3),
            ("message_size", 2),
            ("formation", "ring"),
            ("formation_spacing", 0.65),
        ),
    ),  # a ring so tight that trackers run into the target
    ("constant", (("num_trackers", 3), ("num_neighbours", 8), ("message_size", 1))),
    (
        "obstacles",
        (
            ("tracker_speed", (1.0, 0.8, 1.3, 0.7, 1.0)),
            ("tracker_turn_rate", (1.2, 2.0, 1.0, 1.5, 0.8)),
            ("tracker_acceleration", 2.0),
        ),
    ),  # no two trackers alike
    ("constant", (("num_trackers", 1),)),
    (
        "constant",
        (
            ("num_trackers", 26),
            ("num_neighbours", 5),
            ("formation", "ring"),
            ("message_size", 1),
        ),
    ),
    ("constant", (("breaks", 2), ("formation", "ring"), ("break_window", (0.2, 0.4)))),
    ("field", (("num_trackers", 9), ("num_neighbours", 3), ("message_size", 2))),
    ("field", (("breaks", 3), ("field_of_view", 2.0), ("forget_after", 0.35))),
    ("radio", (("num_trackers", 2), ("formation", "ring"), ("sonar_beams", 1))),
    ("radio", (("num_trackers", 7), ("formation", "rows"), ("sonar_beams", 0))),
)
"""Every scenario, and variants of settings, to be recorded and computed independently."""


def case_name(case: tuple[str, tuple[tuple[str, Any], ...]]) -> str:
    return "-".join([case[0], *(f"{key}={value}" for key, value in case[1])])


@functools.cache
def record(name: str, overrides: tuple[tuple[str, Any], ...] = (), steps: int = 160) -> Recording:
    """Return an episode in which the team moves roughly to its slots.

    Short, and from starts nearby, so that much happens: contacts, settling, breaks, recovery.
    """
    settings: dict[str, Any] = {
        "horizon": steps, "start_distance": (1.5, 5.0), "settle_time": 0.5, "outage_time": 3.0,
        **dict(overrides),
    }  # fmt: skip
    batch = posse.batch(name, 1, seed=8, **settings)
    s, n = batch.scenario, batch.scenario.num_trackers
    rng = np.random.default_rng(0)
    observations = [batch.reset()]
    states = [one_world(snapshot(batch), 0)]
    recording = Recording(batch, states, [], observations, [], [])
    for _ in range(steps):
        p, h = positions(states[-1]), headings(states[-1])
        frame = complex(states[-1]["world_frame_cos"], states[-1]["world_frame_sin"])
        away = (p[n] + slots(s) * frame - p[:n]) / h[:n]
        actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        bearing = np.angle(away)
        speed = 0.85 * s.target_speed + 0.8 * np.abs(away) * np.cos(bearing)
        actions[0, :n, 0] = np.clip(2 * speed / s.tracker_speed - 1, -1, 1)
        actions[0, :n, 1] = np.clip(2 * bearing / s.tracker_turn_rate, -1, 1)
        observed, rewards, _, _, infos = batch.step(actions)
        states.append(one_world(snapshot(batch), 0))
        recording.actions.append(actions[0])
        observations.append(observed)
        recording.rewards.append(rewards[0])
        recording.infos.append(infos)
    return recording
