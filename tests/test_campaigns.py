"""The short forms of campaigns; ``make fuzz MINUTES=30`` runs the long ones."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.fuzz import calls, forged, full_disk, kills, processes, threads, together, worlds
from tests.fuzz.campaign import campaign
from tests.fuzz.campaigns import CAMPAIGNS
from tests.fuzz.commands import COMMANDS
from tests.fuzz.page import BEGIN, END, with_figures

import posse

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("case", "cases"),
    [
        (worlds.case, 15),
        (calls.case, 2),
        (threads.case, 3),
        (forged.case, 50),
        pytest.param(processes.case, 12, marks=pytest.mark.long),
    ],
    ids=["worlds", "calls", "threads", "forged", "processes"],
)
def test_no_case_fails(case: Any, cases: int) -> None:
    tries, failures = campaign(case, seed=0, cases=cases)
    assert failures == []
    assert tries == cases


@pytest.mark.long
@pytest.mark.parametrize(
    ("case", "first"),
    [(kills.case, 0), (full_disk.case, 3), (together.case, 6)],
    ids=["kills", "full_disk", "together"],
)
def test_no_case_of_commands_fails(case: Any, first: int) -> None:
    """Case k runs command k modulo their number: together, each of them once."""
    assert len(COMMANDS) <= 9
    tries, failures = campaign(case, seed=0, first=first, cases=3)
    assert failures == []
    assert tries == 3


def test_campaigns_run_by_one_command_that_keeps_their_figures(tmp_path: Path) -> None:
    figures = tmp_path / "runs" / "figures.json"
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "worlds", "--cases", "2", "--figures", str(figures)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    row = json.loads(figures.read_text())["worlds"]
    assert (row["tries"], row["failures"], row["seed"]) == (2, 0, 0)
    assert "| 2 | 0 |" in with_figures(f"{BEGIN}{END}", {"worlds": row})


def test_every_campaign_has_a_module_that_plays_alone() -> None:
    modules = {path.stem for path in (ROOT / "tests" / "fuzz").glob("*.py")}
    assert set(CAMPAIGNS) <= modules


def test_a_campaign_that_is_not_there_is_named() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "wrlds"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "no campaign 'wrlds'; there are: worlds, calls" in done.stderr


def test_scenarios_are_drawn_over_every_setting() -> None:
    rng, seen = random.Random(0), set()
    for _ in range(600):
        drawn = worlds.scenario(rng)
        if drawn is not None:
            base = posse.get_scenario(drawn.name).to_dict()
            seen |= {name for name, value in drawn.to_dict().items() if value != base[name]}
    several = {
        name
        for name, setting in posse.Scenario.settings().items()
        if setting.choices is None or len(tuple(setting.choices())) > 1
    }
    assert seen >= several - {"name", "meaning", "version", "extra_fields", "metrics"}


def test_a_failure_is_told_with_the_case_that_plays_it_again() -> None:
    def even(seed: int, number: int) -> None:
        assert number % 2 == 0, f"odd {seed}"

    tries, failures = campaign(even, seed=7, first=1, cases=3)
    assert tries == 3
    assert len(failures) == 2
    assert failures[0].startswith("seed 7, case 1:\n")
    assert "odd 7" in failures[0]
