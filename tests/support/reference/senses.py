"""Sight, fixes, sonar and radio."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.support.reference.state import Array, State, headings, obstacles, positions, working

import posse


def can_see(s: posse.Scenario, state: State, i: int) -> bool:
    """Return whether tracker i's sensor sees the target."""
    p, h = positions(state), headings(state)
    step, dead = int(state["world_step"]), int(state["tracker_sensor_dead_from"][i])
    offset, (centres, radii) = p[-1] - p[i], obstacles(state)
    along = np.clip(((centres - p[i]) * np.conj(offset)).real / abs(offset) ** 2, 0, 1)  # on the segment to the target
    return bool(
        working(state)[i]
        and not dead <= step < dead + round(s.outage_time / s.control_step)
        and abs(offset) <= s.sensing_range
        and abs(np.angle(offset / h[i])) <= s.field_of_view / 2
        and (np.abs(p[i] + along * offset - centres) >= radii).all()
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

    def newer(self, s: posse.Scenario, other: "Fix") -> "Fix":
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
    r = s.robot_radius
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
        if s.walled:
            for normal, half in zip((1, 1j, -1, -1j), s.half_sides * 2, strict=True):
                away = half - (p[i] * np.conj(normal)).real
                towards = (axis * np.conj(normal)).real
                if towards >= math.cos(math.pi / s.sonar_beams) - 1e-7:
                    found.append(away - r)
                elif towards > 1e-9 and away < s.sonar_range + r:
                    found.append(away / towards - r)
        readings[k] = max(0.0, min(found))
    return readings


_MASK = 2**64 - 1
_GOLDEN = 0x9E3779B97F4A7C15


def uniform(key: int, step: int, stream: int, index: int) -> float:
    """Return the engine's uniform draw, from the definition of SplitMix64's finalizer."""
    for value in (step, stream, index):
        z = ((key + _GOLDEN) & _MASK) ^ (value * _GOLDEN & _MASK)
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & _MASK
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB & _MASK
        key = z ^ (z >> 31)
    return (key >> 40) / 2**24


def normal_pair(key: int, step: int, stream: int, index: int) -> tuple[float, float]:
    """Return the engine's pair of normal draws, cut at radius 3."""
    u = uniform(key, step, stream, 2 * index)
    angle = 2 * math.pi * uniform(key, step, stream, 2 * index + 1)
    cut = math.exp(-4.5)
    radius = math.sqrt(-2 * math.log(cut + (1 - cut) * u))
    return radius * math.cos(angle), radius * math.sin(angle)
