"""The report of a comparison: one page that holds all estimates and figures, with replays beside it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import posse
from posse_training.compare.compare import Comparison, Settings, compare
from posse_training.compare.plays import Plays
from posse_training.compare.report import extremes
from posse_training.evaluation.results import Results
from posse_training.replay import read_replay

HOSTILE = "</script><script>alert(1)</script><img src onerror>'\"&lt;{{title}}<!--$x$]]>"


class Page(HTMLParser):
    """The tags of a page with their attributes, and its text."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    policies = ("pursuit", f"{HOSTILE}=ddcs-distributed", "idle")
    out = tmp_path_factory.mktemp("compared")
    return compare(Settings(policies, ("constant",), episodes=3, out=out, planner_episodes=0, replays=2))


def test_it_holds_all_estimates_and_figures_and_a_hostile_label_is_text(found: Comparison) -> None:
    page = Page(found.folder / "report.html")
    for score in (row["safe_score"] for row in found.rows):
        assert f"{score.value:.3f}[{score.low:.3f}, {score.high:.3f}]" in page.text
    assert [attributes["src"] for tag, attributes in page.tags if tag == "img"] == ["scenarios.svg", "profile.svg"]
    assert HOSTILE in page.text
    assert "script" not in {tag for tag, _ in page.tags}
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]


def test_replays_are_of_the_worlds_with_the_largest_differences(found: Comparison) -> None:
    page = Page(found.folder / "report.html")
    files = [str(attributes["href"]) for tag, attributes in page.tags if tag == "a"]
    shown = extremes(found.plays, found.reference, 2)
    assert shown[0].policy == HOSTILE
    assert len(files) == len(shown) >= 2
    for one, file in zip(shown, files, strict=True):
        assert re.fullmatch(r"[\w.-]+", file)
        replay = read_replay(found.folder / file)
        assert [player.name for player in replay.players] == ["pursuit", one.policy]
        assert (replay.world["world"], replay.world["scenario"]) == (one.world, "constant")
        assert [player.metrics["safe_score"] for player in replay.players] == [one.baseline, one.mine]


def plays_of(label: str, scenario: str, *seeds: list[float]) -> Plays:
    settings = posse.get_scenario(scenario)
    return Plays(label, tuple(Results(label, settings, 7, "test", {"safe_score": np.array(s)}) for s in seeds))


def test_extremes_are_paired_by_world_and_not_all_of_one_policy() -> None:
    made = (
        plays_of("base", "smart", [0.5, 0.5, 0.5]),
        plays_of("mine", "smart", [0.6, 0.9, 0.8], [0.5, 0.1, 0.5]),
        plays_of("other", "smart", [0.5, 0.6, 0.5]),
        plays_of("planner", "smart", [1.0]),
        plays_of("mine", "radio", [1.0]),
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
