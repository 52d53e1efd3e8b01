"""What other libraries expect of every environment: keys of infos, refused keywords, bounds."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from torchrl.envs import GymEnv, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

import posse
import posse_baselines  # noqa: F401  registers posse/Tracker-v0

BREAKING = [name for name in posse.scenario_names() if posse.get_scenario(name).breaks > 0]
SHORT: dict[str, Any] = {"horizon": 4}
KEYS = {"score", *(f"reward/{t.name}" for t in posse.REWARD_TERMS), *(f"metrics/{m.name}" for m in posse.METRICS)}


def shape_of(info: Any) -> Any:
    """Return the keys of an info and the types of its values."""
    return {key: (type(value), np.shape(value), np.asarray(value).dtype) for key, value in info.items()}


def run(env: Any, steps: int, action: Any) -> list[dict[str, Any]]:
    infos = [env.reset(seed=1)[1]]
    return infos + [env.step(action)[-1] for _ in range(steps)]


@pytest.mark.parametrize("scenario", ["smart", BREAKING[0]])
@pytest.mark.parametrize("name", ["Team", "Tracker", "Solo", "parallel"])
def test_info_keeps_its_keys_and_types(name: str, scenario: str) -> None:
    settings: dict[str, Any] = {**SHORT, "scenario": scenario, "break_window": (0.1, 0.3)}
    if name == "Solo":
        settings["breaks"] = 0
    if name == "parallel":
        parallel = posse.parallel_env(**settings)
        infos = run(parallel, 4, dict.fromkeys(parallel.possible_agents, np.zeros(2, np.float32)))
        infos = [info for each in infos for info in each.values()]
    else:
        env = gymnasium.make(f"posse/{name}-v0", **settings)
        infos = run(env, 4, np.zeros(env.action_space.shape or (), np.float32))
    working = {"working"} if scenario in BREAKING and name != "Solo" else set()
    assert infos[0].keys() == KEYS | working
    assert all(shape_of(info) == shape_of(infos[0]) for info in infos)
    assert all(info["metrics/settling_time"] == 0 for info in infos[:4])
    assert infos[-1]["metrics/duration"] == pytest.approx(0.4)


@pytest.mark.parametrize("autoreset", ["next_step", "same_step", "disabled"])
def test_infos_of_batches_and_vectors_keep_their_keys(autoreset: str) -> None:
    batch = posse.batch(BREAKING[0], 3, autoreset=autoreset, **SHORT)
    batch.reset()
    infos = [batch.step(np.zeros(batch.action_shape))[-1] for _ in range(4)]
    assert infos[0].keys() == KEYS | {"working"} | ({"final_obs"} if autoreset == "same_step" else set())
    assert all(shape_of(info) == shape_of(infos[0]) for info in infos)
    assert all((info["metrics/duration"] == 0).all() for info in infos[:-1])
    assert infos[-1]["metrics/duration"] == pytest.approx(0.4)
    with pytest.raises(ValueError, match="read-only"):
        infos[0]["metrics/duration"][0] = 1.0
    for name in ("Team", "Tracker"):
        env = gymnasium.make_vec(f"posse/{name}-v0", 3, scenario=BREAKING[0], autoreset=autoreset, **SHORT)
        told = run(env, 4, np.zeros(env.action_space.shape or (), np.float32))
        last = told[-1]["final_info"] if autoreset == "same_step" else told[-1]
        assert told[0].keys() == last.keys() == KEYS | {"working"} | {f"_{key}" for key in (*KEYS, "working")}
        assert last["metrics/duration"] == pytest.approx(0.4)


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL")
def test_torchrl_wraps_the_pettingzoo_environment() -> None:
    env = PettingZooWrapper(posse.parallel_env("constant"))
    assert env.rollout(5)["next", "tracker", "info", "reward/slot"].shape == (5, 5)
    check_env_specs(PettingZooWrapper(posse.parallel_env("constant", target="agent"), return_state=True))


@pytest.mark.parametrize("name", ["posse:posse/Team-v0", "posse:posse/Solo-v0"])
def test_torchrl_starts_processes_of_its_own(name: str) -> None:
    envs = GymEnv(name, num_envs=2, scenario="smart", **SHORT)
    check_env_specs(envs)
    rollout = envs.rollout(6, break_when_any_done=False)
    assert rollout["next", "reward/slot"].shape[:2] == (2, 6)
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
