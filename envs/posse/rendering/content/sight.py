"""The area that a target sensor covers, with the shadows of obstacles."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_STEP: Final = math.pi / 90
_GRAZE: Final = 1e-5  # rad, to either side of an obstacle's rim
_ALL_ROUND: Final = 2 * math.pi - 1e-9


def area_in_sight(
    position: Floats,
    heading: Floats,
    sensing_range: float,
    field_of_view: float,
    obstacles: Floats,
    arena: float = math.inf,
) -> Floats:
    """Return the corners (K, 2) m of the polygon in which a robot's sensor sees the target.

    Args:
        position: (2,) m.
        heading: (2,), cosine and sine.
        sensing_range: m; may be ``inf`` in an arena.
        field_of_view: Full angle about the heading, rad; 2π: all round.
        obstacles: (M, 3): x, y, radius, m.
        arena: Side of the walled square about the origin, m; ``inf``: no walls.

    Raises:
        ValueError: Neither range nor walls limit the area.
    """
    if math.isinf(sensing_range) and math.isinf(arena):
        raise ValueError("an area without range and without walls has no corners")
    middle = math.atan2(heading[1], heading[0])
    half = math.pi if field_of_view >= _ALL_ROUND else field_of_view / 2
    angles = [np.linspace(-half, half, max(3, math.ceil(2 * half / _STEP) + 1))]
    towards = obstacles[:, :2] - position
    distance = np.hypot(towards[:, 0], towards[:, 1])
    near = (distance > obstacles[:, 2]) & (distance - obstacles[:, 2] < sensing_range)
    towards, distance, radius = towards[near], distance[near], obstacles[near, 2]
    spread = np.arcsin(radius / distance)
    bearing = np.arctan2(towards[:, 1], towards[:, 0]) - middle
    # Rays on both sides of each rim, so that shadows begin where obstacles do.
    turns = (-spread - _GRAZE, -spread + _GRAZE, spread - _GRAZE, spread + _GRAZE)
    angles += [bearing + turn for turn in turns]
    if math.isfinite(arena):
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * arena / 2 - position
        angles.append(np.arctan2(corners[:, 1], corners[:, 0]) - middle)
    wrapped = np.concatenate([angles[0], *(_wrap(a) for a in angles[1:])])
    wrapped = np.sort(wrapped[np.abs(wrapped) <= half])
    ray = np.stack([np.cos(middle + wrapped), np.sin(middle + wrapped)], axis=-1)
    reach = np.full(len(ray), sensing_range)
    if math.isfinite(arena):
        with np.errstate(divide="ignore", invalid="ignore"):
            to_wall = (np.sign(ray) * arena / 2 - position) / ray
        reach = np.minimum(reach, np.where(np.abs(ray) > 1e-12, to_wall, np.inf).min(axis=1))
    if len(radius):
        along, across = ray @ towards.T, ray[:, :1] * towards[:, 1] - ray[:, 1:] * towards[:, 0]
        hit = (along > 0) & (np.abs(across) < radius)
        depth = np.sqrt(np.maximum(radius**2 - across**2, 0))
        reach = np.minimum(reach, np.where(hit, np.maximum(along - depth, 0), np.inf).min(axis=1))
    rim: Floats = position + np.maximum(reach, 0)[:, None] * ray
    return rim if half == math.pi else np.concatenate([position[None], rim])


def _wrap(angle: Floats) -> Floats:
    """Return angles in [-π, π], rad."""
    wrapped: Floats = angle - 2 * math.pi * np.rint(angle / (2 * math.pi))
    return wrapped
