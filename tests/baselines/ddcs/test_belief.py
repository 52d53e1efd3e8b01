"""The belief that a network reads: recomputed from the memory and the observation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.belief import (
    BELIEF_SIZE,
    LOOKS,
    LOOKS_AT,
    MATES,
    MATES_AT,
    SEARCH_AT,
    SLOT_AT,
    TARGET_AT,
    TASK_AT,
)
from posse_baselines.ddcs.memory import GRID
from posse_baselines.ddcs.settings import SEARCHING


def soft(x: float, y: float, scale: float) -> list[float]:
    d = math.hypot(x, y)
    return [x / (d + scale), y / (d + scale)]


def expected(batch: posse.Batch, ddcs: DDCS, memory: Any, o: Any, e: int, i: int) -> Any:
    """Recompute a belief in float64 from the memory's fields and an observation."""
    at, dt = batch.layout.offsets, batch.scenario.control_step
    d = {name: memory.minds[name][e, i].item() for name in memory.minds.dtype.names}
    x, y, c, s = o[at["position"]], o[at["position"] + 1], o[at["heading"]], o[at["heading"] + 1]

    def own(vx: float, vy: float) -> tuple[float, float]:
        return vx * c + vy * s, vy * c - vx * s

    b = np.zeros(BELIEF_SIZE)
    if d["known"]:
        b[TARGET_AT : TARGET_AT + 9] = [
            1.0,
            *soft(*own(d["target_x"] - x, d["target_y"] - y), 3.0),
            *own(d["target_vx"], d["target_vy"]),
            *own(d["frame_cos"], d["frame_sin"]),
            d["psi_rate"],
            d["fix_age"] / (d["fix_age"] + 1.0),
        ]
    b[TASK_AT + d["task"]] = 1.0
    if d["slot"] >= 0:
        slot = memory.team.slots[d["slot"]]
        arm = complex(slot.x, slot.y) * complex(d["frame_cos"], d["frame_sin"])
        to = own(d["target_x"] + arm.real - x, d["target_y"] + arm.imag - y)
        speed = complex(d["target_vx"], d["target_vy"]) + 1j * d["psi_rate"] * arm
        b[SLOT_AT : SLOT_AT + 7] = [1.0, *soft(*to, 0.3), *soft(*to, 3.0), *own(speed.real, speed.imag)]
    if d["task"] == SEARCHING:
        lost = (d["step"] - max(0, d["lost_step"])) * dt
        b[SEARCH_AT] = lost / (lost + 10.0)
        if d["goal_step"] >= 0:
            b[SEARCH_AT + 1 : SEARCH_AT + 3] = soft(*own(d["goal_x"] - x, d["goal_y"] - y), 3.0)
    settings = memory.team.settings[0]
    patience = min(settings.lost_after, settings.least_patience + 2.0 * d["usual_gap"])
    around = []
    for j, mate in enumerate(memory.mates[e, i]):
        age = (d["step"] - mate.step) * dt
        # The policy compares in float32, and both are often equal.
        if j != i and mate.step >= 0 and age <= patience - 1e-4:
            around.append(own(mate.x + age * mate.speed_x - x, mate.y + age * mate.speed_y - y))
    b[MATES_AT] = len(around) / (len(memory.mates[e, i]) - 1)
    around.sort(key=lambda way: math.hypot(*way))
    for k, way in enumerate(around[:MATES]):
        b[MATES_AT + 1 + 2 * k : MATES_AT + 3 + 2 * k] = soft(*way, 1.0)
    half = batch.scenario.arena / 2
    cell = 2.0 * half / GRID
    for k in range(LOOKS):
        angle = math.atan2(s, c) + 2.0 * math.pi * k / LOOKS
        reach = batch.scenario.sensing_range
        column = math.floor((x + reach * math.cos(angle) + half) / cell)
        row = math.floor((y + reach * math.sin(angle) + half) / cell)
        if 0 <= column < GRID and 0 <= row < GRID:
            looked = int(memory.seen[e, i, column * GRID + row]) - 1
            age = (d["step"] - looked) * dt if looked >= 0 else math.inf
            b[LOOKS_AT + k] = min(1.0, age / settings.stale_after)
    return b


@pytest.mark.parametrize("scenario", ["search", "field"])
def test_a_belief_is_what_the_memory_holds(scenario: str) -> None:
    ddcs = DDCS()
    batch = posse.batch(scenario, 3, message_size=ddcs.message_size, autoreset="disabled")
    observations = batch.reset(seed=2)
    memory = ddcs.begin(batch.layout, 3)
    seen: list[Any] = []
    for step in range(240):
        _, memory = ddcs.propose(observations, memory)
        beliefs = ddcs.belief(observations, memory)
        assert beliefs.shape == (3, 5, ddcs.belief_size)
        if step % 20 == 0:
            for e in range(3):
                for i in range(5):
                    wanted = expected(batch, ddcs, memory, observations[e, i], e, i)
                    np.testing.assert_allclose(beliefs[e, i], wanted, rtol=1e-4, atol=2e-4)
                    seen.append(wanted)
        actions, memory = ddcs.carry_out(observations, memory, np.zeros((3, 5, 2), np.float32))
        observations = batch.step(actions)[0]
    # The worlds were such that every part of a belief was in use.
    assert (np.ptp(np.array(seen), axis=0) > 0).sum() > BELIEF_SIZE - 4
