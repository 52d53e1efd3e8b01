"""``posse replay``: teams on the same world, as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from posse_training.replay.episode import Replay, join
from posse_training.replay.page import read_replay, write_replay
from posse_training.replay.recording import record


def main(arguments: list[str]) -> None:
    """Play the world and write the page."""
    tyro.cli(_replay, prog="posse replay", args=arguments)


def _replay(
    players: Annotated[tuple[str, ...], tyro.conf.Positional],
    *,
    scenario: str = "smart",
    target: str | None = None,
    world: int = 0,
    seed: int = 7,
    split: str = "test",
    num_trackers: int | None = None,
    seconds: float | None = None,
    observations: bool = True,
    out: Path = Path("replay.html"),
) -> None:
    """Write one HTML file in which one to four teams play the same world side by side.

    Args:
        players: Policies: names, files, or "package.module:Class"; or replays (.html) of the same world,
            whose players are included.
        scenario: Name of the scenario.
        target: Target: a motion, a learned target, a file or package.module:Class; default: the scenario's own.
        world: Index of the world within the seed.
        seed: Seed of the world.
        split: Split of the world: train, validation or test.
        num_trackers: Trackers in the team; default: the scenario's.
        seconds: Longest duration, s; default: the whole episode.
        observations: Record the observations of every tracker, which are most of the file's size.
        out: File to write.
    """
    played = {"target": target, "world": world, "seed": seed, "split": split, "seconds": seconds}
    overrides = {} if num_trackers is None else {"num_trackers": num_trackers}

    def made(player: str) -> Replay:
        if Path(player).suffix.lower() in (".html", ".htm"):
            return read_replay(player)
        return record([player], scenario, observations=observations, **played, **overrides)  # type: ignore[arg-type]

    path = write_replay(join([made(player) for player in players]), out)
    print(f"{path} ({path.stat().st_size / 1000:.0f} kB): open it in a browser")
