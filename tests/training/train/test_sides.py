"""Training of targets against teams, and of teams against targets."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.learned import target_for
from tests.support.runs import HORIZON, TARGET, numbers, quiet, small

import posse
from posse_baselines import PolicyError, load_target
from posse_training import evaluate
from posse_training.commands.train import train_all
from posse_training.errors import RunFolderError, SettingsError
from posse_training.train import TrainSettings, default_settings
from posse_training.train.checkpoint import read_checkpoint
from posse_training.train.networks import RunningStatistics
from posse_training.train.train import train
from posse_training.train.validation import first_statistics, validate
from posse_training.train.worlds import divided, make_env


def target_run(folder: Path, **changes: Any) -> TrainSettings:
    return small(folder, **{**TARGET, **changes})


def test_a_target_is_scored_by_what_it_denies(tmp_path: Path) -> None:
    settings = target_run(tmp_path, team="ddcs-distributed", evaluate_worlds=4)
    smart = load_target("smart")
    denied = validate(settings, smart)
    scenario = settings.given[0]
    played = evaluate("ddcs-distributed", scenario, 4, 0, split="validation", progress=False)
    assert denied["score"] == denied["safe_score"] == pytest.approx(1 - played["score"].mean())


def test_a_run_begins_with_the_networks_of_another(tmp_path: Path) -> None:
    trained = load_target(train(target_run(tmp_path / "first", steps=160), console=quiet()))
    assert (trained.name, trained.motion) == ("smart-target-ppo-3", "agent")
    still = {"learning_rate": 0.0, "final_learning_rate": 0.0, "evaluate_every": 10**6, "log_deviation": -2.0}
    second = target_run(tmp_path / "second", steps=80, start=str(tmp_path / "first"), **still)
    train(second, console=quiet())
    before, after = (numbers(tmp_path / name)["/last/layers.0.weight"] for name in ("first", "second"))
    assert before == after
    assert read_checkpoint(tmp_path / "second")["model"]["parts"]["policy"]["log_std"].tolist() == [-2.0, -2.0]
    with pytest.raises(RunFolderError, match=r"(?s)do not fit this run.*hidden"):
        train(replace(second, folder=tmp_path / "third", hidden=(8,)), console=quiet())
    assert not (tmp_path / "third/settings.json").exists()
    for other in (replace(second, activation="relu"), small(tmp_path, start=second.start)):
        with pytest.raises(SettingsError, match=r"has (activation='tanh', not 'relu'|side='target', not 'trackers')"):
            train(replace(other, folder=tmp_path / "third"), console=quiet())
    shutil.rmtree(tmp_path / "first")
    train(second, console=quiet())  # resumed, it needs no start


def test_an_opponent_that_was_trained_on_validation_worlds_is_refused(tmp_path: Path) -> None:
    seen = {"name": "seen", "side": "target", "trained_splits": ("train", "validation")}
    target_for(posse.get_scenario("constant")).with_card(seen).save(tmp_path / "seen.safetensors")
    with pytest.raises(SettingsError, match="'seen' was trained on the split 'validation'"):
        train(small(tmp_path / "run", target=str(tmp_path / "seen.safetensors")), console=quiet())
    assert not (tmp_path / "run").exists()


def test_what_is_not_to_be_trained_is_found_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="unknown policy 'nosuch'"):
        train(small(tmp_path / "run", beside="nosuch"), console=quiet())
    with pytest.raises(PolicyError, match="'planner' cannot be trained against"):
        train(target_run(tmp_path / "run", team="planner"), console=quiet())
    train_all([one := small(tmp_path / "one", steps=1)], False)
    with pytest.raises(RunFolderError, match=r"discount=0\.99, not 0\.5"):
        train_all([small(tmp_path / "run", steps=1), replace(one, discount=0.5)], False)
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


def test_an_opponent_whose_memory_is_not_restored_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    env = make_env(target_run(tmp_path))
    saved = {name: array.copy() for name, array in env.arrays().items()}
    env.reset()
    monkeypatch.setattr(env, "arrays", lambda: {name: array + 1 for name, array in saved.items()})
    with pytest.raises(ValueError, match="an opponent is not restored"):
        env.restore(saved)


def test_the_worlds_are_shared_out_among_the_opponents(tmp_path: Path) -> None:
    settings = target_run(tmp_path, team="idle,ddcs-distributed,idle", num_worlds=9)
    env = make_env(settings)
    assert [batch.num_worlds for batch in env.batches] == [6, 3]
    assert [batch.first_world for batch in env.batches] == [0, 6]
    assert env.num_envs == 9, "one slot for each target"
    assert env.reset().shape == (9, env.encoding.size)
    many = replace(settings, team=",".join(["idle"] * 39), num_worlds=39)
    first_statistics(many, statistics := RunningStatistics(env.encoding.size))
    assert statistics.count == 39 * (HORIZON + 1)
    assert divided(default_settings("family-open", preset="residual")), "evolution needs no world for each draw"
