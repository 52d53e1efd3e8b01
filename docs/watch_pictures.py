"""Draws the pictures of docs/watch.md: the viewer and the game as they appear in their windows.

python docs/watch_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import pygame

import posse
from posse_baselines import load
from posse_training.play.game import Game
from posse_training.viewer.state import Command
from posse_training.viewer.viewer import Viewer

MEDIA = Path(__file__).parent / "media"
SIZE = (1280, 720)


def viewer(policy: str, seconds: float, **settings: object) -> Viewer:
    """Return the viewer of a policy on ``field``, paused at a time."""
    shown = Viewer([policy], posse.get_scenario("field", **settings), size=SIZE)
    step = round(seconds / 0.1)
    shown.do(Command("seek", step))
    while shown.tape.last < step:
        shown.tick(0.0)
    shown.do(Command("pause"))
    return shown


def save(surface: pygame.Surface, name: str) -> None:
    """Write a picture."""
    pygame.image.save(surface, str(MEDIA / f"{name}.png"))


def main() -> None:
    """Draw all pictures."""
    shown = viewer("ddcs-distributed", 18.0)
    shown.do(Command("select", 2))
    save(shown.draw(), "watch")
    shown.do(Command("help"))
    save(shown.draw(), "watch-help")
    save(viewer("pursuit", 10.0, num_trackers=40, formation="rows").draw(), "watch-forty")

    game = Game(load("ddcs-distributed"), posse.get_scenario("smart"), robot=5, size=SIZE)
    game.handle(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_RETURN))
    game.tick(3.0)
    for step in range(130):
        turn = pygame.KEYDOWN if step % 40 < 15 else pygame.KEYUP
        game.handle(pygame.event.Event(turn, key=pygame.K_LEFT))
        game.tick(0.1)
    save(game.draw(), "play")


if __name__ == "__main__":
    main()
