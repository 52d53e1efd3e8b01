"""Monitoring: the estimate of the target, and received messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import posse
from posse_baselines import begin, load


@dataclass(frozen=True)
class Seen:
    """A step: the team's observations and annotations."""

    views: dict[str, Any]
    notes: dict[str, Any]
    state: dict[str, Any]


def watch(scenario: str, worlds: int, steps: int, **settings: Any) -> Iterator[Seen]:
    policy = load("ddcs-distributed")
    batch = posse.batch(scenario, worlds, message_size=5, autoreset="disabled", **settings)
    observations, memory = batch.reset(), begin(policy, batch)
    for _ in range(steps):
        actions, memory = policy.act(observations, memory)
        state = {name: array.copy() for name, array in batch.state.items()}
        yield Seen(batch.layout.views(observations), policy.annotations(memory), state)
        observations, *_ = batch.step(actions)


def estimate_error(seen: Seen) -> Any:
    x, y = seen.notes["estimate"][..., 0], seen.notes["estimate"][..., 1]
    return np.hypot(x - seen.state["world_x"][:, None], y - seen.state["world_y"][:, None])


def fix_error(seen: Seen) -> Any:
    """Distance of the observed fix from the target's current position."""
    v = seen.views
    c, s = v["heading"][..., 0], v["heading"][..., 1]
    bx, by = v["target_bearing"][..., 0], v["target_bearing"][..., 1]
    x = v["position"][..., 0] + v["target_range"] * (bx * c - by * s)
    y = v["position"][..., 1] + v["target_range"] * (bx * s + by * c)
    return np.hypot(x - seen.state["world_x"][:, None], y - seen.state["world_y"][:, None])


def test_late_fixes_are_carried_on_to_the_present() -> None:
    settings: dict[str, Any] = {"radio_delay": 8, "sensing_range": 2.5, "start_distance": (2.0, 3.0)}
    late, raw = [], []
    for k, seen in enumerate(watch("accelerating", 20, 150, split="train", **settings)):
        mask = (seen.views["target_age"] > 0.5) & (seen.views["target_age"] < 1.5)
        if k > 30:
            late.append(estimate_error(seen)[mask])
            raw.append(fix_error(seen)[mask])
    assert np.concatenate(late).size > 100
    assert np.concatenate(late).mean() < 0.3 * np.concatenate(raw).mean()


def test_noise_is_filtered() -> None:
    noise: dict[str, Any] = {"range_noise": 0.03, "bearing_noise": 0.03, "velocity_smoothing": 0.5}
    kept, raw = [], []
    for k, seen in enumerate(watch("constant", 20, 150, split="train", **noise)):
        if k > 50:
            kept.append(estimate_error(seen).mean())
            raw.append(fix_error(seen).mean())
    assert np.mean(kept) < 0.8 * np.mean(raw)


def test_without_radio_nothing_heard_has_an_effect() -> None:
    policy = load("ddcs-no-radio")
    batch = posse.batch("field", 4, message_size=5)
    observations = batch.reset()
    plain, deaf = begin(policy, batch), begin(policy, batch)
    for _ in range(80):
        alone = observations.copy()
        views = batch.layout.views(alone)
        for name in ("neighbour_number", "neighbour_age", "neighbour_range"):
            views[name][...] = -1.0
        heard = views["target_seen"] == 0
        views["target_known"][heard] = 0.0
        actions, plain = policy.act(observations, plain)
        without, deaf = policy.act(alone, deaf)
        np.testing.assert_array_equal(actions, without)
        observations, *_ = batch.step(actions)
