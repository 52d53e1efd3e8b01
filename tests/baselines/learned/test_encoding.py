"""Encodings find their fields by name in any layout."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.learned import network_for, observations_of, policy_for

import posse
from posse_baselines import PolicyError
from posse_baselines.learned import Encoder, Encoding, LearnedPolicy


def test_another_sonar_is_refused_by_name() -> None:
    policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
    other = posse.ObservationLayout(posse.get_scenario("smart", sonar_beams=16))
    with pytest.raises(PolicyError, match="sonar"):
        policy.begin(other, 1)


def test_a_policy_that_speaks_needs_messages() -> None:
    layout = posse.ObservationLayout(posse.get_scenario("smart", message_size=3))
    policy = LearnedPolicy(network_for(Encoding.of(layout).size, 5), Encoding.of(layout), {"name": "talker"})
    assert policy.message_size == 3
    with pytest.raises(PolicyError, match="message_size"):
        policy.begin(posse.ObservationLayout(posse.get_scenario("smart")), 1)


def test_longer_messages_than_it_uses_change_nothing() -> None:
    small, observations = observations_of("smart", steps=0)
    policy = policy_for(small.layout)
    large, more = observations_of("smart", steps=0, message_size=2)
    mine, _ = policy.act(observations, policy.begin(small.layout, 6))
    theirs, _ = policy.act(more, policy.begin(large.layout, 6))
    np.testing.assert_array_equal(theirs[:, :, :2], mine)
    assert not theirs[:, :, 2:].any()


def test_places_that_a_small_team_lacks_are_unknown() -> None:
    full = posse.ObservationLayout(posse.get_scenario("smart"))
    batch = posse.batch("smart", 1, num_trackers=2)
    rows = Encoder(Encoding.of(full), batch.layout).encode(batch.reset())
    named = full.views(rows)
    np.testing.assert_array_equal(named["neighbour_range"][:, 1:], -1)
    np.testing.assert_array_equal(named["neighbour_bearing"][:, 1:], 0)
    assert (named["neighbour_range"][:, 0] > 0).all()


def test_fewer_places_keep_the_nearest() -> None:
    batch = posse.batch("smart", 2)
    observations = batch.reset()
    rows = Encoder(Encoding.of(batch.layout, neighbours=2), batch.layout).encode(observations)
    np.testing.assert_array_equal(rows, observations.reshape(10, -1)[:, : rows.shape[1]])


def test_names_are_those_of_views() -> None:
    batch, observations = observations_of("radio")
    encoding = Encoding.of(batch.layout, neighbours=3)
    views, columns = batch.layout.views(observations), encoding.columns(batch.layout)[0]
    for name, column in zip(encoding.names(), columns, strict=True):
        field, _, at = name.rstrip("]").partition("[")
        index = tuple(int(i) for i in at.split(", ") if i)
        np.testing.assert_array_equal(views[field][(..., *index)], observations[..., column])


def test_unknown_kinds() -> None:
    layout = posse.ObservationLayout(posse.get_scenario("smart"))
    with pytest.raises(PolicyError, match="plain, slots"):
        Encoding.of(layout, "fancy")
    with pytest.raises(PolicyError, match="neighbours=-1"):
        Encoding.of(layout, neighbours=-1)
