"""The layers of a frame and its text: one function each."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from posse.rendering import style
from posse.rendering.camera import Camera, Points
from posse.rendering.canvas import Canvas
from posse.rendering.scene import History, Scene

_LEAST_RADIUS: Final = 5.0  # points, of a drawn robot
_MOST_LINKED: Final = 12  # trackers
_GRID_STEP: Final = 2.0  # m
HEADER: Final = 40  # points, height of the line above the picture
FOOTER: Final = 30  # points, height of the line below it
_TITLE, _TEXT, _SMALL, _EDGE = 21, 17, 14, 14  # points: sizes of text, and a margin
_BAR_LENGTHS: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)  # m
_BAR_MOST: Final = 110  # points


@dataclass(frozen=True)
class Drawing:
    """Input and canvas of a layer."""

    scene: Scene
    history: History  # up to the scene
    camera: Camera
    canvas: Canvas
    point: float  # pixels per point
    title: str
    colours: Sequence[style.Colour]  # of the trackers

    @property
    def radius(self) -> float:
        """Radius of a robot's disc, px."""
        return max(self.scene.scenario.robot_radius * self.camera.scale, _LEAST_RADIUS * self.point, 4.0)


def ground(d: Drawing) -> None:
    """Draw the floor, and the walls of an arena around it, outside the reachable area."""
    (left, bottom), (right, top) = d.camera.project(d.camera.floor())
    if d.scene.scenario.walled:
        thick = 3 * d.point
        d.canvas.box(left - thick, top - thick, right - left + 2 * thick, bottom - top + 2 * thick, style.WALL)
    d.canvas.box(left, top, right - left, bottom - top, style.GROUND)


def sensing(d: Drawing) -> None:
    """Tint the area in sight of the team, where range or angle of sight are limited."""
    s = d.scene.scenario
    if math.isinf(s.sensing_range) and s.field_of_view >= 2 * math.pi - 1e-9:
        return
    areas = [d.camera.project(area_in_sight(d, i)) for i in np.flatnonzero(d.scene.senses).tolist()]
    for area in areas:  # every fill hides the outlines inside it
        d.canvas.polygon(area, style.SENSING_RIM, 2 * d.point)
    for area in areas:
        d.canvas.polygon(area, style.SENSING)


def area_in_sight(d: Drawing, tracker: int) -> Points:
    """Return the corners (K, 2) m of the area that a tracker's sensor covers, a ray for each degree.

    It ends at the edge of the floor, and what lies behind an obstacle is not in sight.
    """
    s, position, heading = d.scene.scenario, d.scene.position[tracker], d.scene.heading[tracker]
    half = min(s.field_of_view / 2, math.pi)
    angles = math.atan2(heading[1], heading[0]) + np.linspace(-half, half, math.ceil(360 * half / math.pi) + 2)
    ray = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    low, high = d.camera.floor()
    edges = np.where(ray > 0, high - position, position - low) / np.maximum(np.abs(ray), 1e-9)
    reach = np.minimum(s.sensing_range, edges.min(axis=1))
    for x, y, radius in d.scene.obstacles:
        towards = np.array([x, y]) - position
        along, across = ray @ towards, ray[:, 0] * towards[1] - ray[:, 1] * towards[0]
        entry = along - np.sqrt(np.maximum(radius**2 - across**2, 0))
        reach = np.where((entry > 0) & (np.abs(across) < radius), np.minimum(reach, entry), reach)
    rim = position + reach[:, None] * ray
    return rim if half == math.pi else np.concatenate([position[None], rim])


def grid(d: Drawing) -> None:
    """Draw faint crosses two metres apart, as a reference for distance and speed.

    Grid lines would change every row of a video with a moving view; crosses compress better.
    """
    reach = np.array(d.camera.viewport[2:]) / (2 * d.camera.scale) + _GRID_STEP
    in_view = np.clip(d.camera.floor(), d.camera.centre - reach, d.camera.centre + reach)
    low, high = np.ceil(in_view / _GRID_STEP)
    columns, rows = (np.arange(a, b) * _GRID_STEP for a, b in zip(low, high, strict=True))
    crosses = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    for place in d.camera.project(crosses):
        for arm in ((4 * d.point, 0), (0, 4 * d.point)):
            d.canvas.line(place - arm, place + arm, d.point, style.GRID)


def trails(d: Drawing) -> None:
    """Draw the trails, fading with age."""
    for (before, _), (after, fresh) in itertools.pairwise(d.history.trail()):
        for i, (start, end) in enumerate(zip(d.camera.project(before), d.camera.project(after), strict=True)):
            colour = style.TARGET if i == len(before) - 1 else style.TRACKER
            d.canvas.line(start, end, 1.6 * d.point, style.mix(colour, style.GROUND, 0.12 + 0.68 * fresh**1.5))


def frame(d: Drawing) -> None:
    """Draw the line of the slot frame through the target, from the last slot to a metre ahead."""
    behind = min(0.0, float(((d.scene.slots - d.scene.target) @ d.scene.frame).min()))
    ends = d.scene.target + np.outer([behind, 1.0], d.scene.frame)
    back, ahead = d.camera.project(ends)
    dashes = np.linspace(ahead, back, 2 * math.ceil(math.dist(ahead, back) / (8 * d.point)))
    for start, end in dashes.reshape(-1, 2, 2):
        d.canvas.line(start, end, d.point, style.SLOT)


def slots(d: Drawing) -> None:
    """Draw each slot as a circle of the tolerance, filled when it is occupied."""
    radius = d.scene.scenario.tolerance * d.camera.scale
    for place, occupied in zip(d.camera.project(d.scene.slots), d.scene.occupied, strict=True):
        if occupied:
            d.canvas.disc(place, radius, style.SLOT_FILLED)
        d.canvas.disc(place, radius, style.SLOT, 1.5 * d.point)


def obstacles(d: Drawing) -> None:
    """Draw the obstacles."""
    for x, y, radius in d.scene.obstacles:
        place = d.camera.project(np.array([x, y]))
        d.canvas.disc(place, radius * d.camera.scale, style.OBSTACLE_RIM)
        d.canvas.disc(place, radius * d.camera.scale - d.point, style.OBSTACLE)


def links(d: Drawing) -> None:
    """Draw a line between trackers that hear each other; a large team has too many."""
    places = d.camera.project(d.scene.position)
    for i, j in np.argwhere(np.triu(d.scene.links, 1)) if len(places) <= _MOST_LINKED else ():
        d.canvas.line(places[i], places[j], d.point, style.mix(style.LINK, style.GROUND, 0.5))


def trackers(d: Drawing) -> None:
    """Draw the trackers: discs with a line for the heading, broken ones crossed out.

    Those that do not see the target themselves are pale.
    """
    scene, point, radius = d.scene, d.point, d.radius
    places = d.camera.project(scene.position)
    for i in np.argsort(~scene.broken, kind="stable"):  # the broken ones below
        place, ahead = places[i], places[i] + scene.heading[i] * (1, -1) * (radius + 3.5 * point)
        colour, rim = d.colours[i], style.TRACKER_RIM
        if scene.broken[i]:
            colour, rim = style.BROKEN, style.TRACKER
        elif not scene.sees[i]:
            colour = style.mix(colour, style.PAPER, 0.45)
        d.canvas.disc(place, radius, rim)
        d.canvas.disc(place, radius - 1.2 * point, colour)
        d.canvas.line(place, ahead, 1.8 * point, rim)
        for sign in (1, -1) if scene.broken[i] else ():
            arm = (0.7 * radius + point) * np.array([1, sign])
            d.canvas.line(place - arm, place + arm, 1.6 * point, style.INK)


def target(d: Drawing) -> None:
    """Draw the target, with its own colour and a white rim."""
    place, heading = d.camera.project(d.scene.target), d.scene.target_heading * (1, -1)
    radius, point = d.radius, d.point
    end = place + heading * (radius + 5 * point)
    d.canvas.disc(place, radius + 2.5 * point, style.PAPER)
    d.canvas.line(place, end + heading * point, 5 * point, style.PAPER)
    d.canvas.disc(place, radius + point, style.TARGET)
    d.canvas.line(place, end, 2.4 * point, style.TARGET)


def flashes(d: Drawing) -> None:
    """Draw a growing, fading ring around each recent contact."""
    for place, age in d.history.flashes():
        radius = d.radius + (3 + 9 * age) * d.point
        d.canvas.disc(d.camera.project(place), radius, style.mix(style.CONTACT, style.GROUND, 1 - age), 2.2 * d.point)


def header(d: Drawing) -> None:
    """Write the title on the left, time and score on the right."""
    middle, edge = HEADER * d.point / 2, _EDGE * d.point
    d.canvas.box(0, 0, d.canvas.size[0], d.camera.viewport[1], style.PAPER)
    d.canvas.text(d.title, (edge, middle), _TITLE * d.point, style.INK)
    figures = f"{d.scene.time:.1f} s    score {d.scene.score:.2f}"
    d.canvas.text(figures, (d.canvas.size[0] - edge, middle), _TEXT * d.point, style.INK, anchor=1)


def footer(d: Drawing) -> None:
    """Draw the scale bar."""
    point, scale, middle = d.point, d.camera.scale, d.canvas.size[1] - FOOTER * d.point / 2
    d.canvas.box(0, sum(d.camera.viewport[1::2]), *d.canvas.size, style.PAPER)
    length = max((v for v in _BAR_LENGTHS if v * scale <= _BAR_MOST * point), default=_BAR_LENGTHS[0])
    left, right = _EDGE * point, _EDGE * point + length * scale
    d.canvas.line((left, middle), (right, middle), 3 * point, style.INK)
    d.canvas.text(f"{length:g} m", (right + 7 * point, middle), _SMALL * point, style.INK)


def draw(d: Drawing) -> None:
    """Draw a frame: all layers, the last one on top."""
    d.canvas.box(0, 0, *d.canvas.size, style.PAPER)
    world = ground, sensing, grid, trails, frame, slots, obstacles, links, trackers, target, flashes
    for layer in (*world, header, footer):
        layer(d)
