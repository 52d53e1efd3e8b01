"""What networks read and answer: encodings by name, features of the state, and the numbers that come out."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.learned import observations_of, policy_for
from tests.support.reference.state import directions, points

import posse
from posse.numeric import FloatArray
from posse_baselines.learned import Encoder, Encoding, Network
from posse_baselines.learned.features import NUM_FEATURES, match_slots


def test_names_are_those_of_views() -> None:
    batch, observations = observations_of("radio")
    encoding = Encoding.of(batch.layout, neighbours=3)  # of five: the nearest
    views, rows = batch.layout.views(observations), Encoder(encoding, batch.layout).encode(observations)
    for name, column in zip(encoding.names(), rows.T, strict=True):
        field, _, at = name.rstrip("]").partition("[")
        index = tuple(int(i) for i in at.split(", ") if i)
        np.testing.assert_array_equal(views[field][(..., *index)].ravel(), column)


def test_longer_messages_than_it_uses_change_nothing() -> None:
    small, observations = observations_of("smart", steps=0)
    policy = policy_for(small.layout)
    large, more = observations_of("smart", steps=0, message_size=2)
    mine, _ = policy.act(observations, policy.begin(small.layout, 6))
    theirs, _ = policy.act(more, policy.begin(large.layout, 6))
    np.testing.assert_array_equal(theirs[:, :, :2], mine)
    assert not theirs[:, :, 2:].any()


def test_places_that_a_small_team_lacks_are_unknown() -> None:
    full, batch = posse.batch("smart").layout, posse.batch("smart", num_trackers=2)
    rows = Encoder(Encoding.of(full), batch.layout).encode(batch.reset())
    named = full.views(rows)
    np.testing.assert_array_equal(named["neighbour_range"][:, 1:], -1)
    np.testing.assert_array_equal(named["neighbour_bearing"][:, 1:], 0)
    assert (named["neighbour_range"][:, 0] > 0).all()


@pytest.mark.parametrize("silent", [False, True])
def test_own_slot_is_where_the_state_says(silent: bool) -> None:
    batch, observations = observations_of("constant", worlds=8, steps=30)
    views = batch.layout.views(observations)
    if silent:
        views["neighbour_age"][views["neighbour_number"] == 4] = 1.1
    rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
    soft = rows[:, 14 + 2 : 14 + 4].reshape(8, 5, 2) @ [1, 1j]  # its length is d / (d + 3)
    found = 3.0 * soft / (1 - np.abs(soft))
    frame = points(batch, "world", "frame_cos", "frame_sin")
    places = points(batch, "world")[:, None] + np.array(batch.scenario.slot_offsets) @ [1, 1j] * frame[:, None]
    slots = (places[:, None] - points(batch, "tracker")[..., None]) / directions(batch, "tracker")[..., None]
    away = np.abs(slots - found[..., None])
    chosen = away.argmin(axis=2)
    np.testing.assert_allclose(away.min(axis=2), 0, atol=0.02)
    # With a perfect radio all compute the same assignment; a robot that is taken for broken leaves the last slot empty.
    heard = 4 if silent else 5
    assert all(sorted(row[:heard]) == list(range(heard)) for row in chosen)


def test_nothing_known_of_the_target_is_zeros() -> None:
    batch = posse.batch("search", 4)
    observations = batch.reset()
    unknown = batch.layout.views(observations)["target_known"].reshape(-1) == 0
    assert unknown.any()
    rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
    assert not rows[unknown, 14:NUM_FEATURES].any()
    assert np.isfinite(rows).all()


@settings(derandomize=True, deadline=None, max_examples=100)
@given(robots=st.integers(1, 9), slots=st.integers(1, 12), seed=st.integers(0, 2**31))
def test_no_swap_shortens_an_assignment(robots: int, slots: int, seed: int) -> None:
    ways = np.random.default_rng(seed).uniform(0, 10, (robots, slots)).astype(np.float32)
    chosen = np.empty(robots, np.int64)
    match_slots(robots, slots, ways.T, chosen)
    given_out = [s for s in chosen if s >= 0]
    assert len(given_out) == len(set(given_out)) == min(robots, slots)
    if robots <= slots:
        total = ways[np.arange(robots), chosen].sum()
        for i in range(robots):
            for j in range(i):
                other = chosen.copy()
                other[[i, j]] = other[[j, i]]
                assert ways[np.arange(robots), other].sum() >= total - 1e-3


def in_double_precision(network: Network, rows: FloatArray) -> npt.NDArray[np.float64]:
    """The actions for encoded observations, by matrix products."""
    x = np.clip((rows - network.mean) * network.scale, -network.limit, network.limit).astype(np.float64)
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True), 1):
        x = x @ weight.T.astype(np.float64) + bias
        if layer < len(network.weights):
            x = np.tanh(x) if network.activation == "tanh" else np.maximum(x, 0)
    return np.asarray(np.tanh(x) if network.output == "tanh" else np.clip(x, -1, 1))


@pytest.mark.parametrize("kind", ["plain", "slots"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_actions_are_the_networks_output(kind: str, activation: str, output: str) -> None:
    batch, observations = observations_of("field")
    policy = policy_for(batch.layout, kind, activation=activation, output=output)
    actions, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(policy.encoding, batch.layout).encode(observations)
    expected = in_double_precision(policy.network, rows).reshape(actions.shape)
    np.testing.assert_allclose(actions, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(actions).max() <= 1
    assert np.ptp(actions) > 0.5  # the networks say something
