"""The vector environments agree with Gymnasium's own over single ones, infos included."""

from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from tests.support.attack import same

import posse_baselines  # noqa: F401  registers posse/Tracker-v0
from posse.adapters.vector_env import TeamVectorEnv

# Terminations (on contact) and truncations, at different times in different worlds, and breaks.
SETTINGS: dict[str, Any] = {"scenario": "constant", "horizon": 25, "settle_time": 0.5, "terminate_on_contact": True}
SETTINGS |= {"arena": 10.0, "num_obstacles": 2, "obstacle_gap": 0.6, "obstacle_radius": (0.4, 0.6)}
SETTINGS |= {"start_distance": (1.0, 4.0)}
BREAKS = {"breaks": 1, "break_window": (0.2, 0.4)}
BUSY: dict[str, dict[str, Any]] = {
    "Team": {**SETTINGS, **BREAKS},
    "Solo": {**SETTINGS, "tracker_speed": 3.0},  # one alone runs into something only if it is fast
    "Tracker": {**SETTINGS, **BREAKS, "scenario": "radio", "num_trackers": 3, "number": 1},
}
E = 4


def vector(name: str = "posse/Team-v0", **settings: Any) -> TeamVectorEnv:
    env = gymnasium.make_vec(name, settings.pop("num_envs", E), vectorization_mode="vector_entry_point", **settings)
    assert isinstance(env, TeamVectorEnv)
    return env


@pytest.mark.parametrize("mode", AutoresetMode, ids=lambda mode: mode.value)
@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("name", BUSY)
def test_the_vector_environment_agrees_with_gymnasiums(name: str, discrete: bool, mode: AutoresetMode) -> None:
    name, settings = f"posse/{name}-v0", {**BUSY[name], "discrete_actions": discrete}
    ours: Any = vector(name, autoreset=mode, **settings)
    makers = [partial(gymnasium.make, name, first_world=i, **settings) for i in range(E)]
    theirs: Any = SyncVectorEnv(makers, autoreset_mode=mode)
    assert ours.autoreset_mode is ours.metadata["autoreset_mode"] is mode
    assert TeamVectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    for space in ("single_observation_space", "single_action_space", "observation_space", "action_space"):
        assert getattr(ours, space) == getattr(theirs, space), space
    assert same(ours.reset(seed=6), theirs.reset(seed=[6] * E))
    ours.action_space.seed(0)
    terminations = truncations = 0
    for _ in range(80):
        actions = ours.action_space.sample()
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert a.dtype == b.dtype
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=0)
        assert same(mine[4], other[4])
        terminations += mine[2].sum()
        truncations += mine[3].sum()
        ended = mine[2] | mine[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            again = [env.reset(options={"reset_mask": ended.copy()}) for env in (ours, theirs)]
            assert same(*again)
    assert terminations > 0
    assert truncations > 0


def test_every_world_is_drawn() -> None:
    env = vector(num_envs=2, render_mode="rgb_array")
    env.reset(seed=0)
    frames = env.render()
    assert frames is not None
    first, second = frames
    assert first.shape == second.shape
    assert not np.array_equal(first, second)
    env.close()
    env.close()
    assert env.closed
    (blind := vector(num_envs=1)).reset(seed=0)
    assert blind.render() is None
