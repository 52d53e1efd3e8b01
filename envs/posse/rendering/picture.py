"""A picture of a world in a rectangle of a canvas: all layers, header and footer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from posse.rendering import layers, selected
from posse.rendering.camera import Camera, Points
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene
from posse.rendering.content.view import View
from posse.rendering.layers import Drawing
from posse.rendering.legend import FOOTER, HEADER, footer, header, note
from posse.rendering.style import PAPER

if TYPE_CHECKING:
    from posse.rendering.canvas import Canvas

Box = tuple[int, int, int, int]
"""Left, top, width and height, px."""

LAYERS: Final[tuple[Callable[[Drawing], None], ...]] = (
    layers.ground,
    layers.sensing,
    layers.grid,
    layers.frame,
    layers.slots,
    layers.obstacles,
    layers.walls,
    layers.trails,
    layers.links,
    selected.sonar,
    selected.goal,
    selected.heard,
    selected.selection,
    layers.trackers,
    layers.target,
    selected.fix,
    selected.estimate,
    layers.flashes,
)
"""Every layer, in the order in which they are drawn."""


def viewport_of(box: Box, point: float) -> Box:
    """Return the part of a picture's box between header and footer."""
    left, top, width, height = box
    above, below = round(HEADER * point), round(FOOTER * point)
    return left, top + above, width, height - above - below


def action_of(scene: Scene) -> Points:
    """Return the points (K, 2) m that a camera keeps in view.

    Broken trackers stay behind: a view that included them would grow without bound.
    """
    working = scene.position[~scene.broken]
    return np.vstack([working, scene.target, scene.target + scene.frame])


def draw_world(
    canvas: Canvas, camera: Camera, scene: Scene, history: History, point: float, view: View | None = None
) -> None:
    """Draw the layers of a world into the camera's viewport.

    Args:
        canvas: Where to draw.
        camera: What is in view.
        scene: The world.
        history: Trails and contacts, up to the scene.
        point: Pixels per point.
        view: Choices; default: nobody is selected.
    """
    canvas.clip(camera.viewport)
    drawing = Drawing(scene, camera, canvas, point, history.trail(), history.flashes(), view or View())
    for layer in LAYERS:
        layer(drawing)
    canvas.clip(None)


def draw_picture(
    canvas: Canvas,
    box: Box,
    camera: Camera,
    scene: Scene,
    history: History,
    point: float,
    title: str | None = None,
    remark: str | None = None,
    view: View | None = None,
) -> None:
    """Draw a world with header and footer into a box; ``remark`` stands small in the picture."""
    canvas.box(*box, PAPER)
    draw_world(canvas, camera, scene, history, point, view)
    if remark:
        note(canvas, camera.viewport, remark, point)
    header(canvas, box, scene, title, point)
    footer(canvas, box, scene, camera.scale, point)
