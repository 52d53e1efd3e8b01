"""Slots that are occupied; the score of random worlds is in test_random_worlds, the metrics in signals."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.reference.score import slots
from tests.support.reference.state import one_world, positions, snapshot

import posse

FOLLOW = np.tile([2 * 0.6 - 1, 0.0], (1, 5, 1))
"""The actions that keep the target's speed."""


def in_place(batch: posse.Batch, **poses: complex) -> None:
    """Start a team in its slots, heading like the target along x, with some exceptions."""
    places = slots(batch.scenario)
    for name, place in poses.items():
        places[int(name.removeprefix("tracker_"))] = place
    batch.reset(options={"target_pose": [0.0, 0.0, 0.0], "tracker_pose": [[p.real, p.imag, 0.0] for p in places]})


@pytest.mark.parametrize(("off", "score"), [(0.29, 1.0), (0.31, 0.8)])
def test_a_slot_is_occupied_within_the_tolerance(off: float, score: float) -> None:
    batch = posse.batch()
    in_place(batch, tracker_3=complex(slots(batch.scenario)[3] - off))
    assert batch.step(FOLLOW)[-1]["score"][0] == pytest.approx(score)


def test_any_tracker_takes_any_slot_and_two_in_one_slot_count_once() -> None:
    batch = posse.batch(robot_radius=0.05)
    first, last = slots(batch.scenario)[[0, 4]]
    in_place(batch, tracker_0=complex(last), tracker_4=complex(first))
    assert batch.step(FOLLOW)[-1]["score"][0] == 1.0
    in_place(batch, tracker_4=complex(first - 0.2))
    assert batch.step(FOLLOW)[-1]["score"][0] == pytest.approx(0.8)
    held = batch.state["tracker_slot"][0]
    assert sorted(held.tolist()) == [-1, 0, 1, 2, 3]
    # The one left over is as far as the slot that is free.
    left_over = int(np.flatnonzero(held < 0)[0])
    place = positions(one_world(snapshot(batch), 0))
    away = abs(place[left_over] - place[5] - last)
    assert batch.state["tracker_slot_distance"][0, left_over] == pytest.approx(away, rel=1e-4, abs=1e-4)


def test_the_broken_one_is_not_counted_and_the_others_recover() -> None:
    batch = posse.batch(breaks=1, break_window=(0.5, 0.5), horizon=100, autoreset="disabled")
    in_place(batch)
    for step in range(100):
        infos = batch.step(FOLLOW)[-1]
        assert infos["score"][0] == 1.0, step
    assert infos["metrics/settling_time"][0] == pytest.approx(0.1)
    assert infos["metrics/recovery_time"][0] == pytest.approx(0.1), "held anew from the next step on"
    assert batch.worlds["lost_at"][0] == 50
