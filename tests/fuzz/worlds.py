"""Scenarios drawn over every setting, with teams that chase and crowd, judged in float64.

Run it for as long as you like::

    python -m tests.fuzz.worlds --minutes 30 --seed 1

A case is a scenario and a team. After each step no disc is inside another or a wall, no robot has
moved or turned faster than it can, every observation lies within its bounds and every number is
finite. A
scenario that is not possible is refused by a ScenarioError.
"""

from __future__ import annotations

import dataclasses
import math
import random
from typing import Any

import numpy as np
from tests.fuzz.campaign import main
from tests.support.crowding import TOLERANCE, Team, depth, headings, points

import posse
from posse.scenarios import Setting

WORLDS, STEPS, DRAWS = 24, 60, 50
ROUNDING = 1e-3
"""m that a robot may seem to have moved too far: float32 at up to 2,000 m."""
WEIGHTS = ("reward_weights", "target_reward_weights")
NOT_DRAWN = ("name", "meaning", "version", "extra_fields", "metrics", *WEIGHTS)
"""Settings without a range: names, what a user's module declares, and those drawn apart."""
ALL_TERMS = tuple(term.name for term in posse.REWARD_TERMS)
BROADEN = 2.0
"""Numbers are drawn up to so many powers of two from their default."""


def drawn(rng: random.Random, setting: Setting, default: Any, trackers: int) -> Any:
    """Return a value of a setting, mostly one that is possible in a team of so many."""
    if "None" in setting.kind and rng.random() < 0.2:
        return None
    if setting.per_tracker and rng.random() < 0.3:
        each = dataclasses.replace(setting, kind="float")
        about = default[0] if isinstance(default, tuple) else default
        return tuple(drawn(rng, each, about, trackers) for _ in range(trackers))
    if setting.choices is not None:
        return rng.choice(tuple(setting.choices()))
    if setting.kind == "bool":
        return rng.random() < 0.5
    if setting.kind.startswith("int"):
        most = int(min(setting.high, max(12, 2 * (default or 0))))
        return rng.randint(int(setting.low), most)
    if setting.kind == "tuple[float, float]":
        scale = 2 ** rng.uniform(-BROADEN, BROADEN)
        return tuple(sorted(min(setting.high, end * scale) for end in default))
    if setting.kind.startswith("float"):
        if setting.infinite and rng.random() < 0.2:
            return math.inf
        if setting.low == 0 and not setting.above and rng.random() < 0.2:
            return 0.0
        about = default if isinstance(default, float) and 0 < default < math.inf else 1.0
        high = min(setting.high, about * 2**BROADEN)
        return min(max(about * 2 ** rng.uniform(-BROADEN, BROADEN), setting.low), high)
    return default


def scenario(rng: random.Random) -> posse.Scenario | None:
    """Return a named scenario with some settings drawn anew, or None if none was possible."""
    for _ in range(DRAWS):
        base = posse.get_scenario(rng.choice(posse.scenario_names()))
        share = rng.choice((0.1, 0.3))
        declared = base.settings()
        changes = {
            name: drawn(rng, declared[name], getattr(base, name), base.num_trackers)
            for name in declared
            if name not in NOT_DRAWN and rng.random() < share
        }
        trackers = changes.get("num_trackers", base.num_trackers)
        for name in [name for name in changes if declared[name].per_tracker]:
            changes[name] = drawn(rng, declared[name], getattr(base, name), trackers)
        changes.pop("control_step", None)
        if changes.pop("physics_step", None) is not None:
            # Together: the one has to be a multiple of the other.
            step = base.physics_step * 2 ** rng.uniform(-BROADEN, 1)
            changes |= {"physics_step": step, "control_step": step * rng.randint(1, 4)}
        for name in WEIGHTS:
            if rng.random() < share:
                terms = ("contact", "effort", "team") if name == WEIGHTS[1] else ALL_TERMS
                chosen = [term for term in terms if rng.random() < 0.5]
                changes[name] = {term: rng.uniform(-10, 10) for term in chosen}
        try:
            return base.replace(**changes)
        except posse.ScenarioError:
            continue
    return None


def case(seed: int, number: int) -> None:
    """Play one scenario with one team."""
    rng = random.Random(f"{seed} {number}")
    s = scenario(rng)
    if s is None:
        return
    batch = posse.Batch(s, WORLDS, seed=rng.randrange(2**63), num_threads=1)
    low, high = (bound.astype(np.float64) for bound in batch.layout.bounds())
    try:
        observations = batch.reset()
    except posse.ScenarioError:  # too tight
        return
    _judge_observations(observations, low, high)
    team = Team(batch, number, crowds=rng.random() < 0.5, stays=rng.choice((4.0, 10.0)), leaves=rng.choice((0.0, 4.0)))
    reach = np.array([*s.tracker_speeds, s.target_speed]) * s.control_step
    turn = np.array([*s.tracker_turn_rates, s.target_turn_rate]) * s.control_step
    for _ in range(STEPS):
        before, headed = _robots(batch), _headings(batch)
        observations, rewards = team.play()
        _judge_observations(observations, low, high)
        assert np.isfinite(rewards).all()
        assert ((batch.score >= 0) & (batch.score <= 1)).all()
        assert depth(batch).max() <= TOLERANCE, f"{depth(batch).max()} m inside: {s}"
        on = batch.state["world_step"] > 0
        moved = np.abs(_robots(batch) - before)[on]
        assert (moved <= reach + ROUNDING).all(), f"{(moved - reach).max()} m too far: {s}"
        assert np.abs(np.abs(_headings(batch)) - 1).max() <= ROUNDING, "headings are no directions"
        turned = np.abs(np.angle(_headings(batch) / headed))[on]
        assert (turned <= turn + ROUNDING).all(), f"{(turned - turn).max()} rad too far: {s}"
    for name, array in batch.state.items():
        if array.dtype.kind == "f" and name.endswith(("_x", "_y")):
            assert np.isfinite(array).all(), name


def _robots(batch: posse.Batch) -> Any:
    return np.concatenate([points(batch, "tracker"), points(batch, "world")[:, None]], axis=1)


def _headings(batch: posse.Batch) -> Any:
    return np.concatenate([headings(batch, "tracker"), headings(batch, "world")[:, None]], axis=1)


def _judge_observations(observations: Any, low: Any, high: Any) -> None:
    wide = observations.astype(np.float64)
    assert np.isfinite(wide).all()
    bad = (wide < low) | (wide > high)
    assert not bad.any(), f"out of bounds at {np.argwhere(bad)[0]}"


if __name__ == "__main__":
    main(__doc__, case)
