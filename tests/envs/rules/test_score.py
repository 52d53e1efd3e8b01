"""The score, settling, recovery and the bound, against an independent computation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.adapters import part
from tests.support.reference.recordings import CASES, case_name, record
from tests.support.reference.score import Episode, slots
from tests.support.reference.state import one_world, positions, snapshot

import posse


@pytest.mark.parametrize("case", CASES, ids=case_name)
def test_every_step_s_score_equals_an_independent_working(case: Any) -> None:
    recording = record(*case)
    episode = Episode(recording.scenario)
    episode.follow(recording.states[0])
    for state, infos in zip(recording.states[1:], recording.infos, strict=True):
        episode.follow(state)
        assert infos["score"][0] == pytest.approx(episode.score, rel=1e-5, abs=1e-6)
        holds = state["tracker_slot"] >= 0
        assert set(state["tracker_slot"][holds].tolist()) == set(episode.occupied.values())


def in_place(batch: posse.Batch, shift: complex = 0.0, **poses: complex) -> None:
    """Start a team in its slots, heading like the target along x, with some exceptions."""
    places = slots(batch.scenario) + shift
    for name, place in poses.items():
        places[int(name.removeprefix("tracker_"))] = place
    batch.reset(options={"target_pose": [0.0, 0.0, 0.0], "tracker_pose": [[p.real, p.imag, 0.0] for p in places]})


FOLLOW = 2 * 0.6 - 1  # the action that keeps the target's speed


@pytest.mark.parametrize(("off", "score"), [(0.29, 1.0), (0.31, 0.8)])
def test_a_slot_is_occupied_within_the_tolerance(off: float, score: float) -> None:
    batch = posse.batch()
    place = complex(slots(batch.scenario)[3] - off)
    in_place(batch, tracker_3=place)
    infos = batch.step(np.tile([FOLLOW, 0.0], (1, 5, 1)))[-1]
    assert infos["score"][0] == pytest.approx(score)


def test_who_stands_where_is_free_and_two_in_one_slot_count_once() -> None:
    batch = posse.batch(robot_radius=0.05)
    first, last = slots(batch.scenario)[[0, 4]]
    in_place(batch, tracker_0=complex(last), tracker_4=complex(first))
    follow = np.tile([FOLLOW, 0.0], (1, 5, 1))
    assert batch.step(follow)[-1]["score"][0] == 1.0
    in_place(batch, tracker_4=complex(first - 0.2))
    infos = batch.step(follow)[-1]
    assert infos["score"][0] == pytest.approx(0.8)
    held = batch.state["tracker_slot"][0]
    assert sorted(held.tolist()) == [-1, 0, 1, 2, 3]
    # The one left over is as far as the slot that is free.
    left_over = int(np.flatnonzero(held < 0)[0])
    place = positions(one_world(snapshot(batch), 0))
    away = abs(place[left_over] - place[5] - last)
    assert batch.state["tracker_slot_distance"][0, left_over] == pytest.approx(away, rel=1e-4, abs=1e-4)


def test_the_safe_score_counts_no_step_from_the_first_contact_on() -> None:
    """The leader runs into the target that it follows, falls back, and is in its slot again."""
    batch = posse.batch(horizon=80, autoreset="disabled")
    in_place(batch)
    actions = np.tile([FOLLOW, 0.0], (1, 5, 1))
    scores: list[float] = []
    touches: list[bool] = []
    for step in range(1, 81):
        place = positions(one_world(snapshot(batch), 0))
        if step > 5:
            fallen_back = (place[5] - place[0]).real >= 1.2
            actions[0, 0, 0] = 1.0 if not any(touches) else FOLLOW if fallen_back else -0.6
        infos = batch.step(actions)[-1]
        scores.append(float(infos["score"][0]))
        touches.append(bool(batch.state["tracker_touching"].any()))
    first = touches.index(True)
    assert 5 < first < 40
    assert scores[first] == pytest.approx(0.8)
    assert scores[-1] == 1.0
    assert not touches[-1]
    metrics = part(infos, "metrics/")
    assert metrics["score"][0] == pytest.approx(sum(scores) / 80)
    assert metrics["safe_score"][0] == pytest.approx(sum(scores[:first]) / 80)
    assert metrics["contact_free"][0] == 0.0


def test_the_broken_one_is_not_counted_and_the_others_recover() -> None:
    batch = posse.batch(breaks=1, break_window=(0.5, 0.5), horizon=100, autoreset="disabled")
    in_place(batch)
    follow = np.tile([FOLLOW, 0.0], (1, 5, 1))
    for step in range(100):
        infos = batch.step(follow)[-1]
        assert infos["score"][0] == 1.0, step
    metrics = part(infos, "metrics/")
    assert metrics["settling_time"][0] == pytest.approx(0.1)
    assert metrics["recovery_time"][0] == pytest.approx(0.1), "held anew from the next step on"
    assert batch.worlds["lost_at"][0] == 50


def test_the_bound_is_the_soonest_straight_arrival() -> None:
    """A target at rest: tracker i needs (distance of the nearest slot - tolerance) / V."""
    batch = posse.batch(num_worlds=20, target_speed=0.0, horizon=200, autoreset="disabled")
    batch.reset(seed=2)
    state = snapshot(batch)
    for _ in range(200):
        infos = batch.step(np.zeros(batch.action_shape))[-1]
    for e in range(20):
        world = one_world(state, e)
        p = positions(world)
        frame = complex(world["world_frame_cos"], world["world_frame_sin"])
        away = np.abs(p[:5, None] - p[5] - slots(batch.scenario) * frame).min(axis=1)
        first = np.ceil((away - 0.3) / 1.0 / 0.1 - 1e-3)
        bound = np.mean((200 - first + 1) / 200)
        assert infos["metrics/bound"][e] == pytest.approx(bound, abs=2e-3)


def test_no_score_is_above_the_bound() -> None:
    for case in CASES:
        metrics = record(*case).batch.metrics()
        assert metrics["score"][0] <= metrics["bound"][0] + 1e-6
