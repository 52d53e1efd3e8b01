"""``posse play``: drive the target against a team, or one tracker in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from posse_training.errors import SettingsError

_PAGES: Final = (".html", ".htm")
_LEAST, _MOST = 200, 4096


@dataclass(frozen=True)
class _Play:
    """Drive the target against a team, or one tracker in it. Writes a replay page at the end."""

    scenario: str = "smart"
    """Scenario to play."""
    against: str = "ddcs-tuned"
    """Policy of the trackers: a name, a file, or package.module:Class."""
    robot: Annotated[str, tyro.conf.arg(name="as")] = "target"
    """What you drive: target, or one of the trackers, such as tracker_2."""
    seed: int = 7
    """Seed of the world."""
    world: int = 0
    """Index of the first world."""
    split: str = "test"
    """Split of the world: train, validation or test."""
    num_trackers: int | None = None
    """Trackers in the team; default: the scenario's."""
    size: tuple[int, int] = (1280, 720)
    """Width and height of the window, px."""
    out: Path = Path("play.html")
    """Replay page of the best and the last round, written at the end."""


def main(arguments: Sequence[str]) -> None:
    """Play, and write the replay page."""
    which = tyro.cli(_Play, prog="posse play", args=arguments)
    if which.out.suffix.lower() not in _PAGES:
        raise SettingsError(f"--out {which.out} must end in {' or '.join(_PAGES)}")
    if not all(_LEAST <= side <= _MOST for side in which.size):
        raise SettingsError(f"--size {which.size[0]} {which.size[1]} must be {_LEAST} to {_MOST} px each")
    from posse import get_scenario
    from posse_baselines import load
    from posse_training.play.game import Game, robot_of
    from posse_training.replay import write_replay
    from posse_training.viewer.window import open_window, run

    scenario = get_scenario(which.scenario)
    if which.num_trackers is not None:
        scenario = scenario.replace(num_trackers=which.num_trackers)
    robot = robot_of(which.robot, scenario.num_trackers)
    game = Game(
        load(which.against), scenario, robot, seed=which.seed, world=which.world, split=which.split, size=which.size
    )
    instead = f"see the team alone: posse watch {which.against} --film film.gif"
    open_window(which.size, f"posse: {scenario.name}", instead)
    run(game)
    best = game.session.best
    if best is not None:
        print(f"{len(game.session.rounds)} rounds, best {best:.0f} points")
    replay = game.replay()
    if replay is None:
        print("Nothing was played: no replay is written.")
        return
    path = write_replay(replay, which.out)
    print(f"replay: {path} (open it in a browser)")
