"""What other libraries expect of every environment: keys of infos, refused keywords, bounds."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from torchrl.envs import GymEnv
from torchrl.envs.utils import check_env_specs

import posse
import posse_baselines  # noqa: F401  registers posse/Tracker-v0

BREAKING = [name for name in posse.scenario_names() if posse.get_scenario(name).breaks > 0]
SHORT: dict[str, Any] = {"horizon": 4, "settle_time": 0.2}


def shape_of(info: Any) -> Any:
    """Return the keys of an info and the types of its values, nested."""
    if isinstance(info, dict):
        return {key: shape_of(value) for key, value in info.items()}
    return (type(info), getattr(info, "shape", None), getattr(info, "dtype", None))


@pytest.mark.parametrize("scenario", ["smart", BREAKING[0]])
@pytest.mark.parametrize("name", ["posse/Team-v0", "posse/Tracker-v0", "posse/Solo-v0"])
def test_info_keeps_its_keys_and_types(name: str, scenario: str) -> None:
    if name == "posse/Solo-v0" and scenario != "smart":
        pytest.skip("one tracker cannot play it")
    env = gymnasium.make(name, scenario=scenario, break_window=(0.1, 0.3), **SHORT)
    shapes = [shape_of(env.reset(seed=1)[1])]
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        over = terminated or truncated
        shapes.append(shape_of(info))
    assert len(shapes) == 5
    assert all(shape == shapes[0] for shape in shapes)
    assert {"score", "reward_terms", "metrics"} <= shapes[0].keys()


def test_infos_of_agents_keep_their_keys_and_types() -> None:
    env = posse.parallel_env(BREAKING[0], break_window=(0.1, 0.3), **SHORT)
    infos = [env.reset(seed=1)[1]]
    while env.agents:
        infos.append(env.step({agent: np.zeros(2, np.float32) for agent in env.agents})[-1])
    assert all(shape_of(info) == shape_of(infos[0]) for info in infos)


def flat(info: dict[str, Any]) -> dict[str, Any]:
    """Return an info with nested names joined, written out for the two names that are nested."""
    nested = {f"{name}/{key}": value for name in ("reward_terms", "metrics") for key, value in info[name].items()}
    return {k: v for k, v in info.items() if not isinstance(v, dict)} | nested


@pytest.mark.parametrize("name", ["posse/Team-v0", "posse/Tracker-v0", "posse/Solo-v0"])
def test_flat_infos_hold_the_same(name: str) -> None:
    env, other = (gymnasium.make(name, scenario="smart", flat_infos=told, **SHORT) for told in (False, True))
    infos = [(env.reset(seed=1)[1], other.reset(seed=1)[1])]
    for _ in range(4):
        action = np.zeros(env.action_space.shape or (), np.float32)
        infos.append((env.step(action)[-1], other.step(action)[-1]))
    for nested, found in infos:
        np.testing.assert_equal(found, flat(nested))
    assert infos[-1][1]["metrics/duration"] > 0.0


@pytest.mark.parametrize("autoreset", ["next_step", "same_step"])
@pytest.mark.parametrize("name", ["posse/Team-v0", "posse/Tracker-v0", "posse/Solo-v0"])
def test_flat_infos_of_many_worlds_hold_the_same(name: str, autoreset: str) -> None:
    env, other = (
        gymnasium.make_vec(
            name,
            3,
            vectorization_mode="vector_entry_point",
            scenario="smart",
            seed=1,
            autoreset=autoreset,
            flat_infos=told,
            **SHORT,
        )
        for told in (False, True)
    )
    infos = [(env.reset()[1], other.reset()[1])]
    for _ in range(4):
        action = np.zeros(env.action_space.shape or (), np.float32)
        infos.append((env.step(action)[-1], other.step(action)[-1]))
    for nested, found in infos:
        assert not any(isinstance(v, dict) for k, v in found.items() if k != "final_info")
        for entry in ("score", "reward_terms/slot", "metrics/safe_score"):
            outer, _, inner = entry.partition("/")
            wanted = nested[outer][inner] if inner else nested[outer]
            np.testing.assert_array_equal(found[entry], wanted)
            np.testing.assert_array_equal(found[f"_{entry}"], nested[f"_{outer}"])
    last = infos[-1][1]
    ended = last["final_info"] if autoreset == "same_step" else last
    assert ended["metrics/duration"].all()


@pytest.mark.parametrize("name", ["posse:posse/Team-v0", "posse:posse/Solo-v0"])
def test_torchrl_starts_processes_of_its_own(name: str) -> None:
    envs = GymEnv(name, num_envs=2, scenario="smart", flat_infos=True, **SHORT)
    check_env_specs(envs)
    rollout = envs.rollout(6, break_when_any_done=False)
    assert rollout["next", "reward_terms/slot"].shape[:2] == (2, 6)
    assert rollout["next", "done"].sum() == 2
    envs.close()


@pytest.mark.parametrize("scenario", BREAKING)
def test_solo_says_why_it_cannot_play(scenario: str) -> None:
    with pytest.raises(posse.ScenarioError, match=rf"{scenario!r} does not fit posse/Solo-v0.*"):
        gymnasium.make("posse/Solo-v0", scenario=scenario)
    gymnasium.make("posse/Solo-v0", scenario=scenario, breaks=0).reset(seed=0)


def test_an_unknown_keyword_is_a_type_error_too() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'") as caught:
        gymnasium.make("posse/Team-v0", frameskip=1)
    assert isinstance(caught.value, posse.ScenarioError)


@pytest.mark.parametrize("scenario", posse.scenario_names())
def test_bounds_of_settings_hold_0_1_and_the_setting(scenario: str) -> None:
    batch = posse.batch(scenario, seed=1)
    views = batch.layout.views(batch.reset())
    for name in ("team_size", "tolerance", "robot_radius", "sensing_range", "arena"):
        field = next(each for each in batch.layout.fields if each.name == name)
        for held in (0.0, 1.0, float(views[name].flat[0])):
            assert field.low <= held <= field.high, (name, held)
