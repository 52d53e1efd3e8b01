"""Training settings: checked before a run folder is made, and read from files without code."""

import hashlib
import importlib
import json
import subprocess
from pathlib import Path

import pytest
from tests.support.runs import resume

import posse
from posse.declarations import FIELDS
from posse_training import provenance
from posse_training.errors import SettingsError
from posse_training.train import TrainSettings, default_settings
from posse_training.train.algorithms import ALGORITHMS


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", [*posse.scenario_names(), "smart,radio", "family-open,family-arena"])
def test_every_scenario_has_defaults(scenario: str, algorithm: str) -> None:
    for preset in ("nothing", "residual"):
        settings = default_settings(scenario, algorithm if preset == "nothing" else None, preset=preset)
        assert TrainSettings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings
        assert settings.safeguard == (settings.advise is None) == (preset == "nothing")


@pytest.mark.parametrize(
    ("scenario", "algorithm"), [("search", "cmaes"), ("search, field", "cmaes"), ("search,smart", "ppo")]
)
def test_the_scenario_decides_on_the_algorithm(scenario: str, algorithm: str) -> None:
    assert default_settings(scenario).algorithm == algorithm
    assert default_settings(scenario, side="target").algorithm == "ppo"


def test_where_poses_drift_the_safeguard_adds_its_messages() -> None:
    for scenario, size in (("robots", 7), ("smart", 2), ("smart,robots", 7)):
        settings = TrainSettings(scenario=scenario, message_size=2, safeguard=True)
        assert {given.message_size for given in settings.given} == {size}


def test_a_run_holds_the_code_of_its_rules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    text = 'import posse\n\n\n@posse.field("1", 0, 9)\ndef gauge(c):\n    """One."""\n    return 1.0\n'
    (tmp_path / "gauges.py").write_text(text)
    importlib.import_module("gauges")
    held = TrainSettings(scenario="constant", overrides={"extra_fields": ("gauge",)}).held()
    FIELDS.pop("gauge")
    assert held["digest of gauges:rules"] == hashlib.sha256(text.encode()).hexdigest()[:12]
    assert "digest of gauges:rules" not in TrainSettings(scenario="constant").held()


def test_the_commit_is_not_that_of_another_repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for words in ("init -q", "-c user.name=a -c user.email=a@b.c commit -q --allow-empty -m one"):
        subprocess.run(["git", *words.split()], cwd=tmp_path, check=True)
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    assert provenance.commit() is None


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"steps": NaN}',
        '{"steps": true}',
        '{"log_deviation": -1, "final_log_deviation": 0}',
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
