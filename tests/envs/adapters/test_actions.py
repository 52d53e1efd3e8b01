"""Actions of every supported form are read correctly, others are refused or clipped; all kinds play one world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.adapters import part, same
from tests.support.attack import MAKERS, Subject

VALUES = np.array([[[0.5, -0.25], [1.0, -1.0]], [[0.0, 0.75], [-0.5, 1.0]]], np.float32)


def frozen(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


FORMS: dict[str, Any] = {
    "read-only": frozen,
    "of a transposed array": np.asfortranarray,
    "every other": lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    "float64": lambda array: array.astype(np.float64),
    "float16": lambda array: array.astype(np.float16),
    "big-endian": lambda array: array.astype(">f4"),
    "list": lambda array: array.tolist(),
}


def started(kind: str, **settings: Any) -> Subject:
    subject = Subject(kind, scenario="smart", **settings)
    subject.env.reset(seed=0)
    return subject


@pytest.mark.parametrize("form", FORMS.values(), ids=list(FORMS))
@pytest.mark.parametrize("kind", ["batch", "parallel", "team", "team vector"])
def test_any_form_of_the_same_numbers_is_the_same_action(kind: str, form: Any) -> None:
    one, other = started(kind), started(kind)
    whole = one.action(VALUES)
    given = {name: form(row) for name, row in whole.items()} if kind == "parallel" else form(whole)
    assert same(one.env.step(whole)[:4], other.env.step(given)[:4])


@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind != "torchrl"])
def test_numbers_outside_are_clipped_where_that_is_asked_for_and_by_rounding(kind: str) -> None:
    bounds = np.sign(VALUES + np.float32(0.1))
    rounded, clipping, reference = started(kind), started(kind, clip_actions=True), started(kind)

    def step(subject: Subject, actions: Any) -> Any:
        return subject.env.step(subject.action(actions))[:4]

    expected = step(reference, bounds)
    assert same(step(rounded, frozen(bounds * np.float32(1 + 1e-6))), expected)
    assert same(step(clipping, frozen(bounds * np.float32(30.0))), expected)
    with pytest.raises(ValueError, match=r"1\.00000\d* is not a number in \[-1, 1\].*clip_actions=True"):
        step(rounded, bounds * np.float32(1 + 1.2e-6))
    for bad in (math.nan, math.inf, -math.inf):
        for subject in (rounded, clipping):
            with pytest.raises(ValueError, match=r"(nan|inf) is not a number in \[-1, 1\]"):
                step(subject, np.where(bounds > 0, bad, np.float32(0.5)))


@pytest.mark.parametrize("kind", ["parallel", "team", "solo"])
def test_an_environment_is_the_first_world_of_a_batch(kind: str) -> None:
    settings: dict[str, Any] = {"split": "test", "first_world": 5, "horizon": 40, "num_trackers": 1 + (kind != "solo")}
    subject, batch = Subject(kind, **settings), MAKERS["batch"](**settings)
    seen, rows, rng = subject.env.reset(seed=9)[0], batch.reset(seed=9), np.random.default_rng(0)
    for _ in range(30):
        mine = list(seen.values()) if kind == "parallel" else np.reshape(seen, rows[0].shape)
        np.testing.assert_array_equal(mine, rows[0])
        drawn = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        seen, reward, *_, info = subject.env.step(subject.action(drawn))
        rows, rewards, *_, told = batch.step(drawn)
        if kind == "parallel":
            assert list(reward.values()) == rewards[0].tolist()
        else:
            assert reward == pytest.approx(rewards[0].mean(), rel=1e-5, abs=1e-6)
        info = info["tracker_0"] if kind == "parallel" else info
        assert info["score"] == told["score"][0]
        for name, values in part(told, "reward/").items():
            np.testing.assert_array_equal(info[f"reward/{name}"], values[0] if kind == "team" else values[0, 0])
