"""A belief, from a memory of drawn contents."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

belief = plain("ddcs.belief")


def soft(way: complex, scale: float) -> list[float]:
    way /= abs(way) + scale
    return [way.real, way.imag]


def expected(m: Mind, at: complex, facing: complex, heard: list[int]) -> Any:
    d, b = m.d, np.zeros(38)
    target = complex(d.now_x, d.now_y)
    velocity, frame = complex(d.speed_x, d.speed_y), complex(d.frame_cos, d.frame_sin)
    if d.known:
        own = velocity / facing
        b[0:9] = [
            1,
            *soft((target - at) / facing, 3.0),
            own.real,
            own.imag,
            (frame / facing).real,
            (frame / facing).imag,
            d.psi_rate,
            d.age / (d.age + 1),
        ]
    b[9 + d.task] = 1
    if d.slot >= 0:
        arm = m.slot(d.slot) * frame
        way, own = (target + arm - at) / facing, (velocity + 1j * d.psi_rate * arm) / facing
        b[13:20] = [1, *soft(way, 0.3), *soft(way, 3.0), own.real, own.imag]
    if d.task == 0:
        lost = 0.1 * (d.step - max(0, d.lost_step))
        b[20] = lost / (lost + 10)
        if d.goal_step >= 0:
            b[21:23] = soft((complex(d.goal_x, d.goal_y) - at) / facing, 3.0)
    b[23] = len(heard) / 4
    ways = []
    for j in heard:
        mate = m.mates[j]
        age = 0.1 * (d.step - mate.step)
        ways.append((complex(mate.x, mate.y) + age * complex(mate.speed_x, mate.speed_y) - at) / facing)
    for k, way in enumerate(sorted(ways, key=abs)[:3]):
        b[24 + 2 * k : 26 + 2 * k] = soft(way, 1.0)
    for k in range(8):
        there = at + m.f.sight * facing * turn(k * math.pi / 4) - complex(d.area_x, d.area_y)
        i, j = (math.floor((v + m.f.area) / (2 * m.f.area) * 16) for v in (there.real, there.imag))
        if 0 <= i < 16 and 0 <= j < 16:
            looked = int(m.seen[i * 16 + j]) - 1
            b[30 + k] = min(1.0, 0.1 * (d.step - looked) / 30.0) if looked >= 0 else 1.0
    return b


@pytest.mark.parametrize("seed", range(16))
def test_a_belief_is_what_the_memory_holds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = Mind("field", own=int(rng.integers(5)))
    d = m.d
    d.step, d.psi_rate, d.age = 120, rng.normal(), rng.uniform(0, 3)
    m.target(complex(*rng.normal(0, 4, 2)), complex(*rng.normal(0, 0.5, 2)), rng.uniform(-3, 3))
    d.known = seed % 2
    d.task, d.slot = seed % 4, rng.integers(-1, 5)
    d.lost_step, d.goal_step = rng.choice([-1, 0, 40]), rng.choice([-1, 0, 70])
    d.goal_x, d.goal_y = rng.normal(0, 4, 2)
    d.area_x, d.area_y = rng.normal(0, 1, 2)
    m.seen[:] = rng.integers(0, 120, 256) * (rng.random(256) < 0.8)
    heard = [j for j in range(5) if j != m.own and rng.random() < 0.7]
    for j in range(5):
        if j != m.own:
            m.mate(j, complex(*rng.normal(0, 3, 2)), complex(*rng.normal(0, 1, 2)), step=118 if j in heard else 30)
    at, facing = complex(*rng.normal(0, 6, 2)), turn(rng.uniform(-3, 3))
    m.stand(at, cmath.phase(facing))
    out = np.full(belief.BELIEF_SIZE, 9.0, np.float32)
    belief.write_belief(m.f, m.s, m.slots, d, m.mates, m.seen, m.o, out)
    np.testing.assert_allclose(out, expected(m, at, facing, heard), atol=2e-5)


def test_equally_near_ones_are_listed_once_each() -> None:
    m = Mind("field", own=2)
    m.d.step = 10
    for j, place in ((0, 0.5j), (1, -1j), (3, 1 + 0j), (4, 2 + 0j)):
        m.mate(j, place)
    m.stand(0j, 0.0)
    out = np.zeros(belief.BELIEF_SIZE, np.float32)
    belief.write_belief(m.f, m.s, m.slots, m.d, m.mates, np.zeros(0, np.uint16), m.o, out)
    np.testing.assert_allclose(out[23:30], [1, 0, 1 / 3, 0, -0.5, 0.5, 0], rtol=1e-6)
    assert (out[30:] == 0).all()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_the_share_of_a_small_team_is_of_the_others(size: int) -> None:
    m = Mind("field", own=0, num_trackers=size, breaks=0)
    for j in range(1, size):
        m.mate(j, complex(j, 0))
    out = np.zeros(belief.BELIEF_SIZE, np.float32)
    belief.write_belief(m.f, m.s, m.slots, m.d, m.mates, m.seen, m.o, out)
    assert out[23] == (1 if size > 1 else 0)


def test_the_beliefs_of_all_worlds_are_written() -> None:
    m = Mind("field")
    observations = np.tile(m.o, (2, 5, 1))
    for e in range(2):
        for i in range(5):
            m.stand(complex(e, i), 0.3 * i)
            m.fill(number=i)
            observations[e, i] = m.o
    memory = m.policy.begin(m.layout, 2)
    memory.minds["task"], memory.minds["slot"] = [[1, 2, 1, 2, 0], [2, 1, 3, 1, 1]], 2
    beliefs = m.policy.belief(observations, memory)
    assert beliefs.shape == (2, 5, m.policy.belief_size)
    for e in range(2):
        for i in range(5):
            out = np.zeros(belief.BELIEF_SIZE, np.float32)
            belief.write_belief(
                m.f, m.s, m.slots, memory.minds[e, i], memory.mates[e, i], memory.seen[e, i], observations[e, i], out
            )
            np.testing.assert_array_equal(beliefs[e, i], out)
            assert out.any()
