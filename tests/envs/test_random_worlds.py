"""Worlds of drawn scenarios and actions, step by step against a computation of their own in float64."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.support.reference.motion import free_gaps, free_motion, path_gaps
from tests.support.reference.observation import observation
from tests.support.reference.score import Episode
from tests.support.reference.senses import Senses
from tests.support.reference.state import NAMES, State, headings, one_world, positions, snapshot

import posse
from posse.declarations import TARGET_MOTIONS
from posse.scenarios.formation import FORMATIONS

STEPS = 25


def some(*values: Any) -> st.SearchStrategy[Any]:
    return st.sampled_from(values)


SETTINGS = st.fixed_dictionaries(
    {"horizon": some(40), "settle_time": some(0.5), "start_distance": some((1.0, 5.0), (2.0, 8.0))},
    optional={
        "num_trackers": some(1, 2, 3, 7),
        "num_neighbours": st.integers(0, 8),
        "message_size": st.integers(0, 3),
        "formation": some(*FORMATIONS),
        "formation_distance": st.floats(0.8, 2.0),
        "tolerance": st.floats(0.1, 0.6),
        "tracker_speed": st.floats(0.7, 3.0),
        "tracker_turn_rate": st.floats(0.8, 4.0),
        "tracker_acceleration": some(math.inf, 0.5, 3.0),
        "tracker_turn_acceleration": some(math.inf, 2.0, 10.0),
        "robot_radius": st.floats(0.05, 0.3),
        "target_motion": some(*TARGET_MOTIONS),
        "target_speed": st.floats(0.0, 0.69),
        "physics_step": some(0.02, 0.05, 0.1),
        "arena": st.floats(8.0, 20.0) | st.tuples(st.floats(8.0, 20.0), st.floats(8.0, 20.0)),
        "num_obstacles": st.integers(0, 6),
        "sensing_range": some(math.inf, 2.0, 5.0),
        "field_of_view": st.floats(0.5, 6.28),
        "range_noise": st.floats(0.0, 0.3),
        "bearing_noise": st.floats(0.0, 0.5),
        "velocity_smoothing": some(0.0, 0.5),
        "sonar_beams": some(0, 1, 8),
        "radio_range": some(math.inf, 2.0, 4.0),
        "radio_delay": st.integers(0, 3),
        "radio_loss": st.floats(0.0, 0.9),
        "forget_after": st.floats(0.2, 2.0),
        "sensor_outages": some(0.0, 1.0),
        "radio_outages": some(0.0, 1.0),
        "outage_time": st.floats(0.1, 2.0),
        "breaks": some(0, 1),
        "break_window": some((0.1, 0.6)),
    },
)  # fmt: skip


def chosen(batch: posse.Batch, state: State, rng: np.random.Generator, chase: bool) -> npt.NDArray[np.float32]:
    """Draw actions; where the trackers chase the target, they drive at it."""
    actions = rng.uniform(-1, 1, batch.action_shape)
    if chase:
        n, place, heading = batch.scenario.num_trackers, positions(state), headings(state)
        actions[0, :n, 0] = 0.8
        actions[0, :n, 1] = np.clip(np.angle((place[n] - place[:n]) / heading[:n]), -1, 1)
    return actions.astype(np.float32)


def judge_motion(s: posse.Scenario, before: State, after: State, actions: npt.NDArray[Any]) -> None:
    """Robots with room around them follow their arcs, and no disc is inside another."""
    place, heading, rates = free_motion(s, before, after, actions)
    free = path_gaps(s, before, after, place) > 0.01
    np.testing.assert_allclose(positions(after)[free], place[free], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(headings(after)[free], heading[free], rtol=1e-5, atol=1e-5)
    found = np.stack([after["tracker_speed"], after["tracker_turn_rate"]])
    np.testing.assert_allclose(found[:, free[:-1]], rates[:, free[:-1]], rtol=1e-5, atol=1e-5)
    assert free_gaps(s, after).min() >= -1e-4


@settings(derandomize=True, database=None, deadline=None, max_examples=60)
@given(name=some(*NAMES), changes=SETTINGS, seed=st.integers(0, 2**63 - 1), chase=st.booleans())
def test_a_world_goes_as_an_independent_computation_says(
    name: str, changes: dict[str, Any], seed: int, chase: bool
) -> None:
    try:
        batch = posse.batch(name, 1, seed=seed, num_threads=1, **changes)
        observations, state = batch.reset(), one_world(snapshot(batch), 0)
    except posse.ScenarioError:
        assume(False)
        raise
    s, rng = batch.scenario, np.random.default_rng(seed)
    senses, episode = Senses(s), Episode(s)
    low, high = batch.layout.bounds()
    senses.follow(state)
    episode.follow(state)
    for step in range(1, STEPS + 1):
        actions, before = chosen(batch, state, rng, chase), state
        observations, rewards, _, _, infos = batch.step(actions)
        state = one_world(snapshot(batch), 0)
        senses.follow(state, actions[0])
        episode.follow(state)
        judge_motion(s, before, state, actions[0])
        assert np.isfinite(rewards).all()
        assert np.isclose(infos["score"][0], episode.score, rtol=1e-5, atol=1e-6)
        assert set(state["tracker_slot"]) - {-1} == set(episode.occupied.values())
        np.testing.assert_array_equal(infos["reward/contact"][0, : s.num_trackers], episode.onsets)
        assert state["tracker_sees"].astype(bool).tolist() == senses.sees
        assert ((observations >= low) & (observations <= high)).all()
        if step % 4 == 1:
            views = batch.layout.views(observations)
            for i in range(s.num_trackers):
                expected = observation(s, state, i, senses, views["neighbour_number"][0, i])
                for field, value in expected.items():
                    off = 2e-3 if field in ("target_velocity", "sonar") else 2e-4
                    np.testing.assert_allclose(
                        views[field][0, i], value, rtol=1e-4, atol=off, err_msg=f"{field}, step {step}"
                    )
