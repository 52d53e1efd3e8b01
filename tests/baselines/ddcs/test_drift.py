"""Robots whose own poses drift apart: the team aligns their frames by the target that all of them see."""

from __future__ import annotations

import posse
from posse_baselines import load, play


def test_drifting_poses_cost_the_baseline_hardly_anything() -> None:
    policy = load("pngl-l-phi")
    drifting = posse.get_scenario("constant", odometry_drift=0.05, heading_drift=0.01)
    batch = posse.batch(drifting, 60, split="train", message_size=policy.message_size)
    metrics = play(batch, policy)
    assert metrics["safe_score"].mean() >= 0.75
    assert (metrics["contact_free"] == 0).mean() <= 0.02
