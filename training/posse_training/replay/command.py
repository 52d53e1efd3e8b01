"""``posse replay``: teams on the same world, as one HTML file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from posse_training.replay.episode import Replay, join
from posse_training.replay.page import read_replay, write_replay
from posse_training.replay.recording import record

_PAGES = (".html", ".htm")


@dataclass(frozen=True)
class _Replay:
    """Write one HTML file in which one to four teams play the same world side by side."""

    players: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Policies: names, files, or "package.module:Class"; or replays (.html) of the same world,
    whose players are included."""
    scenario: str = "smart"
    """Name of the scenario."""
    target: str | None = None
    """Target: a motion, a learned target, a file or package.module:Class; default: the
    scenario's own."""
    world: int = 0
    """Index of the world within the seed."""
    seed: int = 7
    """Seed of the world."""
    split: str = "test"
    """Split of the world: train, validation or test."""
    num_trackers: int | None = None
    """Trackers in the team; default: the scenario's."""
    seconds: float | None = None
    """Longest duration, s; default: the whole episode."""
    observations: bool = True
    """Record the observations of every tracker, which are most of the file's size."""
    out: Path = Path("replay.html")
    """File to write."""


def main(arguments: list[str]) -> None:
    """Play the world and write the page."""
    which = tyro.cli(_Replay, prog="posse replay", args=arguments)
    replays: list[Replay] = []
    for player in which.players:
        if Path(player).suffix.lower() in _PAGES:
            replays.append(read_replay(player))
            continue
        overrides = {} if which.num_trackers is None else {"num_trackers": which.num_trackers}
        replays.append(
            record(
                [player],
                which.scenario,
                target=which.target,
                seed=which.seed,
                world=which.world,
                split=which.split,
                seconds=which.seconds,
                observations=which.observations,
                **overrides,
            )
        )
    path = write_replay(join(replays), which.out)
    print(f"{path} ({path.stat().st_size / 1000:.0f} kB): open it in a browser")
