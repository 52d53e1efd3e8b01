"""What the mouse asks for: clicks, drags and the wheel become commands."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.rendering.camera import Camera
from posse.rendering.content.scene import Scene
from posse_training.viewer.drawing import step_at
from posse_training.viewer.layout import Layout, contains
from posse_training.viewer.state import Command

_CLICK: Final = 4.0  # px; a pointer that moves less has clicked
_REACH: Final = 16.0  # points; a robot is hit by a click this near to its centre
_ZOOM: Final = 1.15  # for a notch of the wheel
_LINES: Final = 3  # of the panel, for a notch of the wheel

Place = tuple[float, float]


class Pointer:
    """The mouse: where it is, and what it drags."""

    def __init__(self) -> None:
        self._at: Place = (0.0, 0.0)
        self._pressed: Place | None = None
        self._dragging = False

    def press(self, at: Place, layout: Layout, end: int) -> list[Command]:
        """Return what pressing the left button asks for."""
        self._at, self._pressed, self._dragging = at, at, False
        if contains(layout.bar, at):
            if at[0] < layout.track[0]:
                return [Command("pause")]
            return [Command("seek", round(step_at(layout, at[0], end)))]
        return []

    def move(self, at: Place, layout: Layout, camera: Camera, end: int) -> list[Command]:
        """Return what a movement asks for."""
        before, self._at = self._at, at
        if self._pressed is None:
            return []
        if contains(layout.track, self._pressed):
            return [Command("seek", round(step_at(layout, at[0], end)))]
        if not contains(camera.viewport, self._pressed):
            return []
        if not self._dragging and math.dist(at, self._pressed) < _CLICK:
            return []
        if not self._dragging:
            before, self._dragging = self._pressed, True
        dx, dy = (before[0] - at[0]) / camera.scale, (at[1] - before[1]) / camera.scale
        return [Command("pan", place=(dx, dy))]

    def release(self, at: Place, layout: Layout, camera: Camera, scene: Scene) -> list[Command]:
        """Return what releasing the left button asks for."""
        pressed, self._pressed = self._pressed, None
        if pressed is None or self._dragging or not contains(camera.viewport, pressed):
            return []
        robot = robot_at(camera, scene, at, _REACH * layout.point)
        return [] if robot is None else [Command("select", robot)]

    def wheel(self, notches: float, layout: Layout, camera: Camera) -> list[Command]:
        """Return what the wheel asks for; up is above 0."""
        if contains(layout.panel, self._at):
            return [Command("scroll", -_LINES * notches)]
        if not contains(camera.viewport, self._at):
            return []
        x, y = camera.unproject(np.array(self._at)) - camera.centre
        return [Command("zoom", _ZOOM**notches, (float(x), float(y)))]


def robot_at(camera: Camera, scene: Scene, at: Place, reach: float) -> int | None:
    """Return the number of the robot nearest to a pixel, if in reach; the target is the last."""
    places = camera.project(np.vstack([scene.position, scene.target]))
    apart = np.hypot(places[:, 0] - at[0], places[:, 1] - at[1])
    nearest = int(apart.argmin())
    return nearest if apart[nearest] <= reach else None
