"""Layers of the selected robot: what it senses, whom it hears, where it believes the target."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.rendering.content.scene import Floats
from posse.rendering.layers import Drawing
from posse.rendering.style import FAINT_INK, GROUND, INK, LINK, PAPER, TARGET, mix

_GHOST_FADES: Final = 10.0  # s
_LINK_FADES: Final = 3.0  # s
_MANY: Final = 12  # links, beyond which they are thin and bear no ages
_OFF: Final = 0.05  # m, s; a fix that is off by less is not drawn


def selection(d: Drawing) -> None:
    """Draw a ring around the selected robot."""
    chosen = d.view.selected
    if chosen is None:
        return
    n = len(d.scene.position)
    place = d.camera.project(d.scene.target if chosen == n else d.scene.position[chosen])
    radius = d.radius + 6 * d.point
    d.canvas.ring(place, radius + d.point, 4 * d.point, PAPER)
    d.canvas.ring(place, radius, 2 * d.point, INK)


def sonar(d: Drawing) -> None:
    """Draw the selected tracker's sonar beams, with an arc where one meets something."""
    i, readings = d.selected, d.scene.knowledge.sonar
    if i is None or readings is None or not d.view.sensing or d.scene.broken[i]:
        return
    s, beams = d.scene.scenario, readings[i]
    centre, rim = d.camera.project(d.scene.position[i]), s.robot_radius
    ahead = math.atan2(d.scene.heading[i, 1], d.scene.heading[i, 0])
    for k, reading in enumerate(beams):
        angle = ahead + 2 * math.pi * k / len(beams)
        meets = reading < s.sonar_range - 1e-3
        way = np.array([math.cos(angle), -math.sin(angle)])
        radius = (rim + reading) * d.camera.scale
        colour = mix(INK, GROUND, 0.75) if meets else mix(FAINT_INK, GROUND, 0.35)
        width = (1.6 if meets else 1.0) * d.point
        d.canvas.line(centre + way * rim * d.camera.scale, centre + way * radius, width, colour)
        if meets:
            half = 0.8 * math.pi / len(beams)
            d.canvas.arc(centre, radius, np.linspace(angle - half, angle + half, 9), width, colour)


def heard(d: Drawing) -> None:
    """Draw whom the selected tracker hears; dashed, with its age, where the message is late."""
    i = d.selected
    if i is None or not d.view.links or d.scene.broken[i]:
        return
    s, ages = d.scene.scenario, d.scene.knowledge.heard_age[i]
    usual = s.radio_delay * s.control_step
    places = d.camera.project(d.scene.position)
    labels = []
    whom = np.flatnonzero(ages <= s.forget_after).tolist()
    width = (1.4 if len(whom) <= _MANY else 0.8) * d.point
    for j in whom:
        if j == i or (d.scene.broken[j] and ages[j] == 0):
            continue
        strength = min(1.0, max(0.0, 1 - (ages[j] - usual) / _LINK_FADES))
        colour = mix(LINK, GROUND, 0.3 + 0.6 * strength)
        if ages[j] > usual + _OFF:
            d.canvas.dashes(places[i], places[j], width, 4 * d.point, colour)
            labels.append((f"{ages[j]:.1f} s", (places[i] + places[j]) / 2))
        else:
            d.canvas.line(places[i], places[j], width, colour)
    for text, place in labels if len(whom) <= _MANY else ():
        label(d, text, place)


def fix(d: Drawing) -> None:
    """Draw the target in the selected tracker's last fix, where that is off; paler with age."""
    i = d.selected
    if i is None:
        return
    known = d.scene.knowledge
    place, age = known.fix[i], known.fix_age[i]
    if not np.isfinite(place).all():
        return
    if age <= _OFF and math.dist(place, d.scene.target) <= _OFF:
        return
    at, radius = d.camera.project(place), d.radius + 3 * d.point
    colour = mix(TARGET, GROUND, max(0.4, 1 - age / _GHOST_FADES))
    d.canvas.dashed_ring(at, radius, 1.8 * d.point, 4 * d.point, colour)
    ahead = known.fix_heading[i] * (1, -1)
    d.canvas.line(at + ahead * radius, at + ahead * (radius + 6 * d.point), 1.8 * d.point, colour)
    if age > _OFF:
        label(d, f"fix {age:.1f} s ago", at + np.array([0, radius + 9 * d.point]))


def estimate(d: Drawing) -> None:
    """Draw where the selected tracker's policy believes the target to be."""
    i, estimates = d.selected, d.scene.knowledge.estimate
    if i is None or estimates is None or not np.isfinite(estimates[i]).all():
        return
    at, radius = d.camera.project(estimates[i, :2]), d.radius + 6 * d.point
    d.canvas.dashed_ring(at, radius, 1.4 * d.point, 2.2 * d.point, LINK)


def goal(d: Drawing) -> None:
    """Draw a dotted line from the selected tracker to the slot that its policy sends it to."""
    i, slots = d.selected, d.scene.knowledge.slot
    if i is None or slots is None or not 0 <= slots[i] < len(d.scene.slots):
        return
    start, end = d.camera.project(np.stack([d.scene.position[i], d.scene.slots[slots[i]]]))
    d.canvas.dashes(start, end, 1.3 * d.point, 2.2 * d.point, mix(TARGET, GROUND, 0.75))


def label(d: Drawing, text: str, place: Floats) -> None:
    """Write a few words in the picture, on a patch of paper."""
    size = 13 * d.point
    width = d.canvas.width_of(text, size)
    x, y = float(place[0]), float(place[1])
    d.canvas.box(x - width / 2 - 2, y - size / 2, width + 4, size, PAPER)
    d.canvas.text(text, (x, y), size, INK, anchor=0.5)
