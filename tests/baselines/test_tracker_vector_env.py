"""``posse/Tracker-v0`` stepped in many worlds agrees with Gymnasium's own vector of single ones."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from tests.support.adapters import same

import posse_baselines  # noqa: F401  registers the id
from posse import ScenarioError

NAME, E = "posse/Tracker-v0", 3
SETTINGS: dict[str, Any] = {
    "scenario": "radio",
    "num_trackers": 3,
    "number": 1,
    "horizon": 14,
    "settle_time": 0.5,
    "terminate_on_contact": True,
    "start_distance": (1.0, 4.0),
    "breaks": 1,
    "break_window": (0.2, 0.4),
}


def vector(**settings: Any) -> Any:
    return gymnasium.make_vec(NAME, E, vectorization_mode="vector_entry_point", **settings)


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize("kind", [{}, {"silent": False}, {"discrete_actions": True}])
def test_it_agrees_with_gymnasiums_own(mode: AutoresetMode, kind: dict[str, bool]) -> None:
    settings = {**SETTINGS, **kind}
    ours = vector(autoreset=mode, **settings)
    theirs: Any = SyncVectorEnv(
        [
            lambda i=i: gymnasium.make(NAME, first_world=i, **settings)  # type: ignore[misc]
            for i in range(E)
        ],
        autoreset_mode=mode,
    )
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert same(ours.reset(seed=6), theirs.reset(seed=[6] * E))
    ours.action_space.seed(0)
    ends = 0
    for _ in range(40):
        actions = ours.action_space.sample()
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert a.dtype == b.dtype
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=0)
        assert same(mine[4], other[4])
        ended = mine[2] | mine[3]
        ends += ended.sum()
        if mode is AutoresetMode.DISABLED and ended.any():
            options = {"reset_mask": ended}
            assert same(ours.reset(options=options), theirs.reset(options={"reset_mask": ended.copy()}))
    assert ends >= 2 * E


def test_a_refused_step_leaves_it_as_it_was() -> None:
    one, other = (vector(seed=3, **SETTINGS) for _ in range(2))
    with pytest.raises(ResetNeeded):
        one.step(np.zeros((E, 2), np.float32))
    assert same(one.reset(), other.reset())
    for bad in (np.full((E, 2), 3.0), np.full((E, 2), np.nan), np.zeros((E, 3)), "left"):
        with pytest.raises(ValueError, match="action"):
            one.step(bad)
    actions = np.full((E, 2), 0.5, np.float32)
    for _ in range(5):
        assert same(one.step(actions), other.step(actions))


def test_what_cannot_be_played_is_refused() -> None:
    with pytest.raises(ValueError, match="number=7 is not in the team"):
        vector(number=7)
    with pytest.raises(ScenarioError, match="leaves no team-mates"):
        vector(num_trackers=1)
