"""Figures of a comparison show its data; one page holds all estimates and figures, with replays beside it."""

import html
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import posse
from posse_training.compare import figures
from posse_training.compare.compare import CompareSettings, Comparison, compare
from posse_training.compare.contenders import Contender, Plays
from posse_training.compare.report import extremes
from posse_training.evaluation.results import Results
from posse_training.replay import read_replay
from posse_training.style import BOUND, legend, looks_of

HOSTILE = "</script><script>alert(1)</script><img src onerror>'\"&lt;{{title}}<!--$x$]]>"


def page_of(found: Comparison) -> str:
    return (found.folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    policies = ("pursuit", f"{HOSTILE}=ddcs-distributed", "idle")
    out = tmp_path_factory.mktemp("compared")
    return compare(CompareSettings(policies, ("constant",), episodes=3, out=out, planner_episodes=0, replays=2))


def test_it_holds_all_estimates_and_figures_and_a_hostile_label_is_text(found: Comparison) -> None:
    page = page_of(found)
    text = html.unescape(re.sub("<[^>]*>", "", page))
    for score in (row["safe_score"] for row in found.rows):
        assert f"{score.value:.3f}[{score.low:.3f}, {score.high:.3f}]" in text
    assert re.findall(r'<img [^>]*src="([^"]*)"', page) == ["scenarios.svg", "profile.svg"]
    assert HOSTILE in text
    assert not re.search(r"<script|<[^>]*\son[a-z]+[=>]", page)


def test_replays_are_of_the_worlds_with_the_largest_differences(found: Comparison) -> None:
    files = re.findall(r'<a [^>]*href="([^"]*)"', page_of(found))
    shown = extremes(found.plays, found.reference, 2)
    assert shown[0].policy == HOSTILE
    assert len(files) == len(shown) >= 2
    for one, file in zip(shown, files, strict=True):
        assert re.fullmatch(r"[\w.-]+", file)
        replay = read_replay(found.folder / file)
        assert [player.name for player in replay.players] == ["pursuit", one.policy]
        assert (replay.world["world"], replay.world["settings"]["name"]) == (one.world, "constant")
        assert [player.metrics["safe_score"] for player in replay.players] == [one.baseline, one.mine]


def test_extremes_are_paired_by_world_and_not_all_of_one_policy() -> None:
    made = (
        plays_of("base", "smart", safe_score=[0.5, 0.5, 0.5]),
        plays_of("mine", "smart", safe_score=[[0.6, 0.9, 0.8], [0.5, 0.1, 0.5]]),
        plays_of("other", "smart", safe_score=[0.5, 0.6, 0.5]),
        plays_of("planner", "smart", safe_score=[1.0]),
        plays_of("mine", "radio", safe_score=[1.0]),
    )
    plays = {(each.scenario.name, each.label): each for each in made}
    shown = extremes(plays, "base", 3)
    assert [(w.policy, w.seed, w.world, w.mine, w.baseline) for w in shown] == [
        ("mine", 0, 1, 0.9, 0.5),
        ("other", 0, 1, 0.6, 0.5),
        ("mine", 1, 1, 0.1, 0.5),
    ]
    assert extremes(plays, "base", 0) == []
    few = {key: each for key, each in plays.items() if key[1] in ("base", "planner")}
    assert [w.policy for w in extremes(few, "base", 3)] == ["planner"]


LOOKS = looks_of(["pursuit", "planner", "mine", "other", "idle"])


def plays_of(label: str, scenario: str, **columns: list[float] | list[list[float]]) -> Plays:
    """Columns of one training seed, or of several."""
    given = {name: np.atleast_2d(np.asarray(values, np.float64)) for name, values in columns.items()}
    seeds = [{name: values[k] for name, values in given.items()} for k in range(len(next(iter(given.values()))))]
    settings = posse.get_scenario(scenario)
    return Plays(label, tuple(Results(label, settings, 7, "test", columns) for columns in seeds))


def line(figure: Figure, policy: str) -> tuple[list[float], list[float]]:
    """The longest line that is drawn in a policy's colour."""
    found = [each for axis in figure.axes for each in axis.lines if each.get_color() == LOOKS[policy].colour]
    longest = max(found, key=lambda drawn: len(np.atleast_1d(drawn.get_xdata())))
    return list(np.asarray(longest.get_xdata())), list(np.asarray(longest.get_ydata()))


def test_a_legend_names_every_policy() -> None:
    names, figure = ["_mine", "a$b$"], Figure(layout="constrained")
    legend(figure, names, looks_of(names))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [" _mine", r"a\$b\$"]


def test_a_curve_of_no_finite_numbers_is_not_drawn() -> None:
    point = dict.fromkeys(("steps", "safe_score", "low", "high"), np.nan)
    curves: list[Any] = [[point, point], [{**point, "low": "x"}], [{}]]
    for curve in curves:
        policy: Any = SimpleNamespace(card={"curve": curve})
        assert figures.curves_of([Contender("a", (policy,))]) == []


def test_a_profile_is_the_share_of_worlds_with_at_least_a_score() -> None:
    scores = [0.2, 0.4, 0.4, 0.9]
    plays = {("smart", "pursuit"): plays_of("pursuit", "smart", safe_score=scores, bound=[1.0] * 4)}
    figure = figures.profile(plays, LOOKS)
    x, y = line(figure, "pursuit")
    at = dict(zip(np.round(x, 4), y, strict=True))
    for score, expected in ((0.0, 1), (0.2, 1), (0.205, 0.75), (0.4, 0.75), (0.5, 0.25), (1, 0)):
        assert at[score] == expected
    _, bound = line(figure, BOUND)
    assert set(bound) == {1.0}
