"""A page is one small file; its verdict follows from scores and events."""

import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from tests.support.learned import policy_for
from tests.support.replays import hostile, short

import posse
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.replay import Event, Player, Replay, read_replay, record, write_replay
from posse_training.replay.format import resolution_of
from posse_training.replay.page import command, verdict


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


def test_a_path_or_file_that_is_no_page_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"must end in \.html"):
        write_replay(short(), tmp_path / "a.gif")
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
    assert main(["replay", "replay.html", "random", *world[:-1], "--set", "num_trackers=3", "--out", "all.html"]) == 0
    assert command(read_replay(tmp_path / "all.html")) == "", "one played with other options"
    duel = ["--scenario", "duel", "--seconds", "1", "--target"]
    assert main(["replay", "idle", *duel, "evader"]) == 0
    assert main(["replay", "replay.html", "idle", *duel, "eight"]) == 2
    assert "did not play the same world: target differ" in capsys.readouterr().err


WAY = [0.0] * 10
FULL = [1.0] * 40
MOST = "most of the difference arose"


def player(name: str, scores: list[float], *events: tuple[int, str]) -> Player:
    return Player(name, {"score": np.array([0.0, *scores])}, tuple(Event(step, kind, "") for step, kind in events))


@pytest.mark.parametrize(
    ("scores", "events", "told"),
    [
        ([*WAY, *FULL[:20], *[0.0] * 20], [(31, "break")], f"40 %; {MOST} after 1 break."),
        ([*WAY, *WAY, *FULL[:30]], [(5, "dart")], f"60 %; {MOST} on the way to the slots."),
        ([*WAY, *[0.9] * 40], [], "72 %."),  # nowhere in particular
        ([*WAY, *FULL[:10], *([*WAY, *FULL[:5]] * 2)], [(21, "dart"), (36, "dart")], f"40 %; {MOST} in 2 darts."),
        ([*WAY, *FULL], [(15, "contact")], "80 % (none counts from its contact at 1.5 s on)."),
    ],
)
def test_a_sentence_names_the_shares_held_and_where_the_difference_arose(
    scores: list[float], events: list[tuple[int, str]], told: str
) -> None:
    replay = Replay({"settings": {"control_step": 0.1}}, (player("a", [*WAY, *FULL]), player("b", scores, *events)))
    assert verdict(replay) == f"a held 80 % of its slots, b {told}"


def test_the_command_makes_the_same_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    replay = record(["idle", "pursuit"], "duel", num_trackers=3, target="eight", seconds=2, observations=False)
    path = write_replay(replay, "replay.html")
    again = shlex.split(command(read_replay(path)))
    assert main([*again[1:], "--out", "again.html"]) == 0
    assert Path("again.html").read_text() == path.read_text()


def test_what_no_command_makes_has_none() -> None:
    assert command(hostile()) == ""
    assert command(record(["idle"], "smart", seconds=0.01, reward_weights={"slot": 2.0})) == ""
    team = policy_for(posse.batch("smart").layout).with_card({"name": "mine", "check": {"seed": 1}, "seed": 2})
    player = record([team], "smart", seconds=0.01).players[0]
    assert (player.frames, player.about) == (2, {"name": "mine", "seed": 2})
    assert command(record(["idle"], "smart", target_speed=0.5, seconds=1)).endswith(" --set target_speed=0.5")
    assert command(short()).startswith("posse replay ddcs-distributed pursuit --scenario field ")
