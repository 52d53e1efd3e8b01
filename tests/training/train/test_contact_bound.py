"""The bound on contact: what is counted, what a contact costs, and how the cost adapts."""

from __future__ import annotations

import numpy as np
import pytest

import posse
from posse_baselines.learned import Encoding
from posse_training.train.contact_bound import LEAST, MOST, ContactBound
from posse_training.train.vec_env import TeamVecEnv

HORIZON = 60


def test_contacts_are_counted_once_an_episode_and_cost_whom_makes_them() -> None:
    def make() -> posse.Batch:
        # Close to one another and without a safeguard: trackers that wander touch.
        return posse.batch(
            "constant", 12, seed=5, horizon=HORIZON, settle_time=1.0, start_distance=(1.0, 1.5), autoreset="disabled"
        )

    batch, twin = make(), make()
    env = TeamVecEnv([batch], Encoding.of(batch.layout), staggered=False)
    env.set_contact_cost(3.0)
    env.reset()
    twin.reset()
    generator = np.random.default_rng(1)
    first, touched = 0, np.zeros(12, bool)
    for _ in range(2 * HORIZON):
        actions = generator.uniform(-1, 1, (60, 2)).astype(np.float32)
        actions[:, 0] = 1.0
        _, rewards, dones, _ = env.step(actions)
        _, wanted, _, _, told = twin.step(actions.reshape(12, 5, 2))
        contacts = told["reward/contact"]
        np.testing.assert_allclose(rewards.reshape(12, 5), wanted - 3.0 * contacts, rtol=1e-5, atol=1e-5)
        touching = contacts.any(axis=1)
        first += int((touching & ~touched).sum())
        touched |= touching
        if dones.any():
            touched[:] = False
            twin.reset(options={"reset_mask": np.ones(12, bool)})
    assert 0 < first <= 24
    assert env.take_contacts() == (first, 24.0)
    assert env.take_contacts() == (0, 0.0)


def test_the_multiplier_follows_the_share() -> None:
    bound = ContactBound(0.1)
    start = bound.multiplier
    for _ in range(40):
        bound.update(30, 100)
    assert bound.share == pytest.approx(0.3)
    assert bound.multiplier > 5 * start
    high = bound.multiplier
    for _ in range(60):
        bound.update(2, 100)
    assert bound.share == pytest.approx(0.02, abs=1e-3)
    assert bound.multiplier < 0.5 * high
    for share, end in ((100, MOST), (0, LEAST)):
        for _ in range(400):
            bound.update(share, 100)
        assert bound.multiplier == end


def test_it_goes_back_to_a_saved_state() -> None:
    bound, again = ContactBound(0.1), ContactBound(0.1)
    bound.update(1, 100)
    again.restore(bound.save())
    assert again.save() == bound.save()
