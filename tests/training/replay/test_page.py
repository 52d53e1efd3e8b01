"""A page is one small file that makes no requests."""

from __future__ import annotations

import html
import re
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from tests.support.browser import Tags
from tests.support.replays import ATTACK, hostile, short

from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.replay import Replay, read_replay, record, write_replay
from posse_training.replay.format import resolution_of
from posse_training.replay.page import page, verdict


@pytest.mark.parametrize("scenario", ["smart", "field"])
@pytest.mark.parametrize(("observations", "most"), [(True, 1_000_000), (False, 200_000)])
def test_a_minute_of_two_teams_of_six_can_be_mailed(scenario: str, observations: bool, most: int) -> None:
    replay = record(
        ["ddcs-distributed", "corrected-field"], scenario, world=3, num_trackers=6, observations=observations
    )
    assert replay.players[0].frames == 601
    assert len(page(replay).encode()) <= most


@pytest.mark.parametrize("made", [short, partial(short, "constant"), hostile])
def test_what_is_written_is_read(made: Callable[[], Replay], tmp_path: Path) -> None:
    replay = made()
    back = read_replay(write_replay(replay, tmp_path / "deep" / "a.html"))
    assert back.world == replay.world
    for mine, theirs in zip(back.players, replay.players, strict=True):
        assert (mine.name, mine.events, mine.about) == (theirs.name, theirs.events, theirs.about)
        np.testing.assert_equal(mine.metrics, theirs.metrics)  # with infinities, and nan for what never happened
        for name, values in theirs.columns.items():
            off = np.abs(mine.columns[name] - values.astype(np.float64))
            assert off.max(initial=0) <= resolution_of(name, values) * 0.501, name


def test_a_page_loads_nothing() -> None:
    for tag, attributes in Tags(page(short())).tags:
        assert tag not in ("link", "iframe", "img", "object", "base")
        assert not {"src", "style", *(["href"] if tag != "a" else [])} & set(attributes)
        assert not [name for name in attributes if name.startswith("on")]


def test_a_page_describes_itself_for_a_preview_and_links_the_project() -> None:
    tags = Tags(page(short())).tags
    told = {one.get("name") or one.get("property"): one.get("content") for tag, one in tags if tag == "meta"}
    assert told["description"] == told["og:description"] == verdict(short())
    assert told["og:title"] == "ddcs-distributed and pursuit on field"
    pyproject = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())
    assert [one["href"] for tag, one in tags if tag == "a"] == [pyproject["project"]["urls"]["Repository"]]


def test_nothing_of_a_hostile_name_is_markup() -> None:
    replay = hostile()
    assert replay.players[0].name == ATTACK
    text = page(replay)
    plain, hostile_tags = Tags(page(short())), Tags(text)
    assert [tag for tag, _ in hostile_tags.tags] == [tag for tag, _ in plain.tags]
    assert text.count("</script") == page(short()).count("</script")
    assert hostile_tags.inline["code"] == plain.inline["code"]
    title = re.search("<title>(.*?)</title>", text)
    assert title is not None
    assert "<" not in title[1]
    assert html.unescape(title[1]).startswith(ATTACK)


def test_a_path_or_file_that_is_no_page_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"must end in \.html"):
        write_replay(short(), tmp_path / "a.gif")
    with pytest.raises(SettingsError, match="cannot read a replay"):
        read_replay(tmp_path / "none.html")
    (tmp_path / "other.html").write_text("<p>")
    with pytest.raises(SettingsError, match="is no replay"):
        read_replay(tmp_path / "other.html")
    path = write_replay(short("constant"), tmp_path / "a.html")
    path.write_text(path.read_text().replace('id="data">', 'id="data">=x=', 1))
    with pytest.raises(SettingsError, match=r"cannot read a replay from .*a\.html"):
        read_replay(path)


def test_the_command_writes_a_page_and_takes_players_from_pages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    world = ["--scenario", "smart", "--world", "3", "--seconds", "1", "--no-observations"]
    assert main(["replay", "idle", "pursuit", *world, "--set", "num_trackers=3"]) == 0
    assert "replay.html" in capsys.readouterr().out
    assert main(["replay", "replay.html", "random", *world, "--set", "num_trackers=3", "--out", "all.html"]) == 0
    replay = read_replay(tmp_path / "all.html")
    assert [player.name for player in replay.players] == ["idle", "pursuit", "random"]
    assert replay.world["world"] == 3
    assert replay.world["changed"] == {"num_trackers": [5, 3]}
    assert main(["replay", "replay.html", "random", *world]) == 2
    assert "did not play the same world: num_trackers" in capsys.readouterr().err
