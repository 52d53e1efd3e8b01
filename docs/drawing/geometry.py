"""The geometry of each law: what its symbols mean, on the axes of a figure."""

import math
from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, FancyArrowPatch

from posse_training import style as palette

Point = tuple[float, float]
TARGET, TRACKER, OTHER, GREY = palette.INK, palette.BLUE, palette.GREEN, palette.GREY
_RADIUS: Final = 0.16
_TEXT: Final = 11


def robot(axes: Axes, at: Point, heading: float, colour: str, name: str, nose: float = 0.75) -> None:
    """Draw a robot with an arrow along its heading."""
    axes.add_patch(Circle(at, _RADIUS, fc="w", ec=colour, lw=1.6, zorder=4))
    tip = ahead(at, heading, nose)
    axes.add_patch(FancyArrowPatch(at, tip, arrowstyle="-|>", mutation_scale=10, color=colour, lw=1.3, zorder=3))
    axes.text(at[0], at[1] - 0.42, name, ha="center", va="center", color=colour, size=_TEXT, zorder=5)


def ahead(at: Point, heading: float, distance: float) -> Point:
    """Return the point at a distance in a direction."""
    return at[0] + distance * math.cos(heading), at[1] + distance * math.sin(heading)


def line(axes: Axes, start: Point, end: Point, label: str = "", style: str = "--") -> None:
    """Draw a line between two points with a label beside its middle."""
    axes.plot(*zip(start, end, strict=True), color=GREY, lw=1.0, ls=style, zorder=1)
    if label:
        bearing = math.atan2(end[1] - start[1], end[0] - start[0])
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        _note(axes, ahead(middle, bearing + math.pi / 2, 0.24), label)


def angle(axes: Axes, at: Point, low: float, high: float, size: float, label: str) -> None:
    """Draw the arc from one direction (rad) to another, anticlockwise, with its name."""
    axes.add_patch(Arc(at, 2 * size, 2 * size, theta1=math.degrees(low), theta2=math.degrees(high), lw=1.0))
    _note(axes, ahead(at, (low + high) / 2, size + 0.24), label)


def _note(axes: Axes, at: Point, text: str) -> None:
    axes.text(*at, text, ha="center", va="center", size=_TEXT, zorder=6)


def _frame(axes: Axes, points: Sequence[Point], border: float = 0.65) -> None:
    xs, ys = zip(*points, strict=True)
    axes.set_xlim(min(xs) - border, max(xs) + border)
    axes.set_ylim(min(ys) - border, max(ys) + border)
    axes.set_aspect("equal")
    axes.axis("off")


def pursuit(axes: Axes, *, deviated: bool = False) -> None:
    """Draw velocity pursuit (the heading on the line of sight) or deviated pursuit (beside it)."""
    tracker, target = (0.0, 0.0), (2.6, 1.5)
    sigma = math.atan2(target[1], target[0])
    c = 0.5 if deviated else 0.0
    line(axes, tracker, target, "r" if deviated else "")
    line(axes, tracker, (1.7, 0.0), style=":")
    angle(axes, tracker, 0.0, sigma, 1.15, "σ")
    robot(axes, tracker, sigma + c, TRACKER, "tracker", 1.5 if deviated else 1.9)
    if not deviated:
        _note(axes, ahead(tracker, sigma + 0.16, 1.6), "θ = σ")
    else:
        angle(axes, tracker, sigma, sigma + c, 0.95, "c")
    robot(axes, target, 0.2, TARGET, "target")
    _frame(axes, [tracker, target, (3.3, 1.7), (0.8, 1.4)])


def navigation(axes: Axes) -> None:
    """Draw proportional navigation to a slot: σ and θ now, σ_d and ψ of the slot."""
    target, psi = (3.0, 1.4), 0.35
    slot = ahead(target, psi + math.pi + 0.55, 1.9)
    tracker = (0.0, 1.5)
    sigma = math.atan2(target[1] - tracker[1], target[0] - tracker[0])
    sigma_d = math.atan2(target[1] - slot[1], target[0] - slot[0])
    theta = psi + 1.1 * (sigma - sigma_d)
    line(axes, tracker, target, "r")
    line(axes, tracker, (1.5, 1.5), style=":")
    line(axes, slot, target)
    line(axes, slot, (slot[0] + 1.2, slot[1]), style=":")
    axes.add_patch(Circle(slot, 0.24, fill=False, ec=GREY, ls="--"))
    angle(axes, slot, 0.0, sigma_d, 0.85, "σ_d")
    _note(axes, (slot[0], slot[1] - 0.42), "slot")
    angle(axes, tracker, theta, 0.0, 0.8, "θ")
    robot(axes, tracker, theta, TRACKER, "tracker", 1.3)
    robot(axes, target, psi, TARGET, "", 0.9)
    _note(axes, (target[0] + 0.45, target[1] - 0.35), "target")
    _note(axes, (target[0] + 0.55, target[1] + 0.55), "ψ")
    _frame(axes, [tracker, target, slot, (3.8, 1.9)])


def l_phi(axes: Axes) -> None:
    """Draw l and φ of a follower's control point, seen from its leader, and γ."""
    leader, heading = (2.6, 1.2), 0.5
    point = (0.75, 0.35)
    own = 0.05
    follower = ahead(point, own + math.pi, 0.6)
    bearing = math.atan2(point[1] - leader[1], point[0] - leader[0]) + 2 * math.pi
    line(axes, leader, point, "l")
    line(axes, follower, point, style="-")
    line(axes, leader, ahead(leader, heading, 1.1), style=":")
    angle(axes, leader, heading, bearing, 0.48, "φ")
    axes.plot(*point, "o", ms=5, color=TRACKER, zorder=6)
    _note(axes, (point[0] + 0.15, point[1] - 0.25), "c_j")
    _note(axes, ((follower[0] + point[0]) / 2, point[1] + 0.18), "d")
    robot(axes, follower, own, TRACKER, "follower j", 1.25)
    robot(axes, leader, heading, OTHER, "leader i", 0.9)
    _frame(axes, [leader, follower, (3.3, 1.8), (0.1, 0.0)])


def slot_law(axes: Axes) -> None:
    """Draw the slot's velocity, the gain on the offset, and their sum."""
    tracker, slot = (0.0, 0.0), (2.2, 0.9)
    axes.add_patch(Circle(slot, 0.24, fill=False, ec=GREY, ls="--"))
    line(axes, tracker, slot)
    offset, velocity = (1.25, 0.51), (0.35, 0.95)
    total = (offset[0] + velocity[0], offset[1] + velocity[1])
    for start, end, colour in (
        (tracker, offset, TRACKER),
        (offset, total, OTHER),
        (tracker, total, TARGET),
        (slot, (slot[0] + velocity[0], slot[1] + velocity[1]), OTHER),
    ):
        arrow = FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=10, color=colour, shrinkA=0, shrinkB=0)
        axes.add_patch(arrow)
    _note(axes, (0.95, 0.14), "k e")
    _note(axes, (1.72, 0.95), "v_s")
    _note(axes, (0.62, 0.92), "v")
    _note(axes, (1.9, 0.5), "e")
    _note(axes, (slot[0] + 0.35, slot[1] - 0.42), "slot")
    robot(axes, tracker, math.atan2(total[1], total[0]), TRACKER, "tracker", 0.3)
    _frame(axes, [tracker, slot, (2.6, 1.9)])
