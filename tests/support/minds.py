"""One tracker's memory and observation, made by hand."""

from __future__ import annotations

import cmath
import math
from functools import cache
from typing import Any

import numpy as np
from tests.support.plain import plain

import posse


@cache
def layout_of(scenario: str, **settings: Any) -> posse.ObservationLayout:
    return posse.batch(scenario, 1, **{"message_size": 5, **settings}).layout


def turn(angle: float) -> complex:
    return cmath.exp(1j * angle)


class Mind:
    """A tracker: ``f`` offsets, ``s`` settings, ``d`` its memory, ``mates``, ``slots``, ``o``."""

    def __init__(
        self, scenario: str = "field", own: int = 1, played: dict[str, Any] | None = None, **world: Any
    ) -> None:
        self.layout, self.own = layout_of(scenario, **world), own
        settings = plain("ddcs.settings").Settings(**(played or {}))
        self.policy = plain("ddcs.policy").DDCS(settings)
        self.memory = self.policy.begin(self.layout, 1)
        m = self.memory
        self.f, self.s, self.slots = m.offsets[0], m.settings[0], m.slots
        self.d, self.mates, self.seen = m.minds[0, own], m.mates[0, own], m.seen[0, own]
        self.o = np.zeros(self.layout.size, np.float32)
        self.n = len(self.mates)
        self.fill(number=own, max_speed=1.0, max_turn_rate=2.0, heading=turn(0.0))
        self.fill(target_known=0, target_seen=0)
        self.o[self.f.sonar : self.f.sonar + self.f.sonar_beams] = self.f.sonar_range
        for p in range(self.f.neighbours):
            self.o[self.f.neighbour_number + p * self.f.stride] = -1

    def fill(self, place: int = 0, **values: Any) -> None:
        """Write fields of the observation; a complex number fills two."""
        for name, value in values.items():
            k = getattr(self.f, name) + (place * self.f.stride if "neighbour" in name else 0)
            self.o[k] = value.real
            if isinstance(value, complex):
                self.o[k + 1] = value.imag

    def stand(self, position: complex, heading: float) -> None:
        self.fill(position=position, heading=turn(heading))

    def mate(self, j: int, position: complex, velocity: complex = 0j, **values: Any) -> Any:
        """A team-mate as it was last heard, just now unless ``step`` is given."""
        mate = self.mates[j]
        mate.step, mate.fresh = self.d.step, 0
        mate.x, mate.y = position.real, position.imag
        mate.speed_x, mate.speed_y = velocity.real, velocity.imag
        direction = turn(cmath.phase(velocity))
        mate.heading_cos, mate.heading_sin = direction.real, direction.imag
        for name, value in values.items():
            setattr(mate, name, value)
        return mate

    def target(self, position: complex, velocity: complex = 0j, psi: float = 0.0, **values: Any) -> None:
        """The estimate of the target, known now."""
        d = self.d
        d.known, d.now_x, d.now_y = 1, position.real, position.imag
        d.speed_x, d.speed_y, d.speed = velocity.real, velocity.imag, abs(velocity)
        d.mean_x, d.mean_y = velocity.real, velocity.imag
        d.now_theta = cmath.phase(velocity)
        d.frame_cos, d.frame_sin = math.cos(psi), math.sin(psi)
        for name, value in values.items():
            setattr(d, name, value)

    def slot(self, k: int) -> complex:
        return complex(self.slots[k].x, self.slots[k].y)

    def body(self, position: complex = 0j, heading: float = 0.0, **values: Any) -> Any:
        """A robot without limits of acceleration, at its place in the observation."""
        self.stand(position, heading)
        body = np.zeros(1, plain("laws.heading").BODY)[0]
        values = {"max_speed": 1.0, "max_omega": 2.0, "dt": float(self.f.dt), **values}
        values = {"acceleration": 1e4, "turn_acceleration": 1e4, **values}
        values |= {"heading_cos": math.cos(heading), "heading_sin": math.sin(heading)}
        for name, value in values.items():
            setattr(body, name, value)
        return body
