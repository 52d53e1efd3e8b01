"""Draws the pictures of the scenarios, docs/media/scenarios/NAME.png.

python docs/drawing/gallery.py [--scenario smart field]
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

PICTURES: Final = Path(__file__).parents[1] / "media" / "scenarios"
SEED: Final = 7
SIDE: Final = 440  # px
SHOWN: Final = {
    "constant": ("ddcs-distributed", 14.0),
    "accelerating": ("ddcs-distributed", 14.0),
    "smart": ("learned-smart", 18.0),
    "search": ("ddcs-distributed", 24.0),
    "obstacles": ("learned-obstacles", 14.0),
    "radio": ("learned-radio", 10.0),
    "leader-loss": ("pngl-l-phi", 20.0),
    "field": ("learned-field", 26.0),
    "duel": ("learned-smart", 18.0),
    "robots": ("ddcs-distributed", 57.0),
}
"""The team on each scenario, and after how many seconds."""


@dataclass(frozen=True)
class _Arguments:
    scenario: tuple[str, ...] = tuple(SHOWN)


def picture(scenario: str) -> Image.Image:
    """Return a picture of a team on a scenario."""
    name, seconds = SHOWN[scenario]
    team = Team(load(name), posse.get_scenario(scenario), SEED, 0, "test")
    renderer = Renderer(team.batch.scenario, size=(SIDE, SIDE))
    for _ in range(round(seconds / team.batch.scenario.control_step)):
        renderer.follow(team.batch)
        team.step()
    frame = renderer.draw(team.batch, colours=team.colours)
    assert frame is not None
    return Image.fromarray(frame).quantize(64)


if __name__ == "__main__":
    for each in tyro.cli(_Arguments).scenario:
        picture(each).save(PICTURES / f"{each}.png", optimize=True)
