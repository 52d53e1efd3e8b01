"""Figures show their data, and a policy has the same style in all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import posse
from posse_baselines import policy_names
from posse_training.reports.pictures import figures
from posse_training.reports.pictures.style import STYLES, style_of
from posse_training.reports.plays import Plays
from posse_training.reports.results import Results
from posse_training.reports.statistics import Estimate
from posse_training.reports.sweeps import BOUND, SWEEPS, Point


def plays_of(label: str, scenario: str, **columns: list[float] | list[list[float]]) -> Plays:
    given = {name: np.atleast_2d(values) for name, values in columns.items()}
    seeds = len(next(iter(given.values())))
    return Plays(
        label,
        tuple(
            Results(
                label, posse.get_scenario(scenario), 7, "test",
                {name: np.asarray(values[k], np.float64) for name, values in given.items()},
            )
            for k in range(seeds)
        ),
    )  # fmt: skip


def line(figure: Figure, policy: str) -> tuple[list[float], list[float]]:
    """The longest line that is drawn in a policy's colour and kind of line."""
    style = style_of(policy)
    found = [
        drawn
        for axis in figure.axes
        for drawn in axis.lines
        if drawn.get_color() == style.colour and len(np.atleast_1d(drawn.get_xdata())) > 2
    ]
    assert found, policy
    longest = max(found, key=lambda drawn: len(np.atleast_1d(drawn.get_xdata())))
    return list(np.asarray(longest.get_xdata())), list(np.asarray(longest.get_ydata()))


def test_a_profile_is_the_share_of_worlds_with_at_least_a_score() -> None:
    scores = [0.2, 0.4, 0.4, 0.9]
    figure = figures.profile(
        {("smart", "pursuit"): plays_of("pursuit", "smart", safe_score=scores, bound=[1.0] * 4)}
    )
    x, y = line(figure, "pursuit")
    at = dict(zip(np.round(x, 4), y, strict=True))
    for score, expected in ((0.0, 1), (0.2, 1), (0.2025, 0.75), (0.4, 0.75), (0.5, 0.25), (1, 0)):
        assert at[score] == expected
    _, bound = line(figure, BOUND)
    assert set(bound) == {1.0}


def test_scores_and_bounds_stand_where_they_should() -> None:
    figure = figures.scores(
        {
            (name, policy): plays_of(policy, name, safe_score=[low, low + 0.2], bound=[0.9, 0.8])
            for name, low in (("smart", 0.3), ("radio", 0.5))
            for policy in ("planner", "pursuit")
        }
    )
    (axis,) = figure.axes
    assert [label.get_text() for label in axis.get_yticklabels()] == ["smart", "radio"]
    points = [
        (
            round(float(np.ravel(drawn.get_xdata())[0]), 6),
            round(float(np.ravel(drawn.get_ydata())[0])),
        )
        for drawn in axis.lines
        if drawn.get_marker() == STYLES["planner"].marker
    ]
    assert points == [(0.4, 0), (0.6, 1)]
    upright = [drawn for drawn in axis.lines if len(set(np.atleast_1d(drawn.get_xdata()))) == 1]
    bounds = [drawn for drawn in upright if drawn.get_color() == STYLES[BOUND].colour]
    assert {round(float(np.asarray(drawn.get_xdata())[0]), 6) for drawn in bounds} >= {0.85}


def test_a_sweep_shows_every_point_and_marks_the_scenarios_own_value() -> None:
    sweep = SWEEPS[0]
    points = [
        Point(sweep.name, value, policy, Estimate(score, score - 0.1, score + 0.1, 9))
        for policy, base in (("pursuit", 0.1), ("planner", 0.5), (BOUND, 0.9))
        for value in reversed(sweep.values)  # in whatever order
        for score in [base + value / 1000]
    ]
    figure = figures.sweep_figure(sweep, points)
    x, y = line(figure, "pursuit")
    assert x == list(sweep.values)
    assert y == pytest.approx([0.1 + value / 1000 for value in sweep.values])
    (axis,) = figure.axes
    own = [d for d in axis.lines if list(np.atleast_1d(d.get_xdata())) == [sweep.own] * 2]
    assert len(own) == 1


def test_recovery_is_the_share_that_has_settled_anew_by_then() -> None:
    """Teams that never recover count, and no team counts after the end of its episode."""
    taken = [1.0, 2.0, np.nan, np.nan]
    figure = figures.recovery([plays_of("pursuit", "leader-loss", recovery_time=taken)])
    x, y = line(figure, "pursuit")
    at = dict(zip(np.round(x, 6), y, strict=True))
    assert (at[0.9], at[1.0], at[1.9], at[2.0]) == (0, 0.25, 0.25, 0.5)
    scenario = posse.get_scenario("leader-loss")
    assert max(x) == pytest.approx(0.4 * scenario.duration - scenario.settle_time)
    assert max(y) == 0.5
    seeds = plays_of("mine", "leader-loss", recovery_time=[[1.0, np.nan], [1.0, 1.0]])
    band = figures._recovered(seeds, 1.0)
    assert (band.value, band.low, band.high) == (0.75, 0.5, 1.0)


def test_a_policy_looks_the_same_whoever_else_is_there() -> None:
    assert {name for name in policy_names() if not name.startswith("learned-")} <= set(STYLES)
    looks = {(style.colour, style.marker, str(style.line)) for style in STYLES.values()}
    assert len(looks) == len(STYLES)
    assert style_of("mine") == style_of("mine")
    assert style_of("mine") not in STYLES.values()


def test_the_same_figure_is_the_same_file(tmp_path: Path) -> None:
    plays = {("smart", "idle"): plays_of("idle", "smart", safe_score=[0.1, 0.3], bound=[1.0, 1.0])}
    for name in "ab":
        (tmp_path / name).mkdir()
        files = figures.draw(tmp_path / name, plays, [], [])
        assert [path.name for path in files] == [
            "profile.png", "profile.svg", "scenarios.png", "scenarios.svg",
        ]  # fmt: skip
    for path in files:
        assert path.read_bytes() == (tmp_path / "a" / path.name).read_bytes()
