"""Draws the picture of docs/comparison.md: the window of ``posse watch``.

python docs/drawing/watch.py
"""

import os
from pathlib import Path

os.environ["SDL_VIDEODRIVER"] = "dummy"
os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"

import pygame

import posse
from posse.rendering.renderer import Renderer
from posse_baselines import load
from posse_training.film import Team

OUT = Path(__file__).parents[1] / "media" / "watch.png"
SECONDS = 18.0


def main() -> None:
    """Play a world of ``field`` for some time and write what the window shows."""
    team = Team(load("ddcs-distributed"), posse.get_scenario("field"), 7, 0, "test")
    renderer = Renderer(team.batch.scenario, "human", (960, 720), "ddcs-distributed, world 0", {"n": "next world"})
    for _ in range(round(SECONDS / team.batch.scenario.control_step)):
        renderer.follow(team.batch)
        team.step()
    renderer.draw(team.batch, colours=team.colours)
    window = pygame.display.get_surface()
    assert window is not None
    pygame.image.save(window, str(OUT))
    renderer.close()


if __name__ == "__main__":
    main()
