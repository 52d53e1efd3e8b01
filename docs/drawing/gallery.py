"""Makes what the pages of the scenarios show: a replay and a picture of each.

    python docs/drawing/gallery.py [--scenarios smart field]

Writes docs/media/replays/NAME.html, docs/media/scenarios/NAME.png of the last team in it,
docs/media/replays/NAME-others.html, NAME-others-2.html ... of all other teams of the leaderboard in
the same world, and docs/media/replays/duel-evader.html with the learned target.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from PIL import Image

import posse
from posse.rendering.renderer import Renderer
from posse_baselines import load
from posse_training.film import Team
from posse_training.leaderboard import read_result
from posse_training.replay import record, write_replay

MEDIA: Final = Path(__file__).parents[1] / "media"
RESULTS: Final = MEDIA.parents[1] / "benchmarks" / "leaderboard"
SEED: Final = 7
OTHERS: Final = ("pursuit", "ddcs-centralized", "learned-generalist", "planner")
SIDE_BY_SIDE: Final = 4
EVADER: Final = "evader"
SIDE: Final = 440  # px of a picture


@dataclass(frozen=True)
class Shown:
    """Who plays in a scenario's replay, in which world, and which instant is the picture, s."""

    teams: tuple[str, ...]
    world: int = 0
    seconds: float = 40.0
    picture: float = 14.0


GALLERY: Final = {
    "constant": Shown(("pngl-l-phi", "ddcs-distributed"), seconds=30.0),
    "accelerating": Shown(("pngl-l-phi", "ddcs-distributed"), seconds=30.0),
    "smart": Shown(("ddcs-distributed", "learned-smart"), picture=18.0),
    "search": Shown(("pngl-l-phi", "ddcs-distributed"), picture=24.0),
    "obstacles": Shown(("ddcs-distributed", "learned-obstacles")),
    "radio": Shown(("ddcs-distributed", "learned-radio"), picture=10.0),
    "leader-loss": Shown(("ddcs-centralized-no-exchange", "pngl-l-phi"), seconds=30.0, picture=20.0),
    "field": Shown(("ddcs-distributed", "learned-field"), picture=26.0),
    "duel": Shown(("ddcs-distributed", "learned-smart"), picture=18.0),
    "paper-centralized": Shown(("pngl-l-phi", "ddcs-centralized"), seconds=8.0, picture=4.0),
    "paper-distributed": Shown(("pngl", "ddcs-distributed"), seconds=8.0, picture=4.0),
}

LOST: Final = {"smart": ("ddcs-tuned", 12), "field": ("ddcs-tuned", 17), "leader-loss": ("pngl-l-phi-tuned", 26)}
"""Of each scenario a tuned team, and the validation world where the planner is most ahead of it."""


@dataclass(frozen=True)
class _Arguments:
    scenarios: tuple[str, ...] = tuple(GALLERY)


def picture(scenario: str, shown: Shown) -> Image.Image:
    """Return a picture of the last team of a scenario's replay."""
    team = Team(load(shown.teams[-1]), posse.get_scenario(scenario), SEED, shown.world, "test")
    renderer = Renderer(team.batch.scenario, size=(SIDE, SIDE))
    for _ in range(round(shown.picture / team.batch.scenario.control_step)):
        renderer.follow(team.batch)
        team.step()
    frame = renderer.draw(team.batch, colours=team.colours)
    assert frame is not None
    return Image.fromarray(frame).quantize(64)


def others(scenario: str, shown: Shown) -> list[tuple[str, ...]]:
    """Return the teams on the leaderboard whom a scenario's replay does not show, by replay."""
    found = [read_result(path) for path in sorted(RESULTS.glob(f"{scenario}-*.json"))]
    teams = [r.policy for r in found if r.scenario == scenario and r.policy_kind == "shipped"]
    rest = [team for team in teams if team not in (*shown.teams, *OTHERS)]
    starts = range(0, len(rest), SIDE_BY_SIDE)
    return [OTHERS, *(tuple(rest[k : k + SIDE_BY_SIDE]) for k in starts)]


def write(scenario: str, suffix: str, teams: tuple[str, ...], shown: Shown, target: str | None = None) -> Path:
    """Write a replay of teams in a scenario's world."""
    replay = record(
        list(teams), scenario, target=target, seed=SEED, world=shown.world, seconds=shown.seconds, observations=False
    )
    return write_replay(replay, MEDIA / "replays" / f"{scenario}{suffix}.html")


def main() -> None:
    """Make all of it."""
    (MEDIA / "scenarios").mkdir(exist_ok=True)
    for name in tyro.cli(_Arguments).scenarios:
        shown = GALLERY[name]
        path = write(name, "", shown.teams, shown)
        if not name.startswith("paper"):
            for number, teams in enumerate(others(name, shown), 1):
                write(name, f"-others-{number}" if number > 1 else "-others", teams, shown)
        if name in LOST:
            team, world = LOST[name]
            replay = record([team, "planner"], name, seed=SEED, world=world, split="validation", observations=False)
            write_replay(replay, MEDIA / "replays" / f"{name}-lost.html")
        if name == "duel":
            write(name, f"-{EVADER}", ("ddcs-tuned", "learned-duel"), shown, EVADER)
        file = MEDIA / "scenarios" / f"{name}.png"
        picture(name, shown).save(file, optimize=True)
        print(f"{name:18s} {path.stat().st_size:8,} {file.stat().st_size:8,} bytes", flush=True)


if __name__ == "__main__":
    main()
