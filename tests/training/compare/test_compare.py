"""Comparisons of teams, and all that plays against a given target."""

import csv
import io
import json
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from rich.console import Console
from tests.support.learned import policy_for, target_for

import posse
from posse.scenarios.named import SCENARIOS
from posse_baselines import PolicyError
from posse_baselines.learned import LearnedPolicy
from posse_training import evaluate
from posse_training.cli import main
from posse_training.commands import watch
from posse_training.compare.compare import SUMMARY, CompareSettings, compare
from posse_training.compare.contenders import read_contenders
from posse_training.compare.table import ranked
from posse_training.errors import RunFolderError, SettingsError
from posse_training.evaluation.statistics import difference
from posse_training.files import locked
from posse_training.film import film
from posse_training.leaderboard import submit

ALONE: dict[str, Any] = {"figures": False, "planner_episodes": 0}


def safe_scores(rows: Path) -> Any:
    return np.array([float(row["safe_score"]) for row in csv.DictReader(rows.read_text().splitlines())])


def test_differences_are_those_of_the_rows(tmp_path: Path) -> None:
    names = ("idle", "ddcs-distributed")
    rows = compare(CompareSettings(names, ("constant",), 20, out=tmp_path, export=("marl-eval",), **ALONE)).rows
    scores = {name: safe_scores(tmp_path / f"constant-{name}.csv") for name in names}
    assert rows[0]["difference"] is None
    gap = scores["ddcs-distributed"] - scores["idle"]
    assert rows[1]["difference"].value == pytest.approx(gap.mean())
    assert rows[1]["improvement"].value == pytest.approx(((gap > 0) + 0.5 * (gap == 0)).mean())
    assert rows[1]["difference"].count == 20
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["comparison"][1]["safe_score"]["value"] == pytest.approx(scores["ddcs-distributed"].mean())
    assert (written["seed"], written["split"]) == (7, "test")
    runs = json.loads((tmp_path / "marl-eval.json").read_text())["posse"]["constant"]
    exported, safe = runs["ddcs-distributed"]["seed_0"], list(scores["ddcs-distributed"])
    assert exported["step_0"].keys() == runs["idle"]["seed_0"]["step_0"].keys()
    assert exported["absolute_metrics"]["safe_score"] == exported["step_0"]["safe_score"] == safe


def test_teams_are_ranked_and_stand_beside_the_planner(tmp_path: Path) -> None:
    policies, few = ("idle", "pursuit", "ddcs-distributed"), {**ALONE, "planner_episodes": 2}
    found = compare(CompareSettings(policies, ("smart",), 4, out=tmp_path, **few))
    assert [row["policy"] for row in found.rows][-1] == "planner"
    safe = {row["policy"]: found.plays["smart", row["policy"]]["safe_score"][0] for row in found.rows}
    assert len(safe["planner"]) == 2, "it plays the first worlds of the others"
    for row in found.rows:
        share = safe[row["policy"]][:2].mean() / safe["planner"].mean()
        assert row["of_planner"] == pytest.approx(share)
        assert row["contact_free"].value in np.arange(5) / 4 or row["policy"] == "planner"
    best = sorted(safe, key=lambda policy: -safe[policy].mean())
    assert [row["policy"] for row in ranked(found.rows)] == best
    assert best[0] == "planner"


def test_a_file_goes_by_the_name_on_its_card(files: list[str], tmp_path: Path) -> None:
    again = files[0].replace("0.safetensors", "again.safetensors")
    learned(0).save(Path(again))
    learned(0).save(tmp_path / "seed=1.safetensors")
    found = read_contenders((*files[:2], again, f"mine={files[2]}"))
    assert [contender.label for contender in found] == ["any-0", "any-1", again, "mine"]
    assert read_contenders((str(tmp_path / "seed=1.safetensors"),))[0].label == "any-0"
    found = read_contenders((files[0], f"any-0={files[1]}"))
    assert [contender.label for contender in found] == [files[0], "any-0"]


def learned(seed: int) -> LearnedPolicy:
    """A network of any numbers, for the layout of ``constant``."""
    policy = policy_for(posse.ObservationLayout(posse.get_scenario("constant")), "plain", seed=seed)
    return policy.with_card({"name": f"any-{seed}", "trained_splits": ["train"]})


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    paths = [tmp_path / f"{seed}.safetensors" for seed in range(3)]
    for seed, path in enumerate(paths):
        learned(seed).save(path)
    return [str(path) for path in paths]


def test_training_seeds_are_one_contender(files: list[str], tmp_path: Path) -> None:
    group = f"mine={','.join(files)}"
    found = compare(CompareSettings(("pursuit", group), ("constant",), 15, out=tmp_path / "out", **ALONE))
    assert [(row["policy"], row["seeds"]) for row in found.rows] == [("pursuit", 1), ("mine", 3)]
    scores = np.stack([safe_scores(tmp_path / "out" / f"constant-mine-{k}.csv") for k in (1, 2, 3)])
    assert len({tuple(row) for row in scores}) == 3
    reference = found.plays["constant", "pursuit"]["safe_score"]
    assert found.rows[1]["difference"] == difference(scores, reference)
    better = (scores > reference) + 0.5 * (scores == reference)
    assert found.rows[1]["improvement"].value == pytest.approx(better.mean())
    twice = f"{tmp_path}/../{tmp_path.name}/0.safetensors"
    with pytest.raises(PolicyError, match="is given twice"):
        read_contenders((files[0], twice))
    with pytest.raises(PolicyError, match="names a policy twice"):
        compare(CompareSettings((f"two={files[0]},{twice}",), ("constant",), 1))


def test_a_policy_that_cannot_play_is_left_out_with_a_line(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SCENARIOS, "few-beams", {"sonar_beams": 4})
    command = ["compare", files[0], "pursuit", "--scenario", "few-beams", "constant"]
    options = ["--episodes", "2", "--planner-episodes", "0", "--out", str(tmp_path / "out")]
    assert main([*command, *options]) == 0
    assert "left out: any-0 on few-beams:" in " ".join(capsys.readouterr().out.split())
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    left_out = [(row["what"], row["policy"]) for row in summary["left_out"]]
    assert left_out == [("few-beams", "any-0")]
    played = [(row["scenario"], row["policy"]) for row in summary["comparison"]]
    assert played == [("few-beams", "pursuit"), ("constant", "any-0"), ("constant", "pursuit")]
    # The baseline did not play, so there is no difference, not even to another policy.
    assert summary["comparison"][0]["difference"] is None
    assert summary["comparison"][2]["difference"] is not None


@pytest.mark.long
def test_figures_are_drawn_with_the_planner_beside(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--scenario", "constant", "leader-loss", "--episodes", "3", "--planner-episodes", "1"]
    for folder, changed in ((tmp_path / "lost", []), (tmp_path / "none", ["breaks=0", "num_trackers=1", "horizon=30"])):
        assert main(["compare", "pursuit", *options, "--replays", "0", "--out", str(folder), "--set", *changed]) == 0
        for suffix in ("png", "svg"):
            drawn = {path.stem for path in folder.glob(f"*.{suffix}")}
            assert drawn == {"profile", "scenarios", *([] if changed else ["recovery"])}
    assert "NaN" not in (tmp_path / "none/summary.json").read_text(), "where the planner holds no slot"
    assert "planner" in capsys.readouterr().out


def test_each_comparison_has_a_folder_and_each_contender_files_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = CompareSettings(("a=idle", "A=pursuit", "[/a]=random"), ("constant", "constant"), 1, **ALONE)
    for name in ("compare", "compare-2"):
        found = compare(settings, console=Console(file=io.StringIO(), force_terminal=True))
        assert found.folder.name == name
    assert [row["files"] for row in found.rows] == [["constant-a.csv"], ["constant-A-2.csv"], ["constant-__a_.csv"]]


def test_a_folder_with_any_file_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    for out in (tmp_path, tmp_path / "mine.txt"):
        with pytest.raises(RunFolderError, match="not an empty folder"):
            compare(CompareSettings(("idle",), ("constant",), out=out))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    with locked(tmp_path / "busy"):
        with pytest.raises(RunFolderError, match=r"process \d+ uses"):
            compare(CompareSettings(("idle",), ("constant",), out=tmp_path / "busy"))
        with pytest.raises(RunFolderError, match=r"process \d+ uses"):
            submit("idle", tmp_path / "busy")


SHORT = posse.get_scenario("smart", num_trackers=3, horizon=30, settle_time=1.0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "evader.safetensors"
    target_for(SHORT).save(path)
    return path


def test_an_evaluation_is_the_same_alone_and_its_files_name_target_and_settings(file: Path, tmp_path: Path) -> None:
    many, few = (evaluate("ddcs-distributed", SHORT, count, 9, target=str(file), progress=False) for count in (5, 2))
    assert list(many) == list(few.columns)
    np.testing.assert_equal({name: column[:2] for name, column in many.columns.items()}, few.columns)
    scripted = evaluate("ddcs-distributed", SHORT, 5, 9, progress=False)
    assert not np.array_equal(many["tracking_error"], scripted["tracking_error"])
    assert many.target == "evading"
    assert scripted.target is None
    assert many.scenario.to_dict()["target_motion"] == "agent"
    many.write(tmp_path / "deep" / "rows.csv")
    rows = [*csv.DictReader((tmp_path / "deep" / "rows.csv").read_text(encoding="utf-8").splitlines())]
    assert [(row["world"], row["target"]) for row in rows] == [(str(world), "evading") for world in range(5)]
    assert [float(row["score"]) for row in rows] == list(many["score"])
    settings = json.loads((tmp_path / "deep" / "rows.json").read_text())
    assert (settings["target"], settings["seed"], settings["split"]) == ("evading", 9, "test")
    assert settings["scenario"]["horizon"] == 30


def test_a_comparison_plays_every_team_against_the_target(file: Path, tmp_path: Path) -> None:
    code = "posse_baselines.policies.simple:Idle"
    made: dict[str, Any] = {"out": tmp_path / "out", "figures": False, "planner_episodes": 1, "target": str(file)}
    found = compare(CompareSettings(("ddcs-distributed", code), ("smart",), episodes=2, **made))
    played = {plays.results[0].target for plays in found.plays.values()}
    assert played == {"evading"}
    assert len(found.plays) == 2, "also in the process of a policy that is code"
    assert "planner" in found.left_out[0]["policy"]
    assert json.loads((tmp_path / "out" / SUMMARY).read_text())["target"] == str(file)


def test_a_target_that_dies_while_it_is_imported_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dying_target.py").write_text("import os\n\nos._exit(3)\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    died = compare(CompareSettings(("idle", "dying_target:Own"), ("constant",), 2, out=tmp_path / "team", **ALONE))
    assert ["exit code 3" in row["why"] for row in died.failed] == [True]
    settings = CompareSettings(("pursuit",), ("smart",), 2, out=tmp_path / "out", target="dying_target:Own", **ALONE)
    with pytest.raises(SettingsError, match=r"target='dying_target:Own' cannot be loaded: .* ended with exit code 3"):
        compare(settings)
    assert not (tmp_path / "out").exists()


def test_a_film_shows_the_target_and_the_whole_episode(file: Path, tmp_path: Path) -> None:
    words = ["pursuit", "--target", str(file), "--set", "num_trackers=3", "--out", str(tmp_path / "film.gif")]
    with patch.object(watch, "film", side_effect=partial(film, every=300)) as asked:
        watch.main(words)
    assert (asked.call_args.kwargs["target"].name, asked.call_args.kwargs["seconds"]) == ("evading", 60.0)
    assert (tmp_path / "film.gif").is_file()
