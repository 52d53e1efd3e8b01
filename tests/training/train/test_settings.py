"""Training settings: checked before a run folder is made, and read from files without code."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import resume

import posse
from posse_training.errors import SettingsError
from posse_training.train import TrainSettings, default_settings
from posse_training.train.algorithms import ALGORITHMS, check_algorithm


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", [*posse.scenario_names(), "smart,radio"])
def test_every_scenario_has_defaults(scenario: str, algorithm: str) -> None:
    found = {
        "nothing": default_settings(scenario, algorithm),
        "residual": default_settings(scenario, preset="residual"),
    }
    for preset, settings in found.items():
        assert TrainSettings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings
        assert settings.advise == {"nothing": None, "residual": "ddcs-tuned"}[preset]
        assert settings.safeguard == (preset == "nothing")
        assert (settings.imitate, settings.end_on_contact) == (None, True)
    assert replace(found["nothing"], scenario="smart") == default_settings("smart", algorithm, preset="nothing")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 0}, r"steps=0 must lie in \[1, 1000000000000\]"),
        ({"steps": 1.5}, "steps=1.5 must be a whole number"),
        ({"discount": 1.5}, r"discount=1.5 must lie in \[0, 1\]"),
        ({"learning_rate": float("nan")}, "learning_rate=nan"),
        ({"hidden": (0,)}, "hidden=.* is invalid: it must be whole numbers of at least 1"),
        ({"num_worlds": 1, "team_sizes": (2, 3)}, "num_worlds=1"),
        ({"overrides": [1]}, r"overrides=\[1\]"),
        ({"overrides": {"name": "x"}}, "overrides cannot set 'name'"),
        ({"overrides": {"message_size": 3}}, "use the setting message_size"),
        ({"overrides": {"num_trackers": 3}, "team_sizes": (2,)}, "use the setting team_sizes"),
        ({"advise": "ddcs-distributed"}, "needs algorithm cmaes, not ppo"),
        ({"log_deviation": -1.0, "final_log_deviation": 0.0}, "final_log_deviation=0.0 must not exceed"),
        ({"imitate": "pursuit", "algorithm": "sac"}, "needs algorithm ppo or mappo, not sac: leave it out"),
        ({"algorithm": "dqn"}, "unknown algorithm 'dqn'; algorithms are: ppo"),
    ],
)
def test_impossible_settings(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        check_algorithm(replace(TrainSettings(), **changes))


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"steps": NaN}', '{"hidden": {"a": 1}}', '{"reward_weights": {"slot": []}}']
)
def test_damaged_settings(tmp_path: Path, text: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises((SettingsError, posse.ScenarioError)):
        resume(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["settings.json"]
