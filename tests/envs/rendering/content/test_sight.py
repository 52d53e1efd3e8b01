"""What is drawn as sensed is what a sensor would see, shadows and walls included."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import posse
from posse.rendering.content.sight import area_in_sight
from posse.rendering.renderer import Renderer
from posse.rendering.style import SENSING

Floats = npt.NDArray[np.float64]


def inside(corners: Floats, x: float, y: float) -> bool:
    """Whether a polygon contains a point, by the crossings of a ray to the right."""
    within = False
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, 1, axis=0), strict=True):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            within = not within
    return within


def seen(
    place: Floats, x: float, y: float, heading: float, reach: float, view: float, discs: Floats
) -> tuple[bool, float]:
    """Whether a point is in sight, and by how many metres it is from being otherwise."""
    dx, dy = x - place[0], y - place[1]
    distance = math.hypot(dx, dy)
    margins = [reach - distance]
    if view < 2 * math.pi:
        off = abs((math.atan2(dy, dx) - heading + math.pi) % (2 * math.pi) - math.pi)
        margins.append((view / 2 - off) * distance)
    for ox, oy, radius in discs:
        # The distance from the disc's centre to the line of sight, between its ends.
        t = np.clip(((ox - place[0]) * dx + (oy - place[1]) * dy) / distance**2, 0, 1)
        margins.append(math.hypot(place[0] + t * dx - ox, place[1] + t * dy - oy) - radius)
    return min(margins) > 0, min(abs(m) for m in margins)


@pytest.mark.parametrize(
    ("reach", "view", "arena"),
    [(6.0, 2 * math.pi, math.inf), (6.0, 2.0, math.inf), (math.inf, 2 * math.pi, 14.0), (9.0, 1.2, 14.0)],
)
def test_the_area_is_what_can_be_seen(reach: float, view: float, arena: float) -> None:
    rng = np.random.default_rng(3)
    compared = 0
    for _ in range(6):
        discs = np.column_stack([rng.uniform(-6, 6, (5, 2)), rng.uniform(0.4, 1.5, 5)])
        place, heading = rng.uniform(-4, 4, 2), rng.uniform(-math.pi, math.pi)
        if (np.hypot(*(discs[:, :2] - place).T) < discs[:, 2] + 0.1).any():
            continue
        ahead = np.array([math.cos(heading), math.sin(heading)])
        corners = area_in_sight(place, ahead, reach, view, discs, arena)
        half = min(arena / 2, 8.0)
        for x, y in rng.uniform(-half, half, (300, 2)):
            visible, margin = seen(place, x, y, heading, reach, view, discs)
            if margin > 0.05:  # the rim of the range is drawn with straight pieces
                assert inside(corners, x, y) == visible, (place, x, y)
                compared += 1
    assert compared > 600


def test_an_area_without_limits_has_no_corners() -> None:
    with pytest.raises(ValueError, match="without range and without walls"):
        area_in_sight(np.zeros(2), np.array([1.0, 0.0]), math.inf, 7.0, np.empty((0, 3)))


def test_the_shadow_of_an_obstacle_is_not_drawn_as_sensed() -> None:
    batch = posse.batch("field", 1, seed=2, num_trackers=1, breaks=0, sensing_range=16.0)
    batch.reset()
    renderer = Renderer(batch.scenario, size=(720, 720))
    frame: Any = renderer.draw(batch)
    place = np.array([batch.state["tracker_x"][0, 0], batch.state["tracker_y"][0, 0]])
    discs = np.stack([batch.state[f"obstacle_{k}"][0] for k in ("x", "y", "radius")], axis=-1)
    counts = {True: 0, False: 0}
    for x, y in np.random.default_rng(0).uniform(-11.8, 11.8, (3000, 2)):
        visible, margin = seen(place, x, y, 0.0, 16.0, 7.0, discs)
        column, row = renderer.project([x, y]).round().astype(int)
        patch = frame[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3).astype(int)
        if margin < 0.15 or len(set(map(tuple, patch))) > 1:
            continue  # at a rim, or where something else is drawn
        tinted = bool(np.abs(patch[0] - SENSING).max() <= 2)
        assert tinted == visible, (x, y)
        shadowed = not visible and math.dist(place, (x, y)) < 15.8
        counts[visible] += 1 if visible or shadowed else 0
    assert counts[True] > 100
    assert counts[False] > 10
