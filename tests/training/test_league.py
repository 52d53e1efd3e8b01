"""Leagues: generations, cross-play, best responses, and going on after a kill."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from safetensors.numpy import load_file
from tests.support.learned import policy_for
from tests.support.runs import HORIZON, killed_at, quiet

import posse
from posse_baselines.registry import shipped
from posse_training import league
from posse_training.errors import RunFolderError, SettingsError
from posse_training.league import League, LeagueSettings, draw_matrix, play_league, shares
from posse_training.train.train import Run


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
    settings = tiny(tmp_path, teams=("idle", str(team)), generations=1, responses="none")
    play_league(settings, console=quiet())
    with pytest.raises(RunFolderError, match=r"holds a run with longer=1, not 2, seed=1, not 2"):
        play_league(replace(settings, seed=2, longer=2), console=quiet())
    more = play_league(replace(settings, episodes=2), console=quiet())
    assert more.cells["idle", "smart"]["score"].count == 2, "what is no training may be changed"
    with pytest.raises(SettingsError, match="unknown setting 'foo'"):
        play_league(tiny(tmp_path / "new", training={"foo": 1}), console=quiet())
    with pytest.raises(SettingsError, match="num_worlds=1 is too few for 3 opponents"):
        play_league(tiny(tmp_path / "new", scenario="search", targets=("smart", "slow"), training={"num_worlds": 1}))
    with pytest.raises(SettingsError, match="num_worlds=20 is too few for 10 opponents in the end: use 23"):
        play_league(tiny(tmp_path / "new", generations=9, training={"num_worlds": 20}), console=quiet())
    tested = policy_for(posse.batch("smart").layout).with_card({"name": "tested", "trained_splits": ("train", "test")})
    tested.save(tmp_path / "tested.safetensors")
    with pytest.raises(SettingsError, match="was trained on the split 'test'"):
        play_league(tiny(tmp_path / "new", teams=(str(tmp_path / "tested.safetensors"),)), console=quiet())
    assert not (tmp_path / "new").exists()
    assert League(tiny(tmp_path, scenario="search"), quiet()).training("trackers", tmp_path, "smart").algorithm == "ppo"
    held = json.loads((tmp_path / "league.json").read_text())
    (tmp_path / "league.json").write_text(json.dumps({**held, "scenario_version": 0}))
    shutil.copy(shipped()["learned-radio"], team)
    with pytest.raises(RunFolderError, match=r"with scenario_version=0, not \d, digest of .*team\.safetensors='"):
        play_league(settings, console=quiet())


def test_harder_opponents_get_more_of_the_worlds() -> None:
    assert shares({"easy": 0.0, "hard": 0.9, "middle": 0.3}) == {"easy": 1, "hard": 7, "middle": 3}
    assert shares({"a": 0.0, "b": 0.0}) == {"a": 1, "b": 1}
