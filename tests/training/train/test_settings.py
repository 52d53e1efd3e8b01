"""Training settings: checked before a run folder is made, and read from files without code."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.runs import resume

import posse
from posse_training.errors import SettingsError
from posse_training.train import TrainSettings, default_settings
from posse_training.train.algorithms import ALGORITHMS


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", [*posse.scenario_names(), "smart,radio"])
def test_every_scenario_has_defaults(scenario: str, algorithm: str) -> None:
    found = {"nothing": default_settings(scenario, algorithm)}
    if ALGORITHMS[algorithm].on_policy:
        found["residual"] = default_settings(scenario, algorithm, preset="residual")
    else:
        with pytest.raises(SettingsError, match="goes with ppo or mappo"):
            default_settings(scenario, algorithm, preset="residual")
    for preset, settings in found.items():
        assert TrainSettings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings
        assert settings.advise == {"nothing": None, "residual": "ddcs-tuned"}[preset]
        assert settings.safeguard == (preset == "nothing")
        assert (settings.imitate, settings.end_on_contact) == (None, True)
    assert replace(found["nothing"], scenario="smart") == default_settings("smart", algorithm, preset="nothing")


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"steps": NaN}',
        '{"steps": 1.5}',
        '{"side": "neither"}',
        '{"overrides": [1]}',
        '{"hidden": {"a": 1}}',
        '{"reward_weights": {"slot": []}}',
    ],
)
def test_damaged_settings(tmp_path: Path, text: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises((SettingsError, posse.ScenarioError)):
        resume(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["settings.json"]
