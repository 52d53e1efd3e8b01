"""Actions of every supported form are read correctly, others are refused or clipped; all kinds play one world."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from tests.support.adapters import part, same

import posse
import posse_baselines  # noqa: F401  registers posse/Tracker-v0

VALUES = np.array([[0.5, -0.25], [1.0, -1.0], [0.0, 0.75]], np.float32)


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


def vector(name: str, **settings: Any) -> Any:
    return gymnasium.make_vec(f"posse/{name}-v0", 1, scenario="smart", **settings)


def single(name: str, **settings: Any) -> Any:
    return gymnasium.make(f"posse/{name}-v0", scenario="smart", **settings).unwrapped


KINDS: dict[str, tuple[Any, Any]] = {
    "batch": (lambda **k: posse.batch("smart", num_trackers=3, **k), lambda a: a[None]),
    "parallel": (
        lambda **k: posse.parallel_env("smart", num_trackers=3, **k),
        lambda a: {f"tracker_{i}": a[i] for i in (2, 0, 1)},
    ),
    "team": (lambda **k: single("Team", num_trackers=3, **k), lambda a: a),
    "solo": (lambda **k: single("Solo", **k), lambda a: a[0]),
    "tracker": (lambda **k: single("Tracker", **k), lambda a: a[0]),
    "team vector": (lambda **k: vector("Team", num_trackers=3, **k), lambda a: a[None]),
    "solo vector": (lambda **k: vector("Solo", **k), lambda a: a[:1]),
    "tracker vector": (lambda **k: vector("Tracker", **k), lambda a: a[:1]),
}
kinds = pytest.mark.parametrize("kind", KINDS)


def started(kind: str, **settings: Any) -> tuple[Any, Any]:
    make, actions = KINDS[kind]
    env = make(**settings)
    env.reset(seed=0)
    return env, actions


@pytest.mark.parametrize("form", FORMS.values(), ids=list(FORMS))
@pytest.mark.parametrize("kind", ["batch", "parallel", "team", "team vector"])
def test_any_form_of_the_same_numbers_is_the_same_action(kind: str, form: Any) -> None:
    one, actions = started(kind)
    other, _ = started(kind)
    whole = actions(VALUES)
    given = {name: form(row) for name, row in whole.items()} if kind == "parallel" else form(whole)
    assert same(one.step(whole)[:4], other.step(given)[:4])


@kinds
def test_numbers_outside_are_clipped_where_that_is_asked_for_and_by_rounding(kind: str) -> None:
    bounds = np.sign(VALUES + np.float32(0.1))
    rounded, actions = started(kind)
    clipping, _ = started(kind, clip_actions=True)
    reference, _ = started(kind)
    expected = reference.step(actions(bounds))[:4]
    assert same(rounded.step(actions(frozen(bounds * np.float32(1 + 1e-6))))[:4], expected)
    assert same(clipping.step(actions(frozen(bounds * np.float32(30.0))))[:4], expected)
    with pytest.raises(ValueError, match=r"1\.00000\d* is not a number in \[-1, 1\].*clip_actions=True"):
        rounded.step(actions(bounds * np.float32(1 + 1.2e-6)))
    for bad in (math.nan, math.inf, -math.inf):
        for env in (rounded, clipping):
            with pytest.raises(ValueError, match=r"(nan|inf) is not a number in \[-1, 1\]"):
                env.step(actions(np.where(bounds > 0, bad, np.float32(0.5))))


@pytest.mark.parametrize("kind", ["parallel", "team", "solo"])
def test_an_environment_is_the_first_world_of_a_batch(kind: str) -> None:
    make, actions = KINDS[kind]
    env = make(split="test", first_world=5)
    batch = posse.batch("smart", 2, split="test", first_world=5, num_trackers=1 if kind == "solo" else 3)
    seen, rows, rng = env.reset(seed=9)[0], batch.reset(seed=9), np.random.default_rng(0)
    for _ in range(30):
        mine = list(seen.values()) if kind == "parallel" else np.reshape(seen, rows[0].shape)
        np.testing.assert_array_equal(mine, rows[0])
        drawn = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        seen, reward, *_, info = env.step(actions(drawn[0]))
        rows, rewards, *_, told = batch.step(drawn)
        if kind == "parallel":
            assert list(reward.values()) == rewards[0].tolist()
        else:
            assert reward == pytest.approx(rewards[0].mean(), rel=1e-5, abs=1e-6)
        info = info["tracker_0"] if kind == "parallel" else info
        assert info["score"] == told["score"][0]
        for name, values in part(told, "reward/").items():
            np.testing.assert_array_equal(info[f"reward/{name}"], values[0] if kind == "team" else values[0, 0])
