"""Worlds of drawn and of chosen scenarios, step by step against a computation of their own in float64."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.support.reference.observation import observation
from tests.support.reference.score import Episode, slots
from tests.support.reference.senses import Senses
from tests.support.reference.state import (
    NAMES,
    State,
    free_gaps,
    free_motion,
    headings,
    one_world,
    path_gaps,
    positions,
    snapshot,
    working,
)

import posse
from posse.declarations import TARGET_MOTIONS
from posse.scenarios.scenario import FORMATIONS


def some(*values: Any) -> st.SearchStrategy[Any]:
    return st.sampled_from(values)


SETTINGS = st.fixed_dictionaries(
    {"horizon": some(25), "settle_time": some(0.5), "start_distance": some((1.0, 5.0), (2.0, 8.0))},
    optional={
        "num_trackers": some(1, 2, 3, 7),
        "num_neighbours": st.integers(0, 8),
        "message_size": st.integers(0, 3),
        "formation": some(*FORMATIONS),
        "formation_distance": st.floats(0.8, 2.0),
        "tolerance": st.floats(0.1, 0.6),
        "tracker_speed": st.floats(0.7, 3.0) | some(50.0),
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
        "velocity_smoothing": some(0.0, 0.5, 2.0),
        "sonar_beams": some(0, 1, 8, 32),
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


def started(name: str, worlds: int, **settings: Any) -> tuple[posse.Batch, npt.NDArray[np.float32]]:
    """Return a batch and its first observations; of drawn settings, others are drawn where these are refused."""
    try:
        batch = posse.batch(name, worlds, **settings)
        return batch, batch.reset()
    except posse.ScenarioError:
        assume(False)
        raise


def chosen(batch: posse.Batch, state: State, rng: np.random.Generator, team: str) -> npt.NDArray[np.float32]:
    """Draw actions; those of a team that "chases" lead to the target, of one that "forms" roughly to the slots."""
    s, n = batch.scenario, batch.scenario.num_trackers
    actions, place, heading = rng.uniform(-1, 1, batch.action_shape), positions(state), headings(state)
    if team == "chases":
        actions[0, :n, 0] = 0.8
        actions[0, :n, 1] = np.clip(np.angle((place[n] - place[:n]) / heading[:n]), -1, 1)
    elif team == "forms":
        frame = complex(state["world_frame_cos"], state["world_frame_sin"])
        away = (place[n] + slots(s) * frame - place[:n]) / heading[:n]
        speed = 0.85 * s.target_speed + 0.8 * np.abs(away) * np.cos(np.angle(away))
        actions[0, :n, 0] = np.clip(2 * speed / s.tracker_speeds - 1, -1, 1)
        actions[0, :n, 1] = np.clip(2 * np.angle(away) / s.tracker_turn_rates, -1, 1)
    return actions.astype(np.float32)


def near(found: Any, value: Any, what: str, off: float = 1e-5, relative: float = 1e-5) -> None:
    """Compare as numpy's ``assert_allclose`` does, in a tenth of its time."""
    wrong = ~(np.abs(found - value) <= off + relative * np.abs(value))
    assert not wrong.any(), f"{what}: {found} is not {value}"


def judge_motion(s: posse.Scenario, before: State, after: State, actions: npt.NDArray[Any]) -> None:
    """Robots with room around them follow their arcs, and no disc is inside another."""
    place, heading, rates = free_motion(s, before, after, actions)
    free = path_gaps(s, before, after, place) > 0.01
    near(positions(after)[free], place[free], "positions")
    near(headings(after)[free], heading[free], "headings")
    found = np.stack([after["tracker_speed"], after["tracker_turn_rate"]])
    near(found[:, free[:-1]], rates[:, free[:-1]], "speeds and turn rates")
    assert free_gaps(s, after).min() >= -1e-4


def judge_rewards(s: posse.Scenario, state: State, episode: Episode, rewards: npt.NDArray[Any], infos: Any) -> None:
    """Terms, their weighted sum, and the score; who of two in one slot is said to hold it is left to the engine."""
    n, holds = s.num_trackers, state["tracker_slot"] >= 0
    speed = state["tracker_speed"] / s.tracker_speeds
    turn = state["tracker_turn_rate"] / s.tracker_turn_rates
    expected: dict[str, Any] = {
        "slot": holds,
        "sight": state["tracker_sees"],
        "contact": episode.onsets,
        "effort": (speed**2 + turn**2) * working(state),
        "team": np.full(n, episode.score),
    }
    if holds.tolist() == [i in episode.occupied for i in range(n)]:
        expected |= {"progress": episode.progress, "distance": episode.distance}
    for name, value in expected.items():
        near(infos[f"reward/{name}"][0, :n], value, name, 2e-4, 1e-4)
    total = sum(
        weight * infos[f"reward/{name}"][0, :n].astype(float) for name, weight in dict(s.reward_weights).items()
    )
    near(rewards[0, :n], total, "reward")
    assert set(state["tracker_slot"]) - {-1} == set(episode.occupied.values())
    near(infos["score"][0], episode.score, "score")


def judge_observations(batch: posse.Batch, state: State, senses: Senses, views: dict[str, npt.NDArray[Any]]) -> None:
    n = batch.scenario.num_trackers
    expected = [observation(batch.scenario, state, i, senses, views["neighbour_number"][0, i]) for i in range(n)]
    assert set(expected[0]) == set(views)
    for name, view in views.items():
        value = np.stack([each[name] for each in expected])
        near(view[0, :n], value, name, 2e-3 if name in ("target_velocity", "sonar") else 2e-4, 1e-4)


def judge(batch: posse.Batch, observations: npt.NDArray[np.float32], seed: int, team: str, every: int = 4) -> None:
    """Play an episode to its end; compare all that the batch returns, the observations of each so many steps."""
    s, state, rng = batch.scenario, one_world(snapshot(batch), 0), np.random.default_rng(seed)
    senses, episode = Senses(s), Episode(s)
    senses.follow(state)
    episode.follow(state)
    for step in range(1, s.horizon + 1):
        actions, before = chosen(batch, state, rng, team), state
        observations, rewards, _, _, infos = batch.step(actions)
        state = one_world(snapshot(batch), 0)
        senses.follow(state, actions[0])
        episode.follow(state)
        judge_motion(s, before, state, actions[0])
        judge_rewards(s, state, episode, rewards, infos)
        assert state["tracker_sees"].astype(bool).tolist() == senses.sees
        if step % every == 1:
            judge_observations(batch, state, senses, batch.layout.views(observations))
    for name, value in episode.metrics().items():
        assert float(infos[f"metrics/{name}"][0]) == pytest.approx(value, rel=1e-4, abs=1e-3, nan_ok=True), name


@settings(max_examples=60)
@given(name=some(*NAMES), changes=SETTINGS, seed=st.integers(0, 2**63 - 1), team=some("is drawn", "chases", "forms"))
def test_a_world_goes_as_an_independent_computation_says(
    name: str, changes: dict[str, Any], seed: int, team: str
) -> None:
    batch, observations = started(name, 1, seed=seed, num_threads=1, **changes)
    judge(batch, observations, seed, team)


CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    *((name, {}) for name in NAMES),
    # A ring so tight that trackers run into the target.
    ("constant", {"num_trackers": 12, "message_size": 2, "formation": "ring", "formation_spacing": 0.65}),
    ("constant", {"num_trackers": 1, "reward_weights": {term.name: 0.5 for term in posse.REWARD_TERMS}}),
    ("obstacles", {"tracker_speed": (1.0, 0.8, 1.3, 0.7, 1.0), "tracker_acceleration": 2.0, "sonar_beams": 13}),
    ("constant", {"num_trackers": 16, "num_neighbours": 5, "formation": "ring", "message_size": 1}),
    ("constant", {"breaks": 2, "formation": "ring", "break_window": (0.2, 0.4)}),
    ("field", {"breaks": 3, "field_of_view": 2.0, "forget_after": 0.35, "num_neighbours": 3}),
    ("radio", {"num_trackers": 7, "formation": "rows", "sonar_beams": 0}),
)
"""Every scenario, and variants of settings."""


@pytest.mark.parametrize(("name", "changes"), CASES, ids=str)
def test_a_team_that_forms_up_goes_as_an_independent_computation_says(name: str, changes: dict[str, Any]) -> None:
    """In short episodes, and from starts nearby, so that much happens."""
    short: dict[str, Any] = {"horizon": 160, "start_distance": (1.5, 5.0), "settle_time": 0.5, "outage_time": 3.0}
    batch = posse.batch(name, 1, seed=8, **short, **changes)
    judge(batch, batch.reset(), 0, "forms", every=6 if batch.scenario.num_trackers < 12 else 24)
