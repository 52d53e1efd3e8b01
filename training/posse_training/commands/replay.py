"""``posse replay``: teams on the same world, as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from posse_training.options import Shown
from posse_training.replay import Replay, join, read_replay, record, write_replay


@dataclass(frozen=True, kw_only=True)
class _Replay(Shown):
    """Write one HTML file in which one to four teams play the same world side by side.

    Beside policies, replays (.html) of the same world can be given, whose players are included.
    """

    observations: bool = True
    """Record the observations of every tracker, which are most of the file's size."""
    out: Path = Path("replay.html")
    """File to write; an old one is replaced."""


def main(arguments: Sequence[str]) -> None:
    """Play the world and write the page."""
    which = tyro.cli(_Replay, prog="posse replay", args=arguments)
    played = {"target": which.target, "seconds": which.seconds, "observations": which.observations, **which.place}

    def made(player: str) -> Replay:
        if Path(player).suffix.lower() in (".html", ".htm"):
            return read_replay(player)
        return record([player], which.scenario, **played, **which.overrides)

    path = write_replay(join([made(player) for player in which.policies]), which.out)
    print(f"{path} ({path.stat().st_size / 1000:.0f} kB): open it in a browser")
