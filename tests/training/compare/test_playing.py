"""The failure of a policy is reported, and affects only its own rows."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.process import printed

from posse_training import evaluate
from posse_training.cli import main
from posse_training.compare.compare import Settings, compare

ROOT = Path(__file__).parents[3]
BAD = "tests.support.bad_policies:"


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Compile the kernels outside the time limits."""
    for policy in ("idle", "pursuit"):
        evaluate(policy, "constant", 2, progress=False)


def settings_for(tmp_path: Path, *names: str, limit: float = 60.0) -> Settings:
    policies = ("idle", *(f"{BAD}{name}" for name in names), "pursuit")
    return Settings(
        policies, ("constant",), episodes=2, out=tmp_path / "out", figures=False, planner_episodes=0, time_limit=limit
    )


def test_failures_are_named_and_the_others_are_played(tmp_path: Path) -> None:
    names = ("RaisesUnpicklable", "Nan", "Exits", "Crashes")
    settings = settings_for(tmp_path, *names)
    same = "posse_baselines.policies.pursuit:Pursuit"
    found = compare(replace(settings, policies=(*settings.policies, same)))
    assert [row["policy"] for row in found.rows] == ["idle", "pursuit", same]
    why = {row["policy"].removeprefix(BAD): row["why"] for row in found.failed}
    assert tuple(why) == names
    assert "LocalError: local" in why["RaisesUnpicklable"]
    assert "bad_policies.py, line" in why["RaisesUnpicklable"]
    assert "nan" in why["Nan"]
    assert "exit code 0" in why["Exits"]
    assert "exit code 9" in why["Crashes"]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["failed"] == found.failed
    # The rows are those of a comparison without the failures, and code plays as it would in this process.
    assert found.rows[:2] == compare(settings_for(tmp_path / "alone")).rows
    there, here = (found.plays["constant", policy]["score"] for policy in (same, "pursuit"))
    assert (there == here).all()


UNGUARDED = """
from posse_training.cli import main
policies = ["posse_baselines.policies.pursuit:Pursuit", "--planner-episodes", "0", "--no-figures"]
raise SystemExit(main(["compare", *policies, "--scenario", "constant", "--episodes", "2", "--out", "out"]))
"""


def test_a_script_without_a_main_guard_may_compare(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(UNGUARDED)
    printed("script.py", cwd=tmp_path)
    assert (tmp_path / "out").is_dir()


@pytest.mark.long
def test_a_policy_that_hangs_is_ended(tmp_path: Path) -> None:
    started = time.monotonic()
    settings = settings_for(tmp_path, "Sleeps", "SleepsInC", "Slow", limit=12.0)
    found = compare(settings)
    assert time.monotonic() - started < 240
    assert [row["policy"] for row in found.rows] == ["idle", "pursuit"]
    assert len(found.failed) == 3
    assert all("exceeded the time limit of 12 s" in row["why"] for row in found.failed)


HANG = """
import sys
from pathlib import Path
from posse_training.compare.compare import Settings, compare
if __name__ == "__main__":
    compare(Settings(("tests.support.bad_policies:HangsWithPid",), ("constant",), 1,
                     out=Path(sys.argv[1], "out"), figures=False, planner_episodes=0,
                     time_limit=30.0))
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_hanging_policy_does_not_outlive_a_killed_comparison(tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    running = subprocess.Popen(
        [sys.executable, "-c", HANG, str(tmp_path)],
        env={**os.environ, "PID_FILE": str(pid_file), "PYTHONPATH": os.pathsep.join(sys.path)},
        cwd=ROOT,
    )
    while not pid_file.exists() or not pid_file.read_text():
        assert running.poll() is None
        time.sleep(0.01)
    running.kill()
    running.wait()
    pid = int(pid_file.read_text())
    ends = time.monotonic() + 60
    while alive(pid) and time.monotonic() < ends:
        time.sleep(0.1)
    assert not alive(pid)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"


def test_the_command_says_who_failed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--scenario", "constant", "--episodes", "1", "--no-figures", "--planner-episodes", "0"]
    assert main(["compare", f"{BAD}Raises", "idle", *options, "--out", str(tmp_path / "a")]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert f"failed: {BAD}Raises on constant: ZeroDivisionError: [bold]by zero[/bold]" in shown
    assert main(["compare", f"{BAD}RaisesOnLoad", *options, "--out", str(tmp_path / "b")]) == 2
    assert "cannot be created without arguments: LookupError: no weights" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()
