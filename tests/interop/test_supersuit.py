"""SuperSuit's wrappers take our environments, and what they return lies in their spaces."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import posse

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it imports PettingZoo by names of older releases
    import supersuit

WRAPPERS: dict[str, Callable[[Any], Any]] = {
    "action_lambda": lambda e: supersuit.action_lambda_v1(e, lambda a, s: a, lambda s: s),
    "agent_indicator": supersuit.agent_indicator_v0,
    "agent_indicator by type": lambda e: supersuit.agent_indicator_v0(e, type_only=True),
    "black_death": supersuit.black_death_v3,
    "clip_actions": supersuit.clip_actions_v0,
    "clip_reward": supersuit.clip_reward_v0,
    "delay_observations": lambda e: supersuit.delay_observations_v0(e, 2),
    "dtype": lambda e: supersuit.dtype_v0(e, np.dtype("float64")),
    "flatten": supersuit.flatten_v0,
    "frame_skip": lambda e: supersuit.frame_skip_v0(e, (1, 3)),
    "frame_stack 1": lambda e: supersuit.frame_stack_v1(e, 3),
    "frame_stack 2": lambda e: supersuit.frame_stack_v2(e, 3),
    "max_observation": lambda e: supersuit.max_observation_v0(e, 2),
    "nan_noop": lambda e: supersuit.nan_noop_v0(e, np.zeros(2, np.float32)),
    "nan_random": supersuit.nan_random_v0,
    "nan_zeros": supersuit.nan_zeros_v0,
    "normalize_obs": supersuit.normalize_obs_v0,
    "observation_lambda": lambda e: supersuit.observation_lambda_v0(e, lambda o, s: o),
    "pad_action_space": supersuit.pad_action_space_v0,
    "pad_observations": supersuit.pad_observations_v0,
    "reshape": lambda e: supersuit.reshape_v0(e, (2, -1)),
    "reward_lambda": lambda e: supersuit.reward_lambda_v0(e, lambda r: 2 * r),
    "scale_actions": lambda e: supersuit.scale_actions_v0(e, 0.5),
    "sticky_actions": lambda e: supersuit.sticky_actions_v0(e, 0.3),
}


@pytest.mark.parametrize("name", WRAPPERS)
def test_wrapped_observations_lie_in_the_wrapped_space(name: str) -> None:
    plain = posse.parallel_env("smart", target="agent", seed=0)
    if name == "reshape":
        size = plain.observation_space("tracker_0").shape[0]  # type: ignore[index]
        env = supersuit.reshape_v0(plain, (2, size // 2))
    else:
        env = WRAPPERS[name](plain)
    observations, _ = env.reset(seed=1)
    for _ in range(3):
        for agent, observation in observations.items():
            space = env.observation_space(agent)
            if "indicator" in name:
                # SuperSuit marks with the greatest of the upper bounds, and bounds the mark by the
                # least of them.
                size = plain.observation_space(agent).shape[0]  # type: ignore[index]
                assert np.count_nonzero(observation[size:]) == 1
                observation = np.minimum(observation, space.high)
            assert space.contains(observation)
        observations, *_ = env.step({a: env.action_space(a).sample() for a in env.agents})
    assert len(env.agents) == 6


@pytest.mark.parametrize("scenario", posse.scenario_names())
def test_an_indicator_beside_normalised_observations_lies_in_its_space(scenario: str) -> None:
    env = supersuit.agent_indicator_v0(supersuit.normalize_obs_v0(posse.parallel_env(scenario)))
    observations, _ = env.reset(seed=1)
    assert all(env.observation_space(a).contains(o) for a, o in observations.items())


@pytest.mark.parametrize("base", ["gymnasium", "stable_baselines3"])
def test_a_team_as_a_vector(base: str) -> None:
    made = supersuit.pettingzoo_env_to_vec_env_v1(posse.parallel_env("smart"))
    env = supersuit.concat_vec_envs_v1(made, 2, num_cpus=1, base_class=base)
    observations = env.reset()
    observations = observations if base == "stable_baselines3" else observations[0]
    assert observations.shape == (10, 82)
    actions = np.zeros((10, 2), np.float32)
    assert env.step(actions)[0].shape == (10, 82)
