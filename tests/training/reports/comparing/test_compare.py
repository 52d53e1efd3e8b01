import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posse
from posse.scenarios.named import _named
from posse_baselines import PolicyError
from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_training.cli import main
from posse_training.reports.comparing.compare import Settings, asked_sweeps, compare
from posse_training.reports.comparing.comparison import table
from posse_training.reports.comparing.contenders import read_contenders
from posse_training.reports.comparing.sweeps import BOUND, SWEEPS
from posse_training.reports.statistics import difference


def test_differences_are_those_of_the_rows(tmp_path: Path) -> None:
    names = ("idle", "pursuit")
    settings = Settings(names, ("constant",), episodes=20, out=tmp_path, figures=False, planner_episodes=0)
    rows = compare(settings).rows
    scores = {}
    for name in names:
        with (tmp_path / f"constant-{name}.csv").open(newline="") as file:
            scores[name] = np.array([float(row["safe_score"]) for row in csv.DictReader(file)])
    assert rows[0]["difference"] is None
    gap = scores["pursuit"] - scores["idle"]
    assert rows[1]["difference"].value == pytest.approx(gap.mean())
    assert rows[1]["improvement"].value == pytest.approx(((gap > 0) + 0.5 * (gap == 0)).mean())
    assert rows[1]["difference"].count == 20
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["comparison"][1]["safe_score"]["value"] == pytest.approx(scores["pursuit"].mean())
    assert (written["seed"], written["split"]) == (7, "test")


def test_teams_are_ranked_and_stand_beside_the_planner(tmp_path: Path) -> None:
    settings = Settings(
        ("idle", "pursuit", "ddcs-distributed"), ("smart",), episodes=4, out=tmp_path, figures=False, planner_episodes=3
    )
    found = compare(settings)
    assert [row["policy"] for row in found.rows][-1] == "planner"
    safe = {row["policy"]: found.plays["smart", row["policy"]]["safe_score"][0] for row in found.rows}
    assert len(safe["planner"]) == 3, "it plays the first worlds of the others"
    for row in found.rows:
        share = safe[row["policy"]][:3].mean() / safe["planner"].mean()
        assert row["of_planner"] == pytest.approx(share)
        assert row["contact_free"].value in np.arange(5) / 4 or row["policy"] == "planner"
    shown = list(table(found, settings, 240).columns[1].cells)
    ranked = sorted(safe, key=lambda policy: -safe[policy].mean())
    assert [str(cell) for cell in shown] == ranked
    assert ranked[0] == "planner"


def test_an_unknown_name_stops_before_anything_is_played(tmp_path: Path) -> None:
    for named, message in (
        ("idel", "unknown policy 'idel'"),
        ("mine=", "'mine=' is not a group of policies"),
        ("mine=idle,,pursuit", "is not a group of policies"),
        ("idle=pursuit", "two policies have the label 'idle'"),
    ):
        with pytest.raises(PolicyError, match=message):
            compare(Settings(("idle", named), ("constant",), out=tmp_path))
    with pytest.raises(PolicyError, match="No policies given"):
        compare(Settings((), ("constant",), out=tmp_path))
    with pytest.raises(posse.ScenarioError, match="unknown scenario 'konstant'"):
        compare(Settings(("idle",), ("constant", "konstant"), out=tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", "idle", "pursuit", "--scenarios", "constant", "--episodes", "3"]
    assert main([*arguments, "--no-figures", "--planner-episodes", "0", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    row = next(line for line in lines if " pursuit " in line)
    assert "constant" in row, "no cell is broken where lines have no end"
    assert row.count("]") == 6, "six estimates with their intervals"
    assert not list(tmp_path.glob("*.png"))


def test_a_file_goes_by_the_name_on_its_card(files: list[str]) -> None:
    again = files[0].replace("0.safetensors", "again.safetensors")
    learned(0).save(Path(again))
    found = read_contenders((*files[:2], again, f"mine={files[2]}"))
    assert [contender.label for contender in found] == ["any-0", "any-1", again, "mine"]
    found = read_contenders((files[0], f"any-0={files[1]}"))
    assert [contender.label for contender in found] == [files[0], "any-0"]


def learned(seed: int, trained: str = "train") -> LearnedPolicy:
    """A network of any numbers, for the layout of ``constant``."""
    encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario("constant")), "plain")
    weight = np.random.default_rng(seed).normal(size=(2, encoding.size)).astype(np.float32)
    network = Network(
        np.zeros(encoding.size, np.float32),
        np.ones(encoding.size, np.float32),
        5.0,
        (weight / np.float32(8),),
        (np.array([0.5, 0], np.float32),),
        "tanh",
        "clip",
    )
    return LearnedPolicy(network, encoding, {"name": f"any-{seed}", "trained_splits": [trained]})


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    paths = [tmp_path / f"{seed}.safetensors" for seed in range(3)]
    for seed, path in enumerate(paths):
        learned(seed).save(path)
    return [str(path) for path in paths]


def test_training_seeds_are_one_contender(files: list[str], tmp_path: Path) -> None:
    group = f"mine={','.join(files)}"
    settings = Settings(
        ("pursuit", group), ("constant",), episodes=15, out=tmp_path / "out", figures=False, planner_episodes=0
    )
    found = compare(settings)
    assert [(row["policy"], row["seeds"]) for row in found.rows] == [("pursuit", 1), ("mine", 3)]
    scores = []
    for k in (1, 2, 3):
        with (tmp_path / "out" / f"constant-mine-{k}.csv").open(newline="") as file:
            scores.append([float(row["safe_score"]) for row in csv.DictReader(file)])
    assert len({tuple(row) for row in scores}) == 3
    reference = found.plays["constant", "pursuit"]["safe_score"]
    assert found.rows[1]["difference"] == difference(scores, reference)
    better = (np.array(scores) > reference) + 0.5 * (np.array(scores) == reference)
    assert found.rows[1]["improvement"].value == pytest.approx(better.mean())


def test_who_cannot_play_is_left_out_with_a_line(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = replace(posse.get_scenario("constant"), sonar_beams=4)
    _named()["few-beams"] = scenario
    try:
        command = ["compare", files[0], "pursuit", "--scenarios", "few-beams", "constant"]
        options = ["--episodes", "2", "--no-figures", "--planner-episodes", "0", "--out", str(tmp_path / "out")]
        assert main([*command, *options]) == 0
    finally:
        del _named()["few-beams"]
    shown = " ".join(capsys.readouterr().out.split())
    assert "left out: any-0 on few-beams:" in shown
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    left_out = [(row["what"], row["policy"]) for row in summary["left_out"]]
    assert left_out == [("few-beams", "any-0")]
    played = [(row["scenario"], row["policy"]) for row in summary["comparison"]]
    assert played == [("few-beams", "pursuit"), ("constant", "any-0"), ("constant", "pursuit")]
    # The baseline did not play, so there is no difference, not even to another policy.
    assert summary["comparison"][0]["difference"] is None
    assert summary["comparison"][2]["difference"] is not None


def test_a_split_that_was_trained_on_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    learned(1, "test").save(tmp_path / "mine.safetensors")
    options = ["--scenarios", "constant", "--no-figures", "--planner-episodes", "0", "--out", str(tmp_path)]
    assert main(["compare", str(tmp_path / "mine.safetensors"), *options]) == 2
    assert "was trained on the split 'test'" in capsys.readouterr().err


@pytest.mark.long
def test_figures_are_drawn_with_the_planner_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = tuple(replace(sweep, values=sweep.values[:1]) for sweep in SWEEPS)
    monkeypatch.setattr("posse_training.reports.comparing.compare.SWEEPS", few)
    options = ["--scenarios", "constant", "leader-loss", "--episodes", "3"]
    options += ["--sweeps", "team-size", "radio-loss", "--sweep-episodes", "2"]
    assert main(["compare", "pursuit", *options, "--out", str(tmp_path)]) == 0
    names = {"profile", "scenarios", "team-size", "radio-loss", "recovery"}
    assert {path.stem for path in tmp_path.glob("*.png")} == names
    assert {path.stem for path in tmp_path.glob("*.svg")} == names
    assert "planner" in capsys.readouterr().out
    with (tmp_path / "sweeps.csv").open(newline="") as file:
        assert {row["policy"] for row in csv.DictReader(file)} == {"pursuit", "planner", BOUND}


def test_a_scenario_alone_is_played_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--scenarios", "constant", "--episodes", "2", "--planner-episodes", "0"]
    assert main(["compare", "idle", *options, "--out", str(tmp_path / "out")]) == 0
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert {name for name in files if name.endswith(".csv")} == {"constant-idle.csv"}
    assert {name for name in files if name.endswith(".png")} == {"scenarios.png", "profile.png"}
    for asked, message in (("team-sise", "did you mean 'team-size'"), ("9", "or 'all', or 'none'")):
        assert main(["compare", "idle", *options, "--sweeps", asked]) == 2
        assert message in capsys.readouterr().err


def test_sweeps_are_played_when_asked_or_with_all_scenarios() -> None:
    everything = tuple(sweep.name for sweep in SWEEPS)
    for given, wanted in (
        (Settings(("idle",)), everything),
        (Settings(("idle",), figures=False), ()),
        (Settings(("idle",), sweeps=("none",)), ()),
        (Settings(("idle",), sweep_episodes=0), ()),
        (Settings(("idle",), ("smart",)), ()),
        (Settings(("idle",), ("smart",), sweeps=("all",)), everything),
        (Settings(("idle",), ("smart",), sweeps=("radio-loss",)), ("radio-loss",)),
    ):
        assert tuple(sweep.name for sweep in asked_sweeps(given)) == wanted
