"""One name, and one default, for one thing in all environments."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

import posse
from posse.adapters.gymnasium_env import SoloEnv, TeamEnv
from posse.adapters.pettingzoo_env import TeamParallelEnv
from posse.adapters.vector_env import SoloVectorEnv, TeamVectorEnv
from posse_baselines.tracker_env import TrackerEnv, TrackerVectorEnv
from posse_training.torchrl import PosseEnv

SINGLE = (TeamEnv, SoloEnv, TeamParallelEnv, TrackerEnv)
VECTORS = (TeamVectorEnv, SoloVectorEnv, TrackerVectorEnv, PosseEnv, posse.batch)
OWN: dict[str, set[str]] = {
    # The engine, where nothing is left to chance, and TorchRL's keys for all of an environment.
    "seed": {"batch"}
}
"""Parameters whose default differs on purpose, and where."""


def parameters(made: Any) -> dict[str, inspect.Parameter]:
    found = dict(inspect.signature(made).parameters)
    if made is PosseEnv:  # TorchRL's metaclass hides them
        found = dict(list(inspect.signature(made.__init__).parameters.items())[1:])
    bases = {TrackerVectorEnv: TeamVectorEnv, TrackerEnv: TeamEnv}
    if made in bases:  # the rest goes to its base as it is
        found = {**inspect.signature(bases[made]).parameters, **found}
    return found


def test_a_parameter_has_one_default_everywhere() -> None:
    defaults: dict[str, dict[Any, list[str]]] = {}
    for made in (*SINGLE, *VECTORS):
        for name, parameter in parameters(made).items():
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD and name not in ("num_envs", "num_worlds", "self"):
                if made.__name__ in OWN.get(name, ()):
                    continue
                defaults.setdefault(name, {}).setdefault(parameter.default, []).append(made.__name__)
    differing = {name: found for name, found in defaults.items() if len(found) > 1}
    assert not differing
    assert {"scenario", "discrete_actions", "split", "first_world"} <= set(defaults)


def test_the_target_is_an_agent_by_one_name() -> None:
    parallel = posse.parallel_env("smart", target="agent")
    assert posse.batch("smart", target="agent").scenario == parallel.scenario
    assert PosseEnv("smart", target="agent").batch.scenario == parallel.scenario
    assert posse.get_scenario("smart", target="agent") == parallel.scenario
    for made in (TeamEnv, SoloEnv, TrackerEnv, TeamVectorEnv):
        with pytest.raises(posse.ScenarioError, match="target"):
            made("smart", target="agent")
    others: tuple[Any, ...] = (posse.batch, PosseEnv, posse.parallel_env)
    for other in others:
        with pytest.raises(posse.ScenarioError, match="the one choice is 'agent'"):
            other("smart", target="evader")
