"""Training settings: checked before a run folder is made, and read from files without code."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import quiet, small

import posse
from posse_baselines import PolicyError
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.train import TrainSettings, default_settings, read_settings
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.train import resume, train


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", [*posse.scenario_names(), "smart,radio"])
def test_every_scenario_has_defaults(scenario: str, algorithm: str) -> None:
    found = default_settings(scenario, algorithm, preset="residual")
    assert TrainSettings.from_dict(json.loads(json.dumps(found.to_dict()))) == found


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 0}, r"steps=0 must lie in \[1, 1000000000000\]"),
        ({"steps": 1.5}, "steps=1.5 must be a whole number"),
        ({"steps": True}, "steps=True must be a whole number"),
        ({"steps": "many"}, "steps='many' must be"),
        ({"seed": 2**40}, "seed=1099511627776 must lie in"),
        ({"discount": 1.5}, r"discount=1.5 must lie in \[0, 1\]"),
        ({"discount": "x"}, "discount='x' must be a number"),
        ({"learning_rate": float("nan")}, "learning_rate=nan"),
        ({"log_deviation": 1e9}, "log_deviation="),
        ({"hidden": ()}, "hidden"),
        ({"hidden": (0,)}, "hidden=0 is invalid: it must be a whole number in"),
        ({"hidden": 3}, "hidden=3"),
        ({"team_sizes": (1.5,)}, "team_sizes=1.5"),
        ({"num_neighbours": -1}, "num_neighbours=-1"),
        ({"num_worlds": 1, "team_sizes": (2, 3)}, "num_worlds=1"),
        ({"imitate": "pursuit", "algorithm": "sac"}, "needs algorithm ppo or mappo, not sac: leave it out"),
        ({"contact_bound": 0.1, "algorithm": "td3"}, "ppo or mappo, not td3"),
        ({"algorithm": "dqn"}, "algorithm='dqn' is unknown; known: ppo"),
        ({"encoding": ["plain"]}, "encoding="),
        ({"beside": "x" * 5000}, r"beside='x.*1 to 4096 characters"),
        ({"safeguard": True, "advise": "ddcs-tuned"}, "safeguard=True goes with neither advise nor imitate"),
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


def test_unknown_settings() -> None:
    with pytest.raises(SettingsError, match="unknown setting 'stepz'"):
        TrainSettings.from_dict({"stepz": 3})


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("seed", str(2**40)),
        ("seed", "-1"),
        ("steps", str(10**30)),
        ("hidden", str(10**9)),
        ("beside", "nobody"),
        ("imitate", "nobody"),
        ("advise", "planner"),
        ("beside", ":x"),
        ("wandb", "project"),
        ("scenario", "x" * 5000),
    ],
)
def test_nothing_is_made_before_settings_are_checked(
    tmp_path: Path, option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [f"--{option}", value, "--folder", str(tmp_path / "run")]
    scenario = [] if option == "scenario" else ["--scenario", "constant"]
    try:
        status: Any = main(["train", *scenario, *arguments])
    except SystemExit as error:  # of the parser
        status = error.code
    shown = capsys.readouterr().err
    assert status == 2
    assert option in shown or value in shown
    assert not (tmp_path / "run").exists()


def write(folder: Path, **changes: Any) -> Path:
    """A settings file with code to import."""
    folder.mkdir(exist_ok=True)
    path = folder / "settings.json"
    path.write_text(json.dumps({**small(folder).to_dict(), "folder": None, **changes}))
    return path


CODE = """
from pathlib import Path
Path(__file__).with_name("it_ran").touch()
from posse_baselines import BasePolicy
class Thing(BasePolicy):
    pass
"""


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module that leaves a file behind when it is imported."""
    (tmp_path / "planted.py").write_text(CODE)
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("planted", None)
    return tmp_path


class TestSomebodyElsesFolder:
    @pytest.mark.parametrize("name", ["advise", "beside", "imitate"])
    @pytest.mark.parametrize("value", ["planted:Thing", "planted:nothing", ":x", "nobody", 3, [1]])
    def test_no_code_is_imported(self, planted: Path, name: str, value: Any) -> None:
        path = write(planted / "run", **{name: value})
        for ask in (
            lambda: read_settings(path),
            lambda: resume(planted / "run", console=quiet()),
            lambda: resume(planted / "run", steps=3, console=quiet()),
        ):
            with pytest.raises(SettingsError, match=f"as '{name}'.*--trust-code"):
                ask()
        assert not (planted / "it_ran").exists()
        assert [file.name for file in (planted / "run").iterdir()] == ["settings.json"]

    @pytest.mark.parametrize("command", [["train", "--resume"]])
    def test_no_command_imports_it(self, planted: Path, command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
        write(planted / "run", beside="planted:Thing")
        assert main([*command, str(planted / "run")]) == 2
        assert "'planted:Thing' as 'beside'" in capsys.readouterr().err
        assert not (planted / "it_ran").exists()

    def test_who_trusts_it_says_so(self, planted: Path) -> None:
        write(planted / "run", beside="planted:Thing")
        with pytest.raises(PolicyError, match="is not a policy: it must have"):
            resume(planted / "run", console=quiet(), trust_code=True)
        assert (planted / "it_ran").exists()

    def test_shipped_policies_and_files_are_taken(self, tmp_path: Path) -> None:
        file = train(small(tmp_path / "first"), console=quiet())
        for k, policy in enumerate(("pursuit", "learned-smart", str(file))):
            assert read_settings(write(tmp_path / f"{k}", beside=policy)).beside == policy


@pytest.mark.parametrize(
    "text",
    [
        "{",
        '{"a":' * 100_000,
        "[]",
        "null",
        '{"steps": null}',
        '{"steps": NaN}',
        '{"hidden": {"a": 1}}',
        '{"overrides": {"horizon": "x"}}',
        '{"reward_weights": {"slot": []}}',
        '{"folder": 3}',
    ],
)
def test_damaged_settings(tmp_path: Path, text: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises((SettingsError, posse.ScenarioError)):
        resume(tmp_path, console=quiet())
    assert [file.name for file in tmp_path.iterdir()] == ["settings.json"]
