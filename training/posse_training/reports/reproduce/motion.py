"""Figures 7 to 10: formations with slots and trails, and curves, for several policies."""

from __future__ import annotations

from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_training.reports.pictures.style import BLUE, GREEN, GREY, INK, PINK, RED, note
from posse_training.reports.reproduce.recording import Recording

COLOURS: Final = (BLUE, RED, GREEN, PINK, GREY)
LINES: Final[tuple[Any, ...]] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (8, 3)))
TARGET: Final = INK
_AFTER: Final = 1.5  # share of the settling time that curves go on for
_LEAST: Final = 5.0  # s


def look_of(number: int) -> dict[str, Any]:
    """Colour and line style of a robot."""
    return {"color": COLOURS[number % 5], "ls": LINES[number % 5]}


def frames(shown: list[tuple[str, Recording, int, float]], played: str) -> Figure:
    """Draw start, half the settling time and the settled formation, a row for each (name, ...).

    ``played`` is written below: world, split, seed and version.
    """
    figure, axes = plt.subplots(len(shown), 3, figsize=(9.6, 3.3 * len(shown)), layout="constrained", squeeze=False)
    for row, (name, recording, world, settled) in zip(axes, shown, strict=True):
        last = settled if np.isfinite(settled) else recording.time[-1]
        for axis, time in zip(row, (0.0, last / 2, last), strict=True):
            instant = int(np.searchsorted(recording.time, time - 1e-9))
            draw_robots(axis, recording, world, instant)
            axis.set_title(f"t = {recording.time[instant]:.1f} s", loc="left")
        row[0].set_ylabel(f"{name}\ny, m")
    for axis in axes[-1]:
        axis.set_xlabel("x, m")
    handles = [
        Line2D([], [], marker="o", ls="", mfc="none", mec=GREY, ms=9, label="slot"),
        Line2D([], [], marker="o", ls="", mfc=TARGET, mec=TARGET, ms=7, label="target"),
        Line2D([], [], color=GREY, lw=1.2, label="trail"),
    ]
    if any((recording.leader[:, world] >= 0).any() for _, recording, world, _ in shown):
        rim = Line2D([], [], marker="o", ls="", mfc="w", mec=TARGET, mew=2.2, ms=8, label="leader")
        handles.append(rim)
    note(figure, played)
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure


def draw_robots(axis: Axes, recording: Recording, world: int, instant: int, since: int = 0) -> None:
    """Draw robots with headings, trails since an instant, slots; the leader has a thick rim."""
    target, trackers = recording.target[instant, world], recording.trackers[instant, world]
    r = recording.radius
    for x, y in recording.slots[instant, world]:
        axis.add_patch(mpl.patches.Circle((x, y), 1.35 * r, fill=False, ec=GREY, lw=0.8))
    trail = recording.target[since : instant + 1, world]
    axis.plot(trail[:, 0], trail[:, 1], color=TARGET, lw=0.9)
    for number in range(len(trackers)):
        trail = recording.trackers[since : instant + 1, world, number]
        axis.plot(trail[:, 0], trail[:, 1], lw=1.1, **look_of(number))
    leader = recording.leader[instant, world].max()
    for number, (x, y, theta) in enumerate([*trackers, target]):
        is_target = number == len(trackers)
        edge = TARGET if is_target else COLOURS[number % 5]
        face = TARGET if is_target else "w"
        rim = 2.4 if number == leader else 1.0
        axis.add_patch(mpl.patches.Circle((x, y), r, fc=face, ec=edge, lw=rim, zorder=3))
        nose = (x + 1.5 * r * np.cos(theta), y + 1.5 * r * np.sin(theta))
        axis.plot(*zip((x, y), nose, strict=True), color=edge, lw=1.3, zorder=4)
        if not is_target:
            axis.text(x, y, str(number), ha="center", va="center", fontsize=6, zorder=5)
    centre = np.vstack([trackers, target])[:, :2]
    middle = (centre.min(axis=0) + centre.max(axis=0)) / 2
    reach = max(1.9, 0.35 + float(np.abs(centre - middle).max()))
    axis.set_xlim(middle[0] - reach, middle[0] + reach)
    axis.set_ylim(middle[1] - reach, middle[1] + reach)
    axis.set_aspect("equal")


def curves(shown: list[tuple[str, Recording, int, float]], paper: float, played: str) -> Figure:
    """Draw every tracker against time, a column for each (name, recording, world, settled)."""
    rows = (
        "x from the\ntarget, m",
        "y from the\ntarget, m",
        "speed V, m/s",
        "heading from the\ntarget's, rad",
        "distance from\nthe slot, m",
    )
    figure, axes = plt.subplots(
        len(rows),
        len(shown),
        figsize=(4.6 * len(shown), 8.6),
        layout="constrained",
        sharex="col",
        sharey="row",
        squeeze=False,
    )
    for column, (name, recording, world, settled) in zip(axes.T, shown, strict=True):
        end = max(_LEAST, _AFTER * settled) if np.isfinite(settled) else recording.time[-1]
        keep = recording.time <= end + 1e-9
        relative = recording.relative[keep, world]
        turned = recording.trackers[keep, world, :, 2] - recording.target[keep, world, None, 2]
        heading = np.unwrap((turned + np.pi) % (2 * np.pi) - np.pi, axis=0)
        values = (
            relative[..., 0],
            relative[..., 1],
            recording.speeds[keep, world],
            heading,
            recording.error[keep, world],
        )
        for axis, what in zip(column, values, strict=True):
            for number in range(what.shape[1]):
                axis.plot(recording.time[keep], what[:, number], lw=1.3, **look_of(number))
            axis.axvline(paper, color=GREY, ls=":", lw=1.2)
            if np.isfinite(settled):
                axis.axvline(settled, color=GREY, lw=1.0)
        when = f"settled at {settled:.1f} s" if np.isfinite(settled) else "not settled"
        column[0].set_title(f"{name}: {when}", loc="left")
        column[-1].set_xlabel("time, s")
    for axis, label in zip(axes[:, 0], rows, strict=True):
        axis.set_ylabel(label)
    robots = range(shown[0][1].trackers.shape[2])
    handles = [Line2D([], [], lw=1.3, label=f"robot {n}", **look_of(n)) for n in robots]
    handles += [
        Line2D([], [], color=GREY, lw=1.0, label="settled"),
        Line2D([], [], color=GREY, ls=":", lw=1.2, label=f"the paper's {paper:g} s"),
    ]
    note(figure, played)
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure
