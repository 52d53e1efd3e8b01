"""``posse demo``: a table of scores, films and a replay page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import tyro

from posse_training.errors import SettingsError


@dataclass(frozen=True)
class _Demo:
    """Play every scripted team in three scenarios; print a table, write films and a replay page."""

    episodes: int = 500
    """Worlds for each policy and scenario."""
    seconds: float = 25.0
    """Simulated time of a film, s."""


def main(arguments: Sequence[str]) -> None:
    """Run the demo."""
    which = tyro.cli(_Demo, prog="posse demo", args=arguments)
    if which.episodes < 2:
        raise SettingsError(f"episodes={which.episodes} is too few for an interval: 2 or more")
    if not 0 < which.seconds <= 3600:
        raise SettingsError(f"seconds={which.seconds} is not a length of a film: 0 to 3,600")
    from posse_training import demo

    demo.main(which.episodes, which.seconds)
