"""Copies of worlds: the same state as their originals, and independent random draws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.envs.engine.test_batch import actions_for
from tests.support.reference.state import snapshot

import posse

NOTHING_DRAWN = ("constant", "smart", "obstacles")
DRAWS = ("accelerating", "radio", "leader-loss", "field")


def played(name: str, worlds: int = 3, steps: int = 40, **overrides: Any) -> posse.Batch:
    near: dict[str, Any] = {"start_distance": (1.5, 4.0)}
    batch = posse.batch(name, worlds, seed=4, **{**near, **overrides})
    batch.reset()
    for step in range(steps):
        batch.step(actions_for(batch, step))
    return batch


def repeated(batch: posse.Batch, step: int) -> NDArray[np.float32]:
    """Return the actions of a batch for two copies of it."""
    return np.repeat(actions_for(batch, step), 2, axis=0)


@pytest.mark.parametrize("name", [*NOTHING_DRAWN, *DRAWS])
def test_copies_draw_what_neither_their_original_nor_other_copies_draw(name: str) -> None:
    """And go on as their originals where nothing is drawn."""
    batch = played(name)
    copies = batch.copies(2)
    assert copies.num_worlds == 6
    np.testing.assert_array_equal(copies.observe(), np.repeat(batch.observe(), 2, axis=0))
    seen, own = [], []
    for step in range(100, 500 if name == "leader-loss" else 130):
        seen.append(copies.step(repeated(batch, step))[0])
        own.append(batch.step(actions_for(batch, step))[0])
    first, second, original = np.stack(seen)[:, ::2], np.stack(seen)[:, 1::2], np.stack(own)
    for one, other in ((first, original), (second, original), (first, second)):
        assert ((one != other).any(axis=(0, 2, 3)) == (name in DRAWS)).all()


def test_what_copies_draw_follows_from_seed_and_step() -> None:
    def future(seed: int, steps: int = 40, into: posse.Batch | None = None) -> NDArray[np.float32]:
        batch = played("field", steps=steps)
        copies = batch.copies(2, seed=seed, into=into)
        for step in range(20):
            seen = copies.step(repeated(batch, step))[0]
        return seen

    used = played("field", 6)
    np.testing.assert_array_equal(future(1), future(1, into=used))
    assert not np.array_equal(future(1), future(2))


def test_the_episode_after_a_copy_s_end_is_no_world_s() -> None:
    batch = played("constant", 2, steps=9, horizon=10, settle_time=0.5)
    copies = batch.copies(2)
    for step in range(2):
        batch.step(actions_for(batch, step))
        copies.step(repeated(batch, step))
    assert (copies.worlds["step"] == 0).all()
    assert len({*batch.worlds["x"].tolist(), *copies.worlds["x"].tolist()}) == 6


def test_faults_that_have_begun_stay_and_others_are_drawn_anew() -> None:
    batch = played("field", 200, steps=300)
    copies = batch.copies(20)
    own, theirs = snapshot(batch), snapshot(copies)
    for name in ("tracker_sensor_dead_from", "tracker_radio_dead_from"):
        begun = np.repeat(own[name] <= 300, 20, axis=0)
        np.testing.assert_array_equal(theirs[name][begun], np.repeat(own[name], 20, axis=0)[begun])
        coming = theirs[name][~begun]
        assert not np.array_equal(coming, np.repeat(own[name], 20, axis=0)[~begun])
        assert (coming > 300).all()
        # A fifth has an outage at a uniform step of 600; of those with none by 300, a ninth.
        assert (coming < 600).mean() == pytest.approx(1 / 9, abs=0.015)
        assert coming[coming < 600].mean() == pytest.approx(450, abs=10)
    for name in ("tracker_broken_at", "world_breaks_left"):
        np.testing.assert_array_equal(theirs[name], np.repeat(own[name], 20, axis=0))
