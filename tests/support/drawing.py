"""Worlds to draw, and what a frame shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import posse
from posse.rendering.renderer import Renderer

Frame = npt.NDArray[np.uint8]
SIZE = (400, 360)


def worlds(scenario: str = "constant", num_worlds: int = 1, **settings: Any) -> posse.Batch:
    batch = posse.batch(scenario, num_worlds, seed=3, **settings)
    batch.reset()
    return batch


def placed(
    trackers: list[tuple[float, float, float]],
    target: tuple[float, float, float] = (0, 0, 0),
    scenario: str = "constant",
    **settings: Any,
) -> posse.Batch:
    """One world that starts from given poses, (x, y, θ) each."""
    batch = posse.batch(scenario, 1, seed=3, num_trackers=len(trackers), **settings)
    batch.reset(options={"tracker_pose": trackers, "target_pose": target})
    return batch


def advance(batch: posse.Batch, steps: int = 1) -> None:
    for _ in range(steps):
        batch.step(np.full(batch.action_shape, 0.25, np.float32))


def picture(renderer: Renderer, batch: posse.Batch, world: int = 0, **told: Any) -> Frame:
    frame = renderer.draw(batch, world, **told)
    assert frame is not None
    return frame


def colour_at(renderer: Renderer, frame: Frame, x: float, y: float) -> tuple[int, ...]:
    column, row = renderer.project([x, y]).round().astype(int)
    return tuple(frame[row, column].tolist())


def like(shade: tuple[int, ...], colour: tuple[int, int, int]) -> bool:
    """Whether a shade is the colour, to the rounding of averaging pixels."""
    return bool(np.abs(np.subtract(shade, colour)).max() <= 3)


def count(frame: Frame, colour: tuple[int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - colour).max(axis=-1) <= 3).sum())
