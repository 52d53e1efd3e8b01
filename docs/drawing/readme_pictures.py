"""Makes the README's film and grid, docs/media/smart.gif and scenarios.png, and the manual's media/scenarios/NAME.png.

    python docs/drawing/readme_pictures.py [--scenarios-only]

The film shows the tuned script and the learned team in one world of `smart`, on one scale, and for each the score
of the last second. The world is no extreme: of the first 101, it has the median difference of the
safe scores. The command prints what a caption may say.
"""

from pathlib import Path
from typing import Final

import numpy as np
import tyro
from PIL import Image

import posse
from posse.rendering.renderer import Renderer
from posse_baselines import load
from posse_training.evaluation import evaluate
from posse_training.film import Team, film

MEDIA: Final = Path(__file__).parents[1] / "media"
TEAMS: Final = ("ddcs-tuned", "learned-smart")
SCENARIO: Final = "smart"
SEED, WORLDS = 7, 101
SHOWN: Final = {
    "constant": ("ddcs-distributed", 14.0),
    "accelerating": ("ddcs-distributed", 14.0),
    "smart": ("learned-smart", 18.0),
    "search": ("ddcs-distributed", 24.0),
    "obstacles": ("learned-obstacles", 32.0),
    "radio": ("learned-radio", 14.0),
    "leader-loss": ("pngl-l-phi", 20.0),
    "field": ("learned-field", 26.0),
    "duel": ("learned-smart", 26.0),
    "robots": ("ddcs-distributed", 57.0),
}
"""The team on each scenario, and after how many seconds."""
PICTURE, CELL, COLUMNS = 440, 240, 5  # px, px, cells of the grid in a row


def median_world() -> int:
    """Return the world with the median difference of the teams' safe scores."""
    first, second = (evaluate(name, SCENARIO, WORLDS, SEED, progress=False)["safe_score"] for name in TEAMS)
    for name, scores in zip(TEAMS, (first, second), strict=True):
        print(f"{name}: mean safe score of {WORLDS} worlds {scores.mean():.3f}")
    print(f"{TEAMS[1]} has the higher one in {(second > first).sum()}")
    return int(np.argsort(second - first, kind="stable")[WORLDS // 2])


def write_film() -> None:
    """Write the film."""
    world, path = median_world(), MEDIA / f"{SCENARIO}.gif"
    film(
        [(name, load(name)) for name in TEAMS],
        SCENARIO,
        path=path,
        seed=SEED,
        world=world,
        start=15.0,
        seconds=20.0,
        speed=2.0,
        every=3,
        size=(960, 440),
        scores=True,
    )
    print(f"{path}: world {world}, {path.stat().st_size:,} bytes")


def pictures(scenario: str) -> list[Image.Image]:
    """Return a team on a scenario, as large as in the manual and as in the grid, where text is twice as large."""
    name, seconds = SHOWN[scenario]
    team = Team(load(name), posse.get_scenario(scenario), SEED, 0, "test")
    drawn = [
        Renderer(team.batch.scenario, size=(side, side), scale=scale) for side, scale in ((PICTURE, 1.4), (CELL, 2.0))
    ]
    for _ in range(round(seconds / team.batch.scenario.control_step)):
        for renderer in drawn:
            renderer.follow(team.batch)
        team.step()
    frames = [renderer.draw(team.batch, colours=team.colours) for renderer in drawn]
    return [Image.fromarray(frame) for frame in frames if frame is not None]


def main(scenarios_only: bool = False) -> None:
    """Write the pictures of the scenarios and the grid, and the film."""
    rows = -(-len(SHOWN) // COLUMNS)
    grid = Image.new("RGB", (COLUMNS * (CELL + 2) - 2, rows * (CELL + 2) - 2), (212, 218, 225))
    for k, scenario in enumerate(SHOWN):
        large, small = pictures(scenario)
        large.quantize(64).save(MEDIA / "scenarios" / f"{scenario}.png", optimize=True)
        grid.paste(small, (k % COLUMNS * (CELL + 2), k // COLUMNS * (CELL + 2)))
    grid.quantize(128).save(MEDIA / "scenarios.png", optimize=True)
    if not scenarios_only:
        write_film()


if __name__ == "__main__":
    tyro.cli(main)
