"""The events of a timeline agree with the engine's counts."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import posse
from posse_baselines import Recorder, load
from posse_training.evaluation.evaluation import evaluate
from posse_training.replay import RECORD, Player, record, replay_of
from posse_training.replay.episode import EVENT_KINDS
from posse_training.replay.events import find_events


def contacts_by_hand() -> Player:
    """Two trackers run into each other, part, and one runs into the target."""
    batch = posse.batch("constant", 1, num_trackers=2, target_motion="agent", horizon=80)
    recorder = Recorder(batch, RECORD)
    start = {"tracker_pose": [(0, 0, 0), (1, 0, np.pi)], "target_pose": (-3, 0, 0)}
    recorder.reset(options=start)
    still, ahead, right_about = [-1, 0], [1, 0], [-1, 1]
    for speed, turn, steps in ((ahead, ahead, 8), (right_about, still, 16), (ahead, still, 40)):
        for _ in range(steps):
            recorder.step(np.array([[speed, turn, still]], np.float32))
    return replay_of(recorder.trajectory(), "a").players[0]


def test_contacts_are_told_with_who_touched_what() -> None:
    player = contacts_by_hand()
    found = [event for event in player.events if event.kind == "contact"]
    assert [(event.robots, event.text) for event in found] == [
        ((0, 1), "contact: tracker 0 and tracker 1, with each other"),
        ((0,), "contact: tracker 0, with the target"),
    ]
    onsets = player.columns["tracker_onsets"].values
    assert [event.step for event in found] == np.flatnonzero(onsets.any(axis=1)).tolist()
    kinds = ("tracker_contacts", "obstacle_contacts", "target_contacts")
    assert [player.metrics[kind] for kind in kinds] == [1, 0, 1]


def test_ticks_agree_with_the_metrics() -> None:
    policy = load("ddcs-distributed")
    results = evaluate(policy, "leader-loss", 6, seed=4, progress=False)
    for world in range(6):
        player = record([policy], "leader-loss", seed=4, world=world).players[0]
        counts = Counter(event.kind for event in player.events)
        assert set(counts) <= set(EVENT_KINDS)
        assert counts["leader"] == np.nan_to_num(results["leader_exchanges"][world])
        assert counts["break"] == 1
        broken = next(event for event in player.events if event.kind == "break")
        column = player.columns["tracker_broken"].values[:, broken.robots[0]]
        assert column[broken.step] == 1
        assert column[broken.step - 1] == 0
        times = {
            kind: [event.step * 0.1 for event in player.events if event.kind == kind]
            for kind in ("detection", "settled")
        }
        assert times["detection"] == pytest.approx([results["detection_time"][world]])
        settled = results["settling_time"][world]
        assert times["settled"][:1] == pytest.approx([settled] if np.isfinite(settled) else [])
        assert [e.step for e in player.events] == sorted(e.step for e in player.events)


def test_a_leader_is_whom_more_than_half_follow_and_a_dart_begins_once() -> None:
    frames, n = 6, 4
    states = {
        "world_pressed": np.array([0, 0, -1, -1, 0, 0]),
        "world_step": np.arange(frames),
        "tracker_onsets": np.zeros((frames, n)),
        "tracker_broken_at": np.full((frames, n), 1000),
        **{f"world_{k}_at": np.full(frames, -1) for k in ("detected", "settled", "recovered")},
        **{f"world_contacts_{k}": np.zeros(frames) for k in ("tracker", "obstacle", "target")},
    }
    leader = np.array([[-1, -1, -1, -1], [2, 2, 2, 0], [2, 2, 0, 0], [0, 0, 0, 2], [0, 0, 0, 0], [2, 2, 2, 2]])
    events = find_events({**states, "annotation/leader": leader})
    found = [(event.step, event.kind, event.robots) for event in events]
    assert found == [(2, "dart", ()), (3, "leader", (2, 0)), (5, "leader", (0, 2))]
    assert [event.kind for event in find_events(states)] == ["dart"]
