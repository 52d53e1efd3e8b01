"""Training settings: checked before a run folder is made, and read from files without code."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import resume

import posse
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.train import TrainSettings, default_settings
from posse_training.train.algorithms import ALGORITHMS, check_algorithm


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", [*posse.scenario_names(), "smart,radio"])
def test_every_scenario_has_defaults(scenario: str, algorithm: str) -> None:
    for preset in ("nothing", "residual") if ALGORITHMS[algorithm].on_policy else ("nothing",):
        found = default_settings(scenario, algorithm, preset=preset)
        assert TrainSettings.from_dict(json.loads(json.dumps(found.to_dict()))) == found
    if not ALGORITHMS[algorithm].on_policy:
        with pytest.raises(SettingsError, match="goes with ppo or mappo"):
            default_settings(scenario, algorithm, preset="residual")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 0}, r"steps=0 must lie in \[1, 1000000000000\]"),
        ({"steps": 1.5}, "steps=1.5 must be a whole number"),
        ({"discount": 1.5}, r"discount=1.5 must lie in \[0, 1\]"),
        ({"learning_rate": float("nan")}, "learning_rate=nan"),
        ({"hidden": (0,)}, "hidden=.* is invalid: it must be whole numbers of at least 1"),
        ({"num_worlds": 1, "team_sizes": (2, 3)}, "num_worlds=1"),
        ({"safeguard": True, "advise": "ddcs-tuned"}, "safeguard=True goes with neither advise"),
        ({"overrides": [1]}, r"overrides=\[1\]"),
        ({"overrides": {"name": "x"}}, "overrides cannot set 'name'"),
        ({"overrides": {"message_size": 3}}, "use the setting message_size"),
        ({"overrides": {"num_trackers": 3}, "team_sizes": (2,)}, "use the setting team_sizes"),
    ],
)
def test_impossible_settings(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        replace(TrainSettings(), **changes)


def test_the_preset_nothing_learns_from_random_weights_on_every_scenario() -> None:
    for scenario in (*posse.scenario_names(), "smart,radio"):
        found = default_settings(scenario, preset="nothing")
        assert (found.advise, found.imitate, found.safeguard, found.end_on_contact) == (None, None, True, True)
        assert replace(found, scenario="smart") == default_settings("smart", preset="nothing")
    assert default_settings("smart") == default_settings("smart", preset="nothing")
    assert default_settings("smart", preset="residual").advise == "ddcs-tuned"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"imitate": "pursuit", "algorithm": "sac"}, "needs algorithm ppo or mappo, not sac: leave it out"),
        ({"algorithm": "dqn"}, "unknown algorithm 'dqn'; algorithms are: ppo"),
    ],
)
def test_what_an_algorithm_cannot_do(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        check_algorithm(replace(TrainSettings(), **changes))


@pytest.mark.parametrize(
    "words",
    f"seed -1;seed {2**40};steps {10**30};beside nobody;imitate nobody;advise planner;beside :x;wandb project".split(
        ";"
    ),
)
def test_nothing_is_made_before_settings_are_checked(
    tmp_path: Path, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    option, value = words.split()
    try:
        status: Any = main(["train", "--scenario", "constant", f"--{option}", value, "--out", str(tmp_path / "run")])
    except SystemExit as error:  # of the parser
        status = error.code
    shown = capsys.readouterr().err
    assert status == 2
    assert option in shown or value in shown
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "null",
        '{"steps": null}',
        '{"steps": NaN}',
        '{"hidden": {"a": 1}}',
        '{"reward_weights": {"slot": []}}',
    ],
)
def test_damaged_settings(tmp_path: Path, text: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises((SettingsError, posse.ScenarioError)):
        resume(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["settings.json"]
