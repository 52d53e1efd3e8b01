"""The verdict follows from the scores and events; the command makes the page again."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest
from tests.support.replays import hostile, short

from posse_training.cli import main
from posse_training.replay import Event, Player, Replay, read_replay, record, write_replay
from posse_training.replay.page import command, verdict

WAY = [0.0] * 10
FULL = [1.0] * 40


def player(name: str, scores: list[float], *events: tuple[int, str]) -> Player:
    return Player(name, {"score": np.array([0.0, *scores])}, tuple(Event(step, kind, "") for step, kind in events))


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (
            player("b", [*WAY, *FULL[:20], *[0.0] * 20], (31, "break")),
            "40 %; most of the difference arose after 1 break.",
        ),
        (
            player("b", [*WAY, *WAY, *FULL[:30]], (5, "dart")),
            "60 %; most of the difference arose on the way to the slots.",
        ),
        (player("b", [*WAY, *[0.9] * 40]), "72 %."),  # nowhere in particular
        (player("b", [*WAY, *FULL], (11, "dart")), "80 %."),
        (
            player("b", [*WAY, *WAY[:5], *FULL[:5], *WAY, *FULL[:20]], (21, "dart")),
            "50 %; most of the difference arose in 1 dart.",
        ),
        (
            player("b", [*WAY, *FULL[:10], *([*WAY, *FULL[:5]] * 2)], (21, "dart"), (36, "dart")),
            "40 %; most of the difference arose in 2 darts.",
        ),
        (player("b", [*WAY, *FULL], (15, "contact")), "80 % (none counts from its contact at 1.5 s on)."),
    ],
)
def test_a_sentence_names_the_shares_held_and_where_the_difference_arose(second: Player, told: str) -> None:
    first = player("a", [*WAY, *FULL])
    replay = Replay({"settings": {"control_step": 0.1}}, (first, second))
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
    assert command(record(["idle"], "smart", target_speed=0.5, seconds=1)).endswith(" --set target_speed=0.5")
    assert command(short()).startswith("posse replay ddcs-distributed pursuit --scenario field ")
