"""Results are played again: true ones hold, forged ones do not, on this machine and on others."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from posse_baselines.registry import shipped
from posse_training import cli, evaluate
from posse_training.leaderboard import ResultFile, play_for_result, read_result, verify, write_result

SCENARIO = "paper-distributed"
WORLDS = 100


@pytest.fixture(scope="module")
def result() -> ResultFile:
    return play_for_result("pursuit", SCENARIO, worlds=WORLDS, progress=False)


def with_row(result: ResultFile, metric: str, world: int, value: float) -> ResultFile:
    values = list(result.rows[metric])
    values[world] = value
    return dataclasses.replace(result, rows={**result.rows, metric: tuple(values)})


def all_better(result: ResultFile, by: float) -> ResultFile:
    score = np.minimum(result.column("score") + by, 1.0).round(6)
    safe = np.where(result.column("contact_free") == 1, score, result.column("safe_score"))
    rows = {**result.rows, "score": tuple(score.tolist()), "safe_score": tuple(safe.tolist())}
    return dataclasses.replace(result, rows=rows)


def test_rows_are_those_of_an_evaluation(result: ResultFile) -> None:
    played = evaluate("pursuit", SCENARIO, WORLDS, 2026, progress=False)
    for metric in ("safe_score", "score", "contact_free"):
        assert np.abs(result.column(metric) - played[metric]).max() <= 0.5e-6
    assert not result.reads_state
    assert (result.seed, result.split, result.worlds) == (2026, "test", WORLDS)


def test_a_true_result_holds(result: ResultFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_result(result, tmp_path / "r.json")
    assert cli.main(["verify", str(path)]) == 0
    assert f"holds: all {WORLDS} worlds are equal" in capsys.readouterr().out


def test_one_forged_row_is_found(result: ResultFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    better = round(result.rows["score"][17] + 1e-6, 6)
    forged = with_row(result, "score", 17, better)
    if result.rows["contact_free"][17] == 1:
        forged = with_row(forged, "safe_score", 17, better)
    path = write_result(forged, tmp_path / "r.json")
    assert cli.main(["verify", str(path)]) == 1
    out = capsys.readouterr().out
    assert "DOES NOT HOLD: 1 of 100 worlds differ" in out
    assert "first world 17" in out


def test_on_another_machine_means_decide(result: ResultFile, tmp_path: Path) -> None:
    elsewhere = dataclasses.replace(result, machine="another machine")
    slightly = verify(write_result(all_better(elsewhere, 0.004), tmp_path / "a.json"), progress=False)
    assert slightly.holds
    assert not slightly.same_machine
    assert slightly.differing > 0
    forged = verify(write_result(all_better(elsewhere, 0.05), tmp_path / "b.json"), progress=False)
    assert not forged.holds
    assert forged.off["score"] == pytest.approx(0.05, abs=0.01)
    few = {name: values[:20] for name, values in all_better(elsewhere, 0.004).rows.items()}
    short = dataclasses.replace(elsewhere, rows=few)
    assert "too few" in verify(write_result(short, tmp_path / "c.json"), progress=False).explanation


def test_a_policy_file_travels_with_its_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = tmp_path / "mine.safetensors"
    given.write_bytes(shipped()["learned-smart"].read_bytes())
    out = tmp_path / "sent" / "r.json"
    arguments = ["--scenario", SCENARIO, "--worlds", "3", "--out", str(out), "--label", "mine"]
    assert cli.main(["submit", str(given), *arguments]) == 0
    assert "posse verify" in capsys.readouterr().out
    sent = read_result(out)
    assert (sent.policy_kind, sent.policy, sent.label) == ("file", "mine.safetensors", "mine")
    assert verify(out, progress=False).holds


def test_the_file_to_write_ends_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["submit", "pursuit", "--out", "r.csv"]) == 2
    assert "must end in .json" in capsys.readouterr().err
