"""One bar for a whole comparison, with the time that is left."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from posse_training.reports.comparing.progress import Progress


class Clock:
    """A clock that is set by hand, s."""

    time = 0.0

    def __call__(self) -> float:
        return self.time


def play(progress: Progress, clock: Clock, label: str, worlds: int, seconds: float) -> None:
    progress.begin(label, "smart", worlds, 10)
    for _ in range(10):
        progress.advance(1)
        clock.time += seconds / 10
    progress.end()


def test_the_time_left_is_that_of_the_worlds_left_of_each_policy() -> None:
    clock, file = Clock(), io.StringIO()
    worlds = {"quick": 400, "slow": 400, "planner": 20}
    console = Console(file=file, width=80)
    progress = Progress(dict.fromkeys(worlds, 2), worlds, console, clock)
    with progress:
        assert progress.time_left == pytest.approx(800 * 0.004 + 20 * 0.4)
        play(progress, clock, "quick", 200, 2.0)  # 0.01 s for a world, and as much is expected
        assert progress.time_left == pytest.approx(200 * 0.01 + 400 * 0.01 + 20 * 0.4)
        play(progress, clock, "slow", 200, 20.0)
        play(progress, clock, "planner", 10, 30.0)
        assert progress.time_left == pytest.approx(2.0 + 20.0 + 30.0)
        progress.begin("quick", "radio", 200, 10)
        for _ in range(5):
            progress.advance(1)
            clock.time += 0.6
        assert progress.time_left == pytest.approx(3.0 + 20.0 + 30.0)
        progress.end()  # broken off: it is not played again
        assert progress.time_left == pytest.approx(20.0 + 30.0)
    lines = file.getvalue().splitlines()
    assert lines == [
        "2 of 6 evaluations, about 0:30 left: slow on smart",
        "3 of 6 evaluations, about 0:52 left: planner on smart",
    ]


def test_on_a_terminal_it_is_one_bar() -> None:
    file = io.StringIO()
    console = Console(file=file, width=80, force_terminal=True)
    with Progress({"idle": 1}, {"idle": 5}, console) as progress:
        progress.begin("idle", "smart", 5, 10)
        progress.advance(10)
        progress.end()
    shown = file.getvalue()
    assert "━━━━" in shown
    assert "1 of 1 evaluations" in shown
