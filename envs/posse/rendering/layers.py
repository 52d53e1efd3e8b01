"""The layers of a frame: one function each, and a list in drawing order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from posse.rendering.camera import Camera
from posse.rendering.content.history import Flash, Mark
from posse.rendering.content.scene import Floats, Scene
from posse.rendering.content.sight import area_in_sight
from posse.rendering.content.view import View
from posse.rendering.style import (
    BROKEN,
    CONTACT,
    GRID,
    GROUND,
    INK,
    LINK,
    OBSTACLE,
    OBSTACLE_RIM,
    PAPER,
    SENSING,
    SENSING_RIM,
    SLOT,
    SLOT_FILLED,
    TARGET,
    TASK_COLOURS,
    TRACKER,
    TRACKER_RIM,
    TRAIL,
    WALL,
    Colour,
    mix,
    pale,
)

if TYPE_CHECKING:
    from posse.rendering.canvas import Canvas

LEAST_RADIUS: Final = 4.0
"""Least radius of a drawn robot, px, in however small a frame."""
_NUMBERED: Final = 6.5  # px; least radius of a disc that bears a number
_MOST_LINKED: Final = 12  # trackers; of a larger team, only the selected robot's links are drawn
_VIEW_SHOWN: Final = 1.5  # m; drawn range of a field of view with unlimited range
_GRID_STEP: Final = 2.0  # m


@dataclass(frozen=True)
class Drawing:
    """Input and canvas of a layer."""

    scene: Scene
    camera: Camera
    canvas: Canvas
    point: float
    """Pixels per point."""
    trail: Sequence[Mark]
    """Past positions, oldest first."""
    flashes: Sequence[Flash]
    """Recent contacts."""
    view: View

    @property
    def radius(self) -> float:
        """Radius of a robot's disc, px."""
        least = max(self.view.least_robot * self.point, LEAST_RADIUS)
        return max(self.scene.scenario.robot_radius * self.camera.scale, least)

    @property
    def selected(self) -> int | None:
        """Number of the selected tracker; ``None``: there is none, or it is the target."""
        chosen = self.view.selected
        return chosen if chosen is not None and chosen < len(self.scene.position) else None


def _floor(d: Drawing) -> tuple[Floats, Floats]:
    """Return two corners (2,) m of the floor: the arena, or the visible part of the plane."""
    arena = d.scene.scenario.arena
    if math.isfinite(arena):
        return np.full(2, -arena / 2), np.full(2, arena / 2)
    return d.camera.bounds()


def ground(d: Drawing) -> None:
    """Draw the floor."""
    low, high = _floor(d)
    (left, bottom), (right, top) = d.camera.project(low), d.camera.project(high)
    d.canvas.box(left, top, right - left, bottom - top, GROUND)


def grid(d: Drawing) -> None:
    """Draw faint crosses two metres apart, as a reference for distance and speed.

    Grid lines would change every row of a video with a moving view; crosses compress better.
    """
    low, high = _floor(d)
    arm = 4 * d.point
    columns, rows = (
        np.arange(math.ceil(a / _GRID_STEP), math.floor(b / _GRID_STEP) + 1) * _GRID_STEP
        for a, b in zip(low, high, strict=True)
    )
    crosses = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    for x, y in d.camera.project(crosses):
        d.canvas.line((x - arm, y), (x + arm, y), d.point, GRID)
        d.canvas.line((x, y - arm), (x, y + arm), d.point, GRID)


def walls(d: Drawing) -> None:
    """Draw the walls of an arena, outside the reachable area."""
    arena = d.scene.scenario.arena
    if not math.isfinite(arena):
        return
    thick = 3 * d.point
    left, top = d.camera.project(np.array([-arena / 2, arena / 2])) - thick
    side = arena * d.camera.scale + 2 * thick
    for box in (
        (left, top, side, thick),
        (left, top + side - thick, side, thick),
        (left, top, thick, side),
        (left + side - thick, top, thick, side),
    ):
        d.canvas.box(*box, WALL)


def covered(d: Drawing, tracker: int) -> Floats | None:
    """Return the corners (K, 2) m of what a tracker's target sensor covers; ``None``: no limit."""
    s, scene = d.scene.scenario, d.scene
    all_round = s.field_of_view >= 2 * math.pi - 1e-9
    unlimited = math.isinf(s.sensing_range) and all_round
    if not scene.senses[tracker] or (unlimited and not s.num_obstacles):
        return None
    reach = s.sensing_range
    if math.isinf(reach) and math.isinf(s.arena):
        reach = _VIEW_SHOWN
    return area_in_sight(
        scene.position[tracker], scene.heading[tracker], reach, s.field_of_view, scene.obstacles, s.arena
    )


def sensing(d: Drawing) -> None:
    """Tint the area in sight of the selected tracker, or of the team where sight is limited.

    What lies behind an obstacle is not in sight.
    """
    s = d.scene.scenario
    if not d.view.sensing or d.view.selected == len(d.scene.position):
        return
    looking = range(len(d.scene.position)) if d.selected is None else (d.selected,)
    all_round = s.field_of_view >= 2 * math.pi - 1e-9
    if d.selected is None and math.isinf(s.sensing_range) and all_round:
        return
    areas = [covered(d, i) for i in looking]
    corners = [d.camera.project(area) for area in areas if area is not None]
    for area in corners:  # every fill hides the outlines inside it
        d.canvas.outline(area, 2 * d.point, SENSING_RIM)
    for area in corners:
        d.canvas.polygon(area, SENSING)


def obstacles(d: Drawing) -> None:
    """Draw the obstacles."""
    for x, y, radius in d.scene.obstacles:
        place = d.camera.project(np.array([x, y]))
        d.canvas.disc(place, radius * d.camera.scale, OBSTACLE_RIM)
        d.canvas.disc(place, radius * d.camera.scale - d.point, OBSTACLE)


def trails(d: Drawing) -> None:
    """Draw the trails, fading with age."""
    if len(d.trail) < 2 or not d.view.trails:
        return
    places = d.camera.project(np.stack([mark.position for mark in d.trail]))
    for k in range(1, len(d.trail)):
        fresh = d.trail[k].freshness ** 1.5
        for i in range(places.shape[1]):
            target = i == places.shape[1] - 1
            colour = TARGET if target else TRAIL
            d.canvas.line(places[k - 1, i], places[k, i], 1.6 * d.point, colour, 0.8 * fresh)


def frame(d: Drawing) -> None:
    """Draw the line of the slot frame through the target, from the last slot to a metre ahead."""
    behind = min(0.0, float(((d.scene.slots - d.scene.target) @ d.scene.frame).min()))
    ends = d.scene.target + np.outer([behind, 1.0], d.scene.frame)
    back, ahead = d.camera.project(ends)
    d.canvas.dashes(ahead, back, d.point, 4 * d.point, SLOT)


def slots(d: Drawing) -> None:
    """Draw each slot as a circle of the tolerance, filled when it is occupied."""
    radius = d.scene.scenario.tolerance * d.camera.scale
    places = d.camera.project(d.scene.slots)
    for place, occupied in zip(places, d.scene.occupied, strict=True):
        if occupied:
            d.canvas.disc(place, radius, SLOT_FILLED)
        d.canvas.ring(place, radius, 1.5 * d.point, SLOT)


def links(d: Drawing) -> None:
    """Draw a line between trackers that hear each other, fading with the age of the message.

    Not where a robot is selected, whose links :mod:`posse.rendering.selected` draws, and not of a
    large team, which has hundreds.
    """
    scene = d.scene
    if not d.view.links or d.view.selected is not None or len(scene.position) > _MOST_LINKED:
        return
    strength = np.triu(scene.links)
    heard = np.argwhere(strength > 0)
    if not len(heard):
        return
    weight = 0.5 * max(0.2, min(1.0, 12 / len(heard)))
    places = d.camera.project(scene.position)
    for i, j in heard.tolist():
        d.canvas.line(places[i], places[j], d.point, LINK, weight * strength[i, j])


_DARK_DISCS: Final = (TRACKER, *TASK_COLOURS[1:3])
"""Colours of discs on which a number is white."""


def trackers(d: Drawing) -> None:
    """Draw the trackers: grey discs with a line for the heading, coloured by task if known.

    Pale: does not see the target itself; crossed out: broken.
    """
    scene, canvas, point, radius = d.scene, d.canvas, d.point, d.radius
    places = d.camera.project(scene.position)
    for i in sorted(range(len(places)), key=lambda i: not scene.broken[i]):
        place, heading = places[i], scene.heading[i] * (1, -1)
        if scene.broken[i]:
            wafer(d, place, heading, BROKEN, TRACKER)
            arm = 0.7 * radius + point
            for sign in (1, -1):
                step = np.array([arm, sign * arm])
                canvas.line(place - step, place + step, 1.6 * point, INK)
            continue
        colour = TRACKER
        if scene.task is not None and 0 <= scene.task[i] < len(TASK_COLOURS):
            colour = TASK_COLOURS[scene.task[i]]
        if scene.limited_sight and not scene.sees[i]:
            colour = pale(colour)
        wafer(d, place, heading, colour, TRACKER_RIM)
        if d.view.numbers and radius >= _NUMBERED:
            dark = colour in _DARK_DISCS
            canvas.text(str(i), (place[0], place[1]), 1.35 * radius, PAPER if dark else INK, 0.5)
        if scene.leads is not None and scene.leads[i]:
            leader_mark(canvas, place - (0, radius + 4 * point), 5 * point)


def wafer(d: Drawing, place: Floats, heading: Floats, colour: Colour, rim: Colour) -> None:
    """Draw a robot: a disc with a line towards its heading, (2,) px down."""
    radius, point = d.radius, d.point
    d.canvas.disc(place, radius, rim)
    d.canvas.disc(place, radius - 1.2 * point, colour)
    start = 0.75 * radius if d.view.numbers and radius >= _NUMBERED else 0.0
    end = place + heading * (radius + 3.5 * point)
    d.canvas.line(place + heading * start, end, 1.8 * point, rim)


def leader_mark(canvas: Canvas, tip: Floats, size: float) -> None:
    """Draw the marker above a leader; ``tip`` is its lower end."""
    x, y = tip
    for grow, colour in ((1.2, PAPER), (0.0, INK)):
        side = size + grow
        canvas.polygon([(x, y + grow), (x - side, y - 1.5 * side), (x + side, y - 1.5 * side)], colour)


def target(d: Drawing) -> None:
    """Draw the target, with its own colour and a white rim."""
    place, heading = d.camera.project(d.scene.target), d.scene.target_heading * (1, -1)
    radius, point = d.radius, d.point
    end = place + heading * (radius + 5 * point)
    d.canvas.disc(place, radius + 2.5 * point, PAPER)
    d.canvas.line(place, end + heading * point, 5 * point, PAPER)
    d.canvas.disc(place, radius + point, TARGET)
    d.canvas.line(place, end, 2.4 * point, TARGET)


def flashes(d: Drawing) -> None:
    """Draw a growing, fading ring around each recent contact."""
    for flash in d.flashes:
        place = d.camera.project(flash.position)
        radius = d.radius + (3 + 9 * flash.age) * d.point
        d.canvas.ring(place, radius, 2.2 * d.point, mix(CONTACT, GROUND, 1 - flash.age))
