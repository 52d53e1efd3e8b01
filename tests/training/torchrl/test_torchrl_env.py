"""The batch in TorchRL: same numbers, TorchRL's names, partial resets."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from gymnasium.error import ResetNeeded
from tensordict import TensorDictBase
from torchrl.envs import SerialEnv
from torchrl.envs.utils import check_env_specs

import posse
from posse.adapters.actions import MOTIONS
from posse.signals.layout import StateLayout
from posse_baselines import PolicyError, load, load_target
from posse_baselines.safeguard import Guard
from posse_training.torchrl import PosseEnv

WORLDS = 6
SHORT: dict[str, Any] = {"horizon": 12, "settle_time": 0.5}


def some_actions(shape: tuple[int, ...], steps: int) -> npt.NDArray[np.float32]:
    return np.random.default_rng(3).uniform(-1, 1, (steps, *shape)).astype(np.float32)


def act(carried: TensorDictBase, actions: npt.NDArray[np.float32]) -> TensorDictBase:
    return carried.set(("agents", "action"), torch.from_numpy(actions))


def test_specs_hold() -> None:
    check_env_specs(PosseEnv("duel", WORLDS, target_policy=load_target("evader").policy, **SHORT), seed=1)
    env = PosseEnv("constant", WORLDS, target_motion="agent", num_trackers=3, message_size=3, **SHORT)
    check_env_specs(env, seed=1)
    assert env.full_action_spec["agents", "action"].shape == (WORLDS, 3, 5)
    assert env.group_map == {"agents": ["tracker_0", "tracker_1", "tracker_2"], "target": ["target_0"]}


def test_the_state_and_discrete_actions() -> None:
    env = PosseEnv("field", WORLDS, seed=5, state=True, discrete_actions=True, **SHORT)
    check_env_specs(env, seed=1)
    batch = posse.batch("field", WORLDS, seed=5, autoreset="disabled", **SHORT)
    layout = StateLayout(batch.scenario)
    carried, _ = env.reset(seed=5), batch.reset(seed=5)
    np.testing.assert_array_equal(carried["state"].numpy(), layout.vector(batch.arrays))
    numbers = np.random.default_rng(1).integers(0, 15, (WORLDS, 5))
    carried = env.step(carried.set(("agents", "action"), torch.from_numpy(numbers)))["next"]
    observations, *_ = batch.step(MOTIONS[numbers])
    np.testing.assert_array_equal(carried["agents", "observation"].numpy(), observations)
    np.testing.assert_array_equal(carried["state"].numpy(), layout.vector(batch.arrays))
    with pytest.raises(ValueError, match="is -1, outside 0 to 14"):
        env.step(carried.set(("agents", "action"), torch.from_numpy(np.full((WORLDS, 5), -1))))
    with pytest.raises(posse.ScenarioError, match="discrete_actions=True cannot encode messages"):
        PosseEnv("field", WORLDS, discrete_actions=True, message_size=1)


def test_steps_equal_those_of_the_batch() -> None:
    ending: dict[str, Any] = {"seed": 5, "terminate_on_contact": True, "start_distance": (1.0, 3.0)}
    env = PosseEnv("field", WORLDS, **ending)
    batch = posse.batch("field", WORLDS, autoreset="disabled", **ending)
    first = carried = env.reset()
    np.testing.assert_array_equal(first["agents", "observation"].numpy(), batch.reset())
    for actions in some_actions(batch.action_shape, 40):
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        following, carried = env.step_and_maybe_reset(act(carried, actions))
        now = following["next"]
        np.testing.assert_array_equal(now["agents", "observation"].numpy(), observations)
        np.testing.assert_array_equal(now["agents", "reward"].squeeze(-1).numpy(), rewards)
        np.testing.assert_array_equal(now["terminated"].squeeze(-1).numpy(), terminated)
        np.testing.assert_array_equal(now["truncated"].squeeze(-1).numpy(), truncated)
        np.testing.assert_array_equal(now["score"].squeeze(-1).numpy(), infos["score"])
        if terminated.any():
            observations = batch.reset(options={"reset_mask": terminated})
            np.testing.assert_array_equal(carried["agents", "observation"].numpy(), observations)
    assert len(set(batch.arrays.world["episode"])) > 1, "of some worlds alone"
    env.batch.arrays.world["score"] = 0.5
    assert not first["score"].any()


def test_behind_the_safeguard_actions_are_wanted_velocities() -> None:
    env = PosseEnv("smart", WORLDS, seed=5, safeguard=True, **SHORT)
    batch = posse.batch("smart", WORLDS, seed=5, autoreset="disabled", **SHORT)
    guard = Guard(batch.layout, WORLDS)
    carried, seen = env.reset(), batch.reset()
    carried["agents", "observation"].zero_()  # as below
    for wanted in some_actions(batch.action_shape, 30):
        seen, _, _, truncated, _ = batch.step(guard.actions(seen, wanted))
        following, carried = env.step_and_maybe_reset(act(carried, wanted))
        np.testing.assert_array_equal(following["next", "agents", "observation"].numpy(), seen)
        following["next", "agents", "observation"].zero_()  # the safeguard has seen it
        if truncated.any():
            seen = batch.reset(options={"reset_mask": truncated})
            guard.restart(truncated)
    check_env_specs(env, seed=1)
    with pytest.raises(ResetNeeded):
        PosseEnv("smart", WORLDS, safeguard=True).step(act(carried, wanted))
    with pytest.raises(PolicyError, match="discrete actions are no velocities"):
        PosseEnv("smart", WORLDS, safeguard=True, discrete_actions=True)


def test_a_seed_is_of_the_next_reset_alone() -> None:
    env = PosseEnv("constant", 1)
    env.set_seed(3)
    starts = [env.reset()["agents", "observation"] for _ in range(2)]
    assert (starts[0] != starts[1]).any()


def test_the_ends_of_episodes_reach_serial_environments() -> None:
    rolled = SerialEnv(2, lambda: PosseEnv("smart", WORLDS, horizon=5)).rollout(8)
    assert rolled["next", "done"].sum(dim=2).flatten().tolist() == [1] * (2 * WORLDS)


def test_a_choice_of_autoreset_or_of_a_team_is_refused() -> None:
    with pytest.raises(TypeError, match=r"autoreset='same_step'.*leave it out"):
        PosseEnv("constant", WORLDS, autoreset="same_step")
    with pytest.raises(TypeError, match="team_policy= is not possible"):
        PosseEnv("constant", WORLDS, team_policy=load("pursuit"))


def test_a_step_of_some_worlds_alone_is_refused() -> None:
    env = PosseEnv("constant", 64, terminate_on_contact=True, start_distance=(1.0, 2.5), **SHORT)
    with pytest.raises(NotImplementedError, match="break_when_any_done=False"):
        env.rollout(12, break_when_all_done=True, break_when_any_done=False)
