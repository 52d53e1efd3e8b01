"""On a terminal of 80 columns no command cuts what it shows."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import pytest
from rich.console import Console
from tests.support.terminal import WIDTH, holds, on_a_terminal

import posse
from posse_baselines import tunable
from posse_training import demo
from posse_training.cli import main
from posse_training.reports.comparing.comparison import Comparison, table
from posse_training.reports.comparing.progress import Progress
from posse_training.reports.evaluation import evaluate
from posse_training.reports.reproduce import Settings
from posse_training.reports.reproduce import table as settling_times
from posse_training.reports.statistics import Estimate
from posse_training.tuning.display import Display
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.state import State

LONG = "a-policy-with-a-very-long-name-such-as-a-file-in-a-folder-has/of-one-hundred-characters-[b]"


def test_a_comparison() -> None:
    of = Estimate(-0.123, -0.456, -0.789, 9)
    row = {
        "scenario": "paper-centralized",
        "seeds": 3,
        "safe_score": of,
        "of_planner": 0.42,
        "score": of,
        "contact_free": Estimate(1.0, 1.0, 1.0, 9),
        "bound": of,
        "settled": of,
        "difference": of,
        "improvement": Estimate(0.875, 0.1, 0.9, 9),
    }
    rows = [{**row, "policy": policy} for policy in (LONG, "ddcs-centralized-no-exchange")]

    class Worlds:
        seed, split, episodes = 7, "validation", 1_000_000
        target: ClassVar[str | None] = None

    text = on_a_terminal(table(Comparison("ddcs-centralized-no-exchange", rows=rows), Worlds, WIDTH))
    for policy in ("ddcs-centralized", "-no-exchange"):
        holds(text, policy)
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if line.strip().startswith("a-policy"))
    first = [line.split()[0] for line in lines[start:] if line.strip()]
    assert "".join(first).startswith(LONG)
    holds(text, "-0.123", "[-0.456, -0.789]", "0.42", "100.0 %", "87.5 %", "paper-centralized")


@pytest.mark.parametrize("name", [[], ["field"], ["paper-distributed"]])
def test_scenarios(name: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    assert main(["scenarios", *name]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= WIDTH
    assert "…" not in text
    shown = "".join(text.split())
    settings = posse.get_scenario(*name or ["field"]).to_dict()
    for key in ("radio_outages", "start_distance", "break_choice"):
        assert key in shown
        assert str(settings[key]).replace(" ", "") in shown


def test_the_demo() -> None:
    played = evaluate("idle", "constant", 2, progress=False, horizon=40, settle_time=1.0)
    names = [*demo.POLICIES, demo.LEARNED]
    text = on_a_terminal(demo.table({("accelerating", name): played for name in names}))
    holds(text, "accelerating", "tracking error, m", "worlds with a contact", *names)


def test_the_papers_experiments() -> None:
    row = {
        "policy": "ddcs-centralized-no-exchange",
        "model": "centralized",
        "starts": 1000,
        "paper_settling_time": 10.5,
        "settling_time_quartiles": [10.5, 11.5, 12.5],
        "settled": 1000,
        "in_slots": 1000,
    }
    text = on_a_terminal(settling_times([row], Settings(starts=1000)))
    holds(text, "[quartiles]", "centralized", "11.5 [10.5, 12.5]", "ddcs-centralized-no-exchange")
    holds(text, "1,000 starts of paper-distributed v1, test split, seed 7")


def test_a_tuning(tmp_path: Path) -> None:
    settings = TuneSettings(policy="ddcs-centralized-no-exchange", scenario="paper-distributed", out=tmp_path)
    knobs = tunable("ddcs-distributed")
    found = {knob.name: knob.high for knob in knobs}
    point = {"generation": 3, "score": 0.5, "low": 0.4, "high": 0.6, "settings": found}
    state = State({}, [knob.name for knob in knobs])
    state.curve = [point] * 60
    display = Display(settings, Console(width=WIDTH))
    display.begin(state, knobs)
    text = on_a_terminal(display._render())
    holds(text, "tuning ddcs-centralized-no-exchange on paper-distributed, seed", "0.500")


def test_the_bar_of_a_comparison() -> None:
    progress = Progress({LONG: 1000}, {LONG: 10**6}, Console(width=WIDTH))
    progress.begin(LONG, "target-speed 0.9", 1000, 600)
    holds(on_a_terminal(progress._render()), f"{LONG} on target-speed 0.9", "0 of 1000 evaluations")
