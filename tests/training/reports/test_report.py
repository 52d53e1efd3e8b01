"""The report of a comparison: one file that holds all results and runs only its own code."""

from __future__ import annotations

import base64
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from tests.support.reports import HOSTILE, compared

import posse
from posse_training.replay.format import decode
from posse_training.replay.page import digest
from posse_training.reports.comparing.comparison import Comparison
from posse_training.reports.comparing.extremes import extremes
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.results import Results


class Page(HTMLParser):
    """The tags of a page with their attributes, its cells, and the contents of its scripts."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style", "td", "th", "h3"):
            self._open.append(dict(attrs).get("id") or tag)
            self.text.setdefault(self._open[-1], []).append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in ("script", "style", "td", "th", "h3"):
            self._open.pop()

    def handle_data(self, data: str) -> None:
        if self._open:
            self.text[self._open[-1]][-1] += data


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Comparison]:
    folder = tmp_path_factory.mktemp("compared") / "out"
    return folder / "report.html", compared(folder)


def test_it_holds_every_estimate_and_figure(found: tuple[Path, Comparison]) -> None:
    path, comparison = found
    page = Page(path)
    for row in comparison.rows:
        assert row["policy"] in page.text["th"]
        score = row["safe_score"]
        cell = f"{score.value:.3f}[{score.low:.3f}, {score.high:.3f}]"
        assert page.text["td"].count(cell) >= 2, "in the table of safe scores, and in all estimates"
    assert sum(tag == "svg" for tag, _ in page.tags) == 2
    identifiers = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(identifiers)) == len(identifiers)
    for _, attributes in page.tags:
        for value in (attributes.get("href"), (attributes.get("clip-path") or "")[4:-1]):
            assert not value or value.removeprefix("#") in identifiers


def test_it_loads_nothing_and_names_all_of_its_code(found: tuple[Path, Comparison]) -> None:
    page = Page(found[0])
    meta = next(a["content"] for t, a in page.tags if t == "meta" and "http-equiv" in a)
    policy = dict(part.strip().split(" ", 1) for part in str(meta).split(";"))
    assert policy["default-src"] == "'none'"
    assert f"'{digest(page.text['script'][0])}'" in policy["script-src"]
    assert f"'{digest(page.text['style'][0])}'" in policy["style-src"]
    assert "unsafe" not in str(meta)
    for tag, attributes in page.tags:
        assert tag not in ("link", "iframe", "img", "object", "base")
        assert not {"src", "style"} & set(attributes)
        assert not [name for name in attributes if name.startswith("on")]


def test_a_hostile_label_is_text(found: tuple[Path, Comparison], tmp_path: Path) -> None:
    compared(tmp_path / "plain", "a-plain-label", replays=2)
    plain, hostile = Page(tmp_path / "plain" / "report.html"), Page(found[0])

    def tags(page: Page) -> list[str]:
        return [tag for tag, _ in page.tags if tag not in ("path", "use", "g", "defs", "clippath")]

    assert tags(hostile) == tags(plain)
    assert hostile.text["script"] == plain.text["script"]
    assert hostile.text["shell"] == plain.text["shell"]
    assert HOSTILE in hostile.text["th"]


def test_replays_are_of_the_worlds_with_the_largest_differences(found: tuple[Path, Comparison]) -> None:
    path, comparison = found
    page = Page(path)
    wins, losses = extremes(comparison, 2)
    assert wins[0].policy == HOSTILE
    shown = json.loads(page.text["replays"][0])
    assert len(shown) == len(wins) + len(losses) >= 2
    for one, (_, header, data) in zip([*wins, *losses], shown, strict=True):
        replay = decode(header, base64.b64decode(data))
        assert [player.name for player in replay.players] == ["pursuit", one.policy]
        assert (replay.world["world"], replay.world["scenario"]) == (one.world, "constant")
        scores = [player.metrics["safe_score"] for player in replay.players]
        assert scores == [one.baseline, one.mine]
        assert f"{one.policy} on constant, world {one.world}" in page.text["h3"]


def plays_of(label: str, scenario: str, *seeds: list[float]) -> Plays:
    settings = posse.get_scenario(scenario)
    return Plays(label, tuple(Results(label, settings, 7, "test", {"safe_score": np.array(s)}) for s in seeds))


def test_extremes_are_paired_by_world_and_not_all_of_one_policy() -> None:
    found = Comparison("base")
    for plays in (
        plays_of("base", "smart", [0.5, 0.5, 0.5]),
        plays_of("mine", "smart", [0.6, 0.9, 0.8], [0.5, 0.1, 0.5]),
        plays_of("other", "smart", [0.5, 0.6, 0.5]),
        plays_of("planner", "smart", [1.0]),
        plays_of("mine", "radio", [1.0]),
    ):
        found.plays[plays.scenario.name, plays.label] = plays
    wins, losses = extremes(found, 3)
    assert [(w.policy, w.seed, w.world, w.mine, w.baseline) for w in wins] == [
        ("mine", 0, 1, 0.9, 0.5),
        ("other", 0, 1, 0.6, 0.5),
    ]
    assert [(w.policy, w.seed, w.world) for w in losses] == [("mine", 1, 1)]
    assert extremes(found, 0) == ([], [])
    del found.plays["smart", "mine"], found.plays["smart", "other"], found.plays["radio", "mine"]
    assert [w.policy for w in extremes(found, 3)[0]] == ["planner"]
