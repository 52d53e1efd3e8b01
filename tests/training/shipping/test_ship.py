"""Shipping: the best of several training seeds, with the scores of all seeds."""

from __future__ import annotations

import json
import shlex
import shutil
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
import tyro
from rich.console import Console

from posse_baselines.learned import LearnedPolicy
from posse_training import evaluate
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.runs import TrainSettings, default_settings
from posse_training.runs.saved.command import command_of
from posse_training.runs.train import train
from posse_training.shipping.check import replay
from posse_training.shipping.ship import CHOICE_SEED, Settings, ship

SETTINGS = TrainSettings(
    scenario="constant",
    steps=640,
    num_worlds=4,
    team_sizes=(2, 3),
    overrides={"horizon": 40, "settle_time": 1.0},
    hidden=(8,),
    minibatch=64,
    rollout=20,
    evaluate_every=320,
    evaluate_worlds=2,
    beside=None,
    tensorboard=False,
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """Run folders of three training seeds."""
    folder = tmp_path_factory.mktemp("runs")
    for seed in (1, 2, 3):
        settings = replace(SETTINGS, seed=seed, folder=folder / str(seed))
        train(settings, console=Console(file=StringIO()))
    return tuple(folder / str(seed) for seed in (1, 2, 3))


def test_the_best_seed_is_shipped_and_all_are_on_record(runs: tuple[Path, ...], tmp_path: Path) -> None:
    path = ship(Settings(runs, "learned-trial", worlds=10, out=tmp_path))
    shipped = LearnedPolicy.from_file(path)
    assert shipped.name == "learned-trial"
    # The expected scores, computed separately.
    scores = [
        sum(
            evaluate(
                str(run / "best.safetensors"),
                "constant",
                10,
                CHOICE_SEED,
                split="validation",
                progress=False,
                num_trackers=size,
                horizon=40,
                settle_time=1.0,
            )["safe_score"].mean()
            for size in (2, 3)
        )
        / 2
        for run in runs
    ]
    recorded = [run["safe_score"]["value"] for run in shipped.card["training_seeds"]]
    assert recorded == pytest.approx(scores)
    assert shipped.card["validation_safe_score"] == pytest.approx(max(scores))
    assert {"score", "contact_free"} <= set(shipped.card["training_seeds"][0])
    best = max(range(3), key=lambda k: scores[k])
    assert [run["seed"] for run in shipped.card["training_seeds"]] == [1, 2, 3]
    assert shipped.card["seed"] == best + 1
    chosen = LearnedPolicy.from_file(runs[best] / "best.safetensors")
    assert (shipped.network.weights[0] == chosen.network.weights[0]).all()
    assert [point["steps"] for point in shipped.card["curve"]][-1] >= SETTINGS.steps
    check = shipped.card["check"]
    assert [play["settings"]["num_trackers"] for play in check["plays"]] == [2, 3]
    assert all(play["settings"]["horizon"] == 40 for play in check["plays"])
    assert replay(shipped, check) == [play["score"] for play in check["plays"]]
    assert str(runs[0].parent) not in json.dumps(shipped.card)
    assert path.stat().st_mode & 0o044 == 0o044


def test_a_run_that_learned_nothing_is_not_shipped(
    runs: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its best policy is that of step 0; it stays on record, and may be kept."""
    first = ship(Settings(runs, "learned-trial", worlds=10, out=tmp_path))
    best = LearnedPolicy.from_file(first).card["seed"]
    copies = tuple(Path(shutil.copytree(run, tmp_path / f"run-{run.name}")) for run in runs)
    path = copies[best - 1] / "best.safetensors"
    policy = LearnedPolicy.from_file(path)
    policy.with_card({**policy.card, "steps": 0}).save(path)
    kept = tmp_path / "kept"
    card = LearnedPolicy.from_file(ship(Settings(copies, "learned-trial", worlds=10, out=tmp_path, keep=kept))).card
    assert card["seed"] != best
    assert [run["steps"] for run in card["training_seeds"]][best - 1] == 0
    names = {f"learned-trial-{seed}" for seed in (1, 2, 3)}
    assert {file.stem for file in kept.iterdir()} == names
    again = LearnedPolicy.from_file(kept / f"learned-trial-{best}.safetensors")
    assert (again.network.weights[0] == policy.network.weights[0]).all()


def test_runs_that_are_not_of_one_training(runs: tuple[Path, ...], tmp_path: Path) -> None:
    def refused(*folders: Path, name: str = "learned-x") -> str:
        with pytest.raises(SettingsError) as caught:
            ship(Settings(folders, name, worlds=2, out=tmp_path))
        return str(caught.value)

    assert "must have different training seeds" in refused(runs[0], runs[0])
    assert "must begin with 'learned-'" in refused(*runs, name="smart")
    assert "No run folders given" in refused()
    assert "is not a run folder" in refused(tmp_path)
    other = tmp_path / "other"
    train(replace(SETTINGS, seed=4, hidden=(4,), folder=other), console=Console(file=StringIO()))
    assert "differ in hidden" in refused(runs[0], other)
    assert not list(tmp_path.glob("*.safetensors"))


def test_a_file_too_large_is_not_left_behind(
    runs: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posse_training.shipping.ship.LARGEST", 1000)
    with pytest.raises(SettingsError, match="1,000 are allowed"):
        ship(Settings(runs[:1], "learned-x", worlds=2, out=tmp_path))
    assert not list(tmp_path.iterdir())


def test_the_command_on_record_gives_the_settings_again() -> None:
    for settings in (
        replace(
            default_settings("constant"),
            overrides={"horizon": 40, "settle_time": 1.0},
            seed=7,
            reward_weights={"contact": -0.5, "progress": 0.5, "slot": 0.25},
            team_sizes=(2, 3),
            imitate="ddcs-distributed",
            beside=None,
            tensorboard=False,
        ),
        replace(default_settings("smart,radio", "sac"), wandb="my project"),
        default_settings("field"),
        replace(default_settings("smart"), imitate=None, log_deviation=-0.5),
    ):
        words = shlex.split(command_of(settings))[2:]
        for own in (True, False):  # with the scenario's own defaults, and before there were any
            default = default_settings(settings.scenario, settings.algorithm, own=own)
            assert tyro.cli(TrainSettings, default=default, args=words) == settings


def test_the_command_says_how_each_seed_did(
    runs: tuple[Path, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--name", "learned-trial", "--worlds", "3", "--out", str(tmp_path)]
    assert main(["ship", *map(str, runs), *options]) == 0
    shown = capsys.readouterr().out
    assert all(f"training seed {seed}: " in shown for seed in (1, 2, 3))
    assert main(["ship", str(tmp_path), *options]) == 2
    assert "is not a run folder" in capsys.readouterr().err
