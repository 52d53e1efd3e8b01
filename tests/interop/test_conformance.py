"""The checkers of other libraries find every registered scenario sound, and variants with other settings."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from gymnasium.wrappers import FlattenObservation
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test, seed_test
from stable_baselines3.common.env_checker import check_env as sb3_check
from torchrl.envs import GymEnv, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

import posse
import posse_baselines  # noqa: F401  registers posse/Tracker-v0

Settings = dict[str, Any]
VARIANTS: dict[str, Settings] = {
    **{name: {"scenario": name} for name in posse.scenario_names()},
    "discrete actions, a rectangle": {"scenario": "obstacles", "discrete_actions": True, "arena": (26.0, 16.0)},
    "one tracker": {"scenario": "constant", "num_trackers": 1},
    "messages": {"scenario": "field", "message_size": 2},
    "the target an agent": {"scenario": "smart", "target_motion": "agent"},
}
KEYS = {"score", *(f"reward/{t.name}" for t in posse.REWARD_TERMS), *(f"metrics/{m.name}" for m in posse.METRICS)}


def parallel(settings: Settings) -> Any:
    return posse.parallel_env(**settings, horizon=40)


def types_of(info: dict[str, Any]) -> dict[str, Any]:
    return {key: (type(value), np.shape(value), np.asarray(value).dtype) for key, value in info.items()}


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL", "ignore:Environment's m:UserWarning")
@pytest.mark.parametrize("variant", VARIANTS)
def test_environments_of_many_agents_conform(variant: str) -> None:
    settings = VARIANTS[variant]
    parallel_api_test(parallel(settings), num_cycles=100)
    parallel_seed_test(lambda: parallel(settings))
    api_test(posse.env(**settings, horizon=40), num_cycles=100)
    seed_test(lambda: posse.env(**settings), num_cycles=20)
    check_env_specs(PettingZooWrapper(parallel(settings), return_state=True))


@pytest.mark.parametrize("variant", VARIANTS)
def test_what_is_returned_lies_in_its_spaces_and_infos_keep_their_keys_and_types(variant: str) -> None:
    env = parallel(VARIANTS[variant])
    seen, infos = env.reset(seed=1)
    types = types_of(infos["tracker_0"])
    assert types.keys() - {"working"} == KEYS
    assert ("working" in types) == (env.scenario.breaks > 0)
    while True:
        assert all(env.observation_space(agent).contains(row) for agent, row in seen.items())
        assert env.state_space.contains(env.state())
        assert all(types_of(info) == types for info in infos.values())
        if not env.agents:
            return
        seen, rewards, *_, infos = env.step({agent: env.action_space(agent).sample() for agent in env.agents})
        assert np.isfinite(list(rewards.values())).all()


def test_an_environment_in_turns_can_draw() -> None:
    render_test(posse.env)


@pytest.mark.parametrize("variant", [name for name in VARIANTS if "target_motion" not in VARIANTS[name]])
@pytest.mark.parametrize("name", ["Team", "Solo", "Tracker"])
def test_environments_of_one_agent_conform(name: str, variant: str) -> None:
    settings = {**VARIANTS[variant], "horizon": 8}
    if name == "Solo":
        settings |= {"num_trackers": 1, "breaks": 0}
    elif name == "Tracker" and variant == "one tracker":
        settings["num_trackers"] = 2
    env = gymnasium.make(f"posse/{name}-v0", **settings)
    gymnasium_check(env.unwrapped, skip_render_check=variant != "smart")
    sb3_check(FlattenObservation(env) if name == "Team" else env.unwrapped)  # networks of SB3 take vectors
    check_env_specs(GymEnv(f"posse/{name}-v0", **settings))
    types, ended = types_of(env.reset(seed=1)[1]), False
    assert types.keys() - {"working"} == KEYS
    while not ended:
        seen, _, _, ended, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(seen)
        assert types_of(info) == types
    assert info["metrics/duration"] == pytest.approx(0.8)


def test_the_metrics_of_worlds_that_go_on_cannot_be_written() -> None:
    batch = posse.batch(num_worlds=3)
    batch.reset()
    with pytest.raises(ValueError, match="read-only"):
        batch.step(np.zeros(batch.action_shape))[-1]["metrics/duration"][0] = 1.0
