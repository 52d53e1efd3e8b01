"""Every metric against an independent computation from the states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.adapters import part
from tests.support.reference.recordings import CASES, case_name, record
from tests.support.reference.score import Episode

import posse


@pytest.mark.parametrize("case", CASES, ids=case_name)
def test_every_metric_equals_an_independent_working(case: Any) -> None:
    recording = record(*case)
    episode = Episode(recording.scenario)
    for state in recording.states:
        episode.follow(state)
    expected = episode.metrics()
    reported = part(recording.infos[-1], "metrics/")
    assert list(reported) == [metric.name for metric in posse.METRICS]
    assert set(expected) == set(reported)
    for name, value in expected.items():
        assert reported[name].shape == (1,)
        assert float(reported[name][0]) == pytest.approx(value, rel=1e-4, abs=1e-3, nan_ok=True), name


def test_the_recordings_show_what_they_should() -> None:
    """Else the comparison above compares nothing."""
    seen: dict[str, list[float]] = {metric.name: [] for metric in posse.METRICS}
    for case in CASES:
        for name, value in part(record(*case).infos[-1], "metrics/").items():
            seen[name].append(float(value[0]))
    for name in ("settling_time", "recovery_time"):
        assert any(math.isfinite(value) for value in seen[name]), name
        assert any(math.isnan(value) for value in seen[name]), name
    for name in ("tracker_contacts", "obstacle_contacts", "target_contacts"):
        assert max(seen[name]) > 0, name
    for name in ("time_in_sight", "time_connected", "score", "bound", "contact_free"):
        assert max(seen[name]) > 0, name
        assert min(seen[name]) < 1, name
    pairs = list(zip(seen["safe_score"], seen["score"], strict=True))
    assert any(0 < safe < score for safe, score in pairs), "contact in mid-episode"
    assert any(0 < safe == score for safe, score in pairs), "no contact"


def test_detection_is_when_the_target_first_came_into_sight() -> None:
    batch = posse.batch(num_trackers=2, sensing_range=3.0, target_speed=0.0, horizon=40)
    batch.reset(options={"target_pose": [0, 0, 0], "tracker_pose": [[4.05, 0, np.pi], [8, 0, 0]]})
    for _ in range(39):
        batch.step([[[1.0, 0.0], [-1.0, 0.0]]])
    assert batch.metrics()["detection_time"][0] == pytest.approx(1.1)


def test_metrics_arrive_when_episodes_end_and_say_for_which() -> None:
    batch = posse.batch(num_worlds=3, horizon=5, settle_time=0.2)
    batch.reset(seed=0)
    batch.step(np.zeros(batch.action_shape))
    batch.reset(options={"reset_mask": np.array([False, True, False])})
    for step in range(2, 6):
        infos = batch.step(np.zeros(batch.action_shape))[-1]
        ended = infos["metrics/duration"] > 0
        assert ended.tolist() == [step == 5, False, step == 5]
    np.testing.assert_allclose(infos["metrics/duration"][[0, 2]], 0.5)
