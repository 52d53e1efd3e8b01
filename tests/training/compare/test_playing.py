"""The failure of a policy is reported, and affects only its own rows."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from posse_training import evaluate
from posse_training.cli import main
from posse_training.compare.compare import CompareSettings, compare
from posse_training.parallel import apart

BAD = "tests.support.bad_policies:"
OPTIONS = ["--scenario", "constant", "--episodes", "1", "--no-figures", "--planner-episodes", "0"]


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Compile the kernels outside the time limits."""
    for policy in ("idle", "pursuit"):
        evaluate(policy, "constant", 2, progress=False)


def settings_for(tmp_path: Path, *names: str, limit: float = 60.0) -> CompareSettings:
    policies = ("idle", *(f"{BAD}{name}" for name in names), "pursuit")
    return CompareSettings(
        policies, ("constant",), episodes=2, out=tmp_path / "out", figures=False, planner_episodes=0, time_limit=limit
    )


@pytest.mark.long
def test_failures_are_named_and_the_others_are_played(tmp_path: Path) -> None:
    names = ("Raises", "Nan", "Builds", "Declares", "Untold", "Crashes")
    settings = settings_for(tmp_path, *names)
    same = "posse_baselines.policies.simple:Pursuit"
    found = compare(replace(settings, policies=(*settings.policies, same)))
    assert [row["policy"] for row in found.rows] == ["idle", "pursuit", same]
    why = {row["policy"].removeprefix(BAD): row["why"] for row in found.failed}
    assert tuple(why) == names
    assert "LocalError: [bold]local[/bold]" in why["Raises"]
    assert "bad_policies.py, line" in why["Raises"]
    assert "nan" in why["Nan"]
    assert "unknown scenario 'nope'" in why["Builds"]
    assert "Untold: <exception str() failed>" in why["Untold"]
    assert "exit code 9" in why["Crashes"]
    beaten = compare(replace(settings_for(tmp_path / "target"), target=f"{BAD}Crashes"))
    assert ["exit code 9" in row["why"] for row in beaten.failed] == [True, True]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["failed"] == found.failed
    # The rows are those of a comparison without the failures, and code plays as it would in this process.
    assert found.rows[:2] == compare(settings_for(tmp_path / "alone")).rows
    there, here = (found.plays["constant", policy]["score"] for policy in (same, "pursuit"))
    assert (there == here).all()


@pytest.mark.long
def test_a_policy_that_hangs_is_ended_and_so_is_what_one_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PID_FILE", str(tmp_path / "pid"))
    found = compare(settings_for(tmp_path, "Hangs", "Leaves", limit=20.0))
    assert {row["policy"] for row in found.rows} == {"idle", f"{BAD}Leaves", "pursuit"}
    assert ["exceeded the time limit of 20 s" in row["why"] for row in found.failed] == [True]
    stat = Path("/proc", (tmp_path / "pid").read_text(), "stat")
    assert not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z"


def test_what_a_policy_prints_is_no_part_of_the_answer() -> None:
    assert apart(60.0, print, "hello") is None


def test_the_command_says_who_failed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", f"{BAD}Raises", "idle", *OPTIONS, "--out", str(tmp_path / "a")]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert f"failed: {BAD}Raises on constant: LocalError: [bold]local[/bold]" in shown
