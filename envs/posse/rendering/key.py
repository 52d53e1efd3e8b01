"""The legend of a picture: a sample and a line of text for everything that the layers draw."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from posse.rendering import layers, selected
from posse.rendering.content.scene import Scene
from posse.rendering.layers import Drawing, leader_mark
from posse.rendering.legend import tasks_of
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

Sample = Callable[["Canvas", float, float, float], None]
"""(canvas, x, y, unit): draws about a centre, at most 16 units to each side and 9 up and down."""


@dataclass(frozen=True)
class Entry:
    """A line of the legend.

    Attributes:
        layer: The layer that it explains.
        sample: Draws an example.
        text: What it means.
    """

    layer: Callable[[Drawing], None]
    sample: Sample
    text: str


def _robot(colour: Colour, rim: Colour = TRACKER_RIM) -> Sample:
    def draw(canvas: Canvas, x: float, y: float, u: float) -> None:
        canvas.disc((x, y), 7 * u, rim)
        canvas.disc((x, y), 5.8 * u, colour)
        canvas.line((x, y), (x + 11 * u, y), 1.8 * u, rim)

    return draw


def _broken(canvas: Canvas, x: float, y: float, u: float) -> None:
    _robot(BROKEN, TRACKER)(canvas, x, y, u)
    for sign in (1, -1):
        canvas.line((x - 6 * u, y - 6 * u * sign), (x + 6 * u, y + 6 * u * sign), 1.6 * u, INK)


def _leader(canvas: Canvas, x: float, y: float, u: float) -> None:
    leader_mark(canvas, np.array([x, y + 5 * u]), 6 * u)


def _slot(filled: bool) -> Sample:
    def draw(canvas: Canvas, x: float, y: float, u: float) -> None:
        if filled:
            canvas.disc((x, y), 8 * u, SLOT_FILLED)
        canvas.ring((x, y), 8 * u, 1.5 * u, SLOT)

    return draw


def _frame(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.dashes((x + 16 * u, y), (x - 16 * u, y), u, 4 * u, SLOT)


def _line(colour: Colour, width: float, dash: float = 0.0) -> Sample:
    def draw(canvas: Canvas, x: float, y: float, u: float) -> None:
        if dash:
            canvas.dashes((x - 16 * u, y), (x + 16 * u, y), width * u, dash * u, colour)
        else:
            canvas.line((x - 16 * u, y), (x + 16 * u, y), width * u, colour)

    return draw


def _trail(canvas: Canvas, x: float, y: float, u: float) -> None:
    for k, colour in enumerate((TRAIL, TARGET)):
        at = y + (6 * k - 3) * u
        for part in range(8):
            start = x + (4 * part - 16) * u
            canvas.line((start, at), (start + 4 * u, at), 1.6 * u, mix(colour, PAPER, part / 8))


def _area(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.box(x - 15 * u, y - 9 * u, 30 * u, 18 * u, SENSING_RIM)
    canvas.box(x - 14 * u, y - 8 * u, 28 * u, 16 * u, SENSING)


def _sonar(canvas: Canvas, x: float, y: float, u: float) -> None:
    colour = mix(INK, GROUND, 0.75)
    canvas.line((x - 14 * u, y), (x + 8 * u, y), 1.6 * u, colour)
    canvas.arc((x - 14 * u, y), 22 * u, np.linspace(-0.35, 0.35, 7), 1.6 * u, colour)


def _ghost(colour: Colour, dash: float) -> Sample:
    def draw(canvas: Canvas, x: float, y: float, u: float) -> None:
        canvas.dashed_ring((x, y), 8 * u, 1.7 * u, dash * u, colour)

    return draw


def _selection(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.disc((x, y), 4 * u, TRACKER)
    canvas.ring((x, y), 9 * u, 2 * u, INK)


def _contact(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.ring((x, y), 9 * u, 2.2 * u, CONTACT)


def _obstacle(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.disc((x, y), 9 * u, OBSTACLE_RIM)
    canvas.disc((x, y), 8 * u, OBSTACLE)


def _cross(canvas: Canvas, x: float, y: float, u: float) -> None:
    canvas.line((x - 4 * u, y), (x + 4 * u, y), u, mix(INK, GRID, 0.2))
    canvas.line((x, y - 4 * u), (x, y + 4 * u), u, mix(INK, GRID, 0.2))


def legend_of(scene: Scene) -> tuple[Entry, ...]:
    """Return a line for everything that pictures of a scene's world and team may show."""
    s, known = scene.scenario, scene.knowledge
    trackers, sensing = layers.trackers, layers.sensing
    found = [Entry(layers.target, _robot(TARGET, TARGET), "target; the line points ahead")]
    tasks = tasks_of(scene)
    found += [Entry(trackers, _robot(colour), f"tracker: {name}") for name, colour in tasks]
    if not tasks:
        found.append(Entry(trackers, _robot(TRACKER), "tracker; the line points ahead"))
    if scene.limited_sight:
        found.append(Entry(trackers, _robot(pale(TRACKER)), "pale: does not see the target itself"))
    if s.breaks:
        found.append(Entry(trackers, _broken, "broken"))
    if scene.leads is not None:
        found.append(Entry(trackers, _leader, "considers itself the leader"))
    found += [
        Entry(layers.slots, _slot(False), "slot, as wide as the tolerance"),
        Entry(layers.slots, _slot(True), "slot that a tracker occupies"),
        Entry(layers.frame, _frame, "heading of the slot frame"),
        Entry(layers.trails, _trail, "way of the last 6 s"),
    ]
    if s.num_obstacles:
        found.append(Entry(layers.obstacles, _obstacle, "obstacle"))
    if math.isfinite(s.arena):
        found.append(Entry(layers.walls, _line(WALL, 3), "wall"))
    limited = math.isfinite(s.sensing_range) or s.field_of_view < 2 * math.pi - 1e-9
    if limited or s.num_obstacles:
        whose = "the selected tracker, or the team," if limited else "the selected tracker"
        found.append(Entry(sensing, _area, f"where {whose} would see the target"))
    if scene.links.any() or math.isfinite(s.radio_range):
        found.append(Entry(layers.links, _line(LINK, 1.2), "two trackers that hear each other"))
    found += [
        Entry(selected.selection, _selection, "selected robot"),
        Entry(selected.heard, _line(LINK, 1.4), "selected: whom it hears"),
    ]
    if known.heard_age.any():
        found.append(Entry(selected.heard, _line(LINK, 1.4, 4), "the same, late: age beside it"))
    if known.sonar is not None:
        found.append(Entry(selected.sonar, _sonar, "selected: sonar beam that meets something"))
    found.append(Entry(selected.fix, _ghost(TARGET, 4), "selected: its last fix, if that is off"))
    if known.estimate is not None:
        text = "selected: where it believes the target"
        found.append(Entry(selected.estimate, _ghost(LINK, 2.2), text))
    if known.slot is not None:
        line = _line(mix(TARGET, GROUND, 0.75), 1.3, 2.2)
        found.append(Entry(selected.goal, line, "selected: the slot that it goes to"))
    found += [Entry(layers.flashes, _contact, "contact"), Entry(layers.grid, _cross, "grid of 2 m")]
    return tuple(found)


UNEXPLAINED: Final = (layers.ground,)
"""Layers that need no explanation."""
