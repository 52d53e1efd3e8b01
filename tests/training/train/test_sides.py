"""Training of targets against teams and of teams against targets, and leagues of both."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from safetensors.numpy import load_file
from tests.support.learned import policy_for, target_for
from tests.support.runs import HORIZON, TARGET, killed_at, numbers, quiet, small

import posse
from posse_baselines import PolicyError, load_target
from posse_baselines.registry import shipped
from posse_training import evaluate, league
from posse_training.commands.train import train_all
from posse_training.errors import RunFolderError, SettingsError
from posse_training.league import League, LeagueSettings, draw_matrix, play_league, shares
from posse_training.train import TrainSettings, default_settings
from posse_training.train.checkpoint import read_checkpoint
from posse_training.train.networks import RunningStatistics
from posse_training.train.train import Run, train
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


def tiny(folder: Path, **changes: Any) -> LeagueSettings:
    settings = LeagueSettings(
        scenario="smart",
        generations=2,
        teams=("idle",),
        targets=("smart",),
        target_steps=160,
        team_steps=320,
        episodes=3,
        overrides={"horizon": HORIZON, "settle_time": 1.0, "num_trackers": 2},
        training={"num_worlds": 16, "rollout": 5, "minibatch": 32, "epochs": 1, "evaluate_worlds": 2},
        folder=folder,
    )
    return replace(settings, **changes)


def everything(folder: Path) -> dict[str, Any]:
    """All policies and results of a league, without its folder's name."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*.safetensors")):
        tensors = load_file(path)
        found[str(path.relative_to(folder))] = {k: a.tobytes() for k, a in tensors.items()}
    for name in ("matrix.csv", "summary.json", "league.json"):
        found[name] = (folder / name).read_text(encoding="utf-8").replace(str(folder), "FOLDER")
    return found


@pytest.mark.long
def test_a_killed_league_ends_as_one_that_was_not(tmp_path: Path) -> None:
    found = play_league(tiny(tmp_path / "whole"), console=quiet())
    assert [m.label for m in found.teams] == ["idle", "trackers-1", "trackers-2"]
    assert [m.label for m in found.targets] == ["smart", "target-1", "target-2"]
    assert len(found.cells) == 9
    assert [e.label for e in found.exploited] == ["trackers-2", "target-2"]
    gained = found.exploited[0]
    assert gained.gain == pytest.approx(gained.before["score"].value - gained.after["score"].value), "of a target"
    for owner, name, call in ((Run, "_on_rollout_start", 4), (Run, "_checkpoint", 7), (league, "evaluate", 9)):
        with killed_at(owner, name, call):
            play_league(tiny(tmp_path / "cut"), console=quiet())
    play_league(tiny(tmp_path / "whole" / ".." / "cut"), console=quiet())
    assert everything(tmp_path / "cut") == everything(tmp_path / "whole")

    again = play_league(tiny(tmp_path / "whole"), console=quiet())
    assert again.cells == found.cells
    assert all(path.stat().st_size > 1000 for path in draw_matrix(again))
    start = json.loads((tmp_path / "whole/generation-02/target/settings.json").read_text())
    assert start["start"].endswith("generation-01/target"), "each begins where its side stood"


def test_other_settings_are_refused(tmp_path: Path) -> None:
    team = Path(shutil.copy(shipped()["learned-smart"], tmp_path / "team.safetensors"))
    settings = tiny(folder := tmp_path / "league", teams=("idle", str(team)), generations=1, responses="none")
    play_league(settings, console=quiet())
    with pytest.raises(RunFolderError, match=r"holds a run with longer=1, not 2, seed=1, not 2"):
        play_league(replace(settings, seed=2, longer=2), console=quiet())
    more = play_league(replace(settings, episodes=2), console=quiet())
    assert more.cells["idle", "smart"]["score"].count == 2, "what is no training may be changed"
    with pytest.raises(SettingsError, match="unknown setting 'foo'"):
        play_league(tiny(tmp_path / "new", training={"foo": 1}), console=quiet())
    with pytest.raises(SettingsError, match="num_worlds=20 is too few for 10 opponents in the end: use 23"):
        play_league(tiny(tmp_path / "new", generations=9, training={"num_worlds": 20}), console=quiet())
    tested = policy_for(posse.batch("smart").layout).with_card({"name": "tested", "trained_splits": ("train", "test")})
    tested.save(tmp_path / "tested.safetensors")
    with pytest.raises(SettingsError, match="was trained on the split 'test'"):
        play_league(tiny(tmp_path / "new", teams=(str(tmp_path / "tested.safetensors"),)), console=quiet())
    assert not (tmp_path / "new").exists()
    assert League(tiny(tmp_path, scenario="search"), quiet()).training("trackers", tmp_path, "smart").algorithm == "ppo"
    shutil.copytree(folder / "generation-01", folder / "generation-02")
    with pytest.raises(SettingsError, match="generations=1 is less than"):
        play_league(settings, console=quiet())
    held = json.loads((folder / "league.json").read_text())
    (folder / "league.json").write_text(json.dumps({**held, "scenario_version": 0}))
    shutil.copy(shipped()["learned-radio"], team)
    with pytest.raises(RunFolderError, match=r"with scenario_version=0, not \d, digest of .*team\.safetensors='"):
        play_league(settings, console=quiet())


def test_harder_opponents_get_more_of_the_worlds() -> None:
    assert shares({"easy": 0.0, "hard": 0.9, "middle": 0.3}) == {"easy": 1, "hard": 7, "middle": 3}
    assert shares({"a": 0.0, "b": 0.0}) == {"a": 1, "b": 1}
