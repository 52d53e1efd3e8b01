"""The vector environments agree with Gymnasium's own over single ones, infos included."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics
from tests.support.adapters import same

from posse.adapters.vector_env import TeamVectorEnv

TEAM, SOLO = "posse/Team-v0", "posse/Solo-v0"
# Terminations (on contact) and truncations, at different times in different worlds, and breaks.
BUSY: dict[str, Any] = {
    "scenario": "constant",
    "horizon": 25,
    "settle_time": 0.5,
    "terminate_on_contact": True,
    "arena": 10.0,
    "num_obstacles": 2,
    "obstacle_gap": 0.6,
    "start_distance": (1.0, 4.0),
    "obstacle_radius": (0.4, 0.6),
}
MODES = list(AutoresetMode)
modes = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.value)
names = pytest.mark.parametrize("name", [TEAM, SOLO])
E = 4


def vector(name: str = TEAM, **settings: Any) -> TeamVectorEnv:
    env = gymnasium.make_vec(name, settings.pop("num_envs", E), vectorization_mode="vector_entry_point", **settings)
    assert isinstance(env, TeamVectorEnv)
    return env


def reset_where_it_ended(env: VectorEnv[Any, Any, Any], mode: AutoresetMode, ended: Any) -> tuple[Any, Any] | None:
    if mode is not AutoresetMode.DISABLED or not ended.any():
        return None
    return env.reset(options={"reset_mask": ended})


@modes
@names
@pytest.mark.parametrize("discrete", [False, True])
def test_it_agrees_with_gymnasiums_own(name: str, mode: AutoresetMode, discrete: bool) -> None:
    settings = {**BUSY, "discrete_actions": discrete}
    if name == TEAM:
        settings.update(breaks=1, break_window=(0.2, 0.4))
    else:  # one alone runs into something only if it is fast
        settings.update(tracker_speed=3.0)
    ours = vector(name, autoreset=mode.name.lower(), **settings)
    theirs = SyncVectorEnv(
        [
            lambda i=i: gymnasium.make(name, first_world=i, **settings)  # type: ignore[misc]
            for i in range(E)
        ],
        autoreset_mode=mode,
    )
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.single_action_space == theirs.single_action_space
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert same(ours.reset(seed=6), theirs.reset(seed=[6] * E))
    ours.action_space.seed(0)
    terminations = truncations = 0
    for _ in range(80):
        actions = ours.action_space.sample()
        mine: Any = ours.step(actions)
        other: Any = theirs.step(actions)
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert a.dtype == b.dtype
            assert np.allclose(a, b, rtol=1e-12, atol=0)
        assert same(mine[4], other[4])
        terminations += mine[2].sum()
        truncations += mine[3].sum()
        ended = mine[2] | mine[3]
        assert same(reset_where_it_ended(ours, mode, ended), reset_where_it_ended(theirs, mode, ended.copy()))
    assert terminations > 0
    assert truncations > 0


@modes
def test_it_says_its_autoreset_mode(mode: AutoresetMode) -> None:
    env = vector(autoreset=mode.name.lower())
    assert env.autoreset_mode is env.metadata["autoreset_mode"] is mode
    assert TeamVectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


@names
def test_gymnasiums_wrappers_take_it(name: str) -> None:
    env = NormalizeObservation(RecordEpisodeStatistics(vector(name, horizon=5, settle_time=0.3)))
    observations, _ = env.reset(seed=0)
    total = np.zeros(E)
    for _ in range(5):
        observations, rewards, _, _, infos = env.step(env.action_space.sample())
        total += rewards
    assert observations.shape == env.observation_space.shape
    assert np.isfinite(observations).all()
    assert infos["episode"]["l"].tolist() == [5] * E
    assert infos["episode"]["r"] == pytest.approx(total)


def test_every_world_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = vector(num_envs=2, render_mode="rgb_array")
    env.reset(seed=0)
    frames = env.render()
    assert frames is not None
    first, second = frames
    assert first.shape == second.shape
    assert not np.array_equal(first, second)
    env.close()
    env.close()
