"""``posse replay``: teams on the same world, as one HTML file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import tyro

from posse_training.errors import SettingsError
from posse_training.options import Shown
from posse_training.replay import join, read_replay, record, write_replay
from posse_training.replay.page import PAGES, check_page


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
    check_page(which.out)
    read = [Path(player).suffix.lower() in PAGES for player in which.policies]
    if read and all(read) and which != replace(_Replay(), policies=which.policies, out=which.out):
        raise SettingsError("nothing is played, since all are replays: leave out the options other than --out")
    played = {"target": which.target, "seconds": which.seconds, "observations": which.observations, **which.place}

    replays = [
        read_replay(player) if is_read else record([player], which.scenario, **played, **which.overrides)
        for player, is_read in zip(which.policies, read, strict=True)
    ]
    path = write_replay(join(replays), which.out)
    print(f"{path} ({path.stat().st_size / 1000:.0f} kB): open it in a browser")
