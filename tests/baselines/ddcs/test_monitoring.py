"""Monitoring: the estimate of the target, and received messages."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import begin, load


@pytest.mark.parametrize(
    ("scenario", "settings", "delayed", "share"),
    [
        # Late fixes are extrapolated to the present.
        ("accelerating", {"radio_delay": 8, "sensing_range": 2.5, "start_distance": (2.0, 3.0)}, True, 0.3),
        # Noise is filtered.
        ("constant", {"range_noise": 0.03, "bearing_noise": 0.03, "velocity_smoothing": 0.5}, False, 0.8),
    ],
)
def test_the_estimate_is_nearer_to_the_target_than_the_fix(
    scenario: str, settings: dict[str, Any], delayed: bool, share: float
) -> None:
    policy = load("ddcs-distributed")
    batch = posse.batch(scenario, 20, message_size=5, autoreset="disabled", split="train", **settings)
    observations, memory, estimated, fixed = batch.reset(), begin(policy, batch), [], []
    for step in range(150):
        v, state = batch.layout.views(observations.copy()), {k: a.copy() for k, a in batch.state.items()}
        actions, memory = policy.act(observations, memory)
        target = (state["world_x"] + 1j * state["world_y"])[:, None]
        counts = (v["target_age"] > 0.5) & (v["target_age"] < 1.5) if delayed else v["target_known"] > 0
        if step > 50:
            x, y = np.moveaxis(policy.annotations(memory)["estimate"][..., :2], -1, 0)
            position, heading, bearing = (
                v[name][..., 0] + 1j * v[name][..., 1] for name in ("position", "heading", "target_bearing")
            )
            estimated.append(np.abs(x + 1j * y - target)[counts])
            fixed.append(np.abs(position + v["target_range"] * bearing * heading - target)[counts])
        observations, *_ = batch.step(actions)
    assert np.concatenate(fixed).size > 100
    assert np.concatenate(estimated).mean() < share * np.concatenate(fixed).mean()


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
