"""What other libraries expect of every environment: keys of infos, refused keywords, bounds."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

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
