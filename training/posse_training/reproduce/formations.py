"""Figures 7 to 10: formations with slots and trails, and curves, for several policies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_baselines import Trajectory
from posse_training.reproduce.runs import relative, slot_error, slots, times, told
from posse_training.style import BLUE, GREEN, GREY, INK, PINK, RED, note

COLOURS: Final = (BLUE, RED, GREEN, PINK, GREY)
LINES: Final[tuple[Any, ...]] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (8, 3)))
TARGET: Final = INK
_AFTER: Final = 1.5  # share of the settling time that curves go on for
_LEAST: Final = 5.0  # s


def look_of(number: int) -> dict[str, Any]:
    """Colour and line style of a robot."""
    return {"color": COLOURS[number % 5], "ls": LINES[number % 5]}


@dataclass(frozen=True)
class Shown:
    """A world of a run, and the time at which it settled, s; nan: it did not."""

    policy: str
    run: Trajectory
    world: int
    settled: float


def frames(shown: Sequence[Shown], played: str) -> Figure:
    """Draw start, half the settling time and the settled formation, a row for each policy.

    ``played`` is written below: world, split, seed and version.
    """
    figure, axes = plt.subplots(len(shown), 3, figsize=(9.6, 3.3 * len(shown)), layout="constrained", squeeze=False)
    for row, one in zip(axes, shown, strict=True):
        time = times(one.run)
        last = one.settled if np.isfinite(one.settled) else time[-1]
        for axis, when in zip(row, (0.0, last / 2, last), strict=True):
            frame = int(np.searchsorted(time, when - 1e-9))
            draw_robots(axis, one.run, one.world, frame)
            axis.set_title(f"t = {time[frame]:.1f} s", loc="left")
        row[0].set_ylabel(f"{one.policy}\ny, m")
    for axis in axes[-1]:
        axis.set_xlabel("x, m")
    handles = [
        Line2D([], [], marker="o", ls="", mfc="none", mec=GREY, ms=9, label="slot"),
        Line2D([], [], marker="o", ls="", mfc=TARGET, mec=TARGET, ms=7, label="target"),
        Line2D([], [], color=GREY, lw=1.2, label="trail"),
    ]
    if any((told(one.run, "leader")[:, one.world] >= 0).any() for one in shown):
        rim = Line2D([], [], marker="o", ls="", mfc="w", mec=TARGET, mew=2.2, ms=8, label="leader")
        handles.append(rim)
    note(figure, played)
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure


def draw_robots(axis: Axes, run: Trajectory, world: int, frame: int, since: int = 0) -> None:
    """Draw robots with headings, trails since a frame, slots; the leader has a thick rim."""
    targets, teams = run["target_pose"][:, world], run["tracker_pose"][:, world]
    target, trackers = targets[frame].astype(np.float64), teams[frame].astype(np.float64)
    r = run.scenario.robot_radius
    for x, y in slots(run)[frame, world]:
        axis.add_patch(mpl.patches.Circle((x, y), 1.35 * r, fill=False, ec=GREY, lw=0.8))
    trail = slice(since, frame + 1)
    axis.plot(targets[trail, 0], targets[trail, 1], color=TARGET, lw=0.9)
    for number in range(len(trackers)):
        axis.plot(teams[trail, number, 0], teams[trail, number, 1], lw=1.1, **look_of(number))
    leader = told(run, "leader")[frame, world].max()
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


def curves(shown: Sequence[Shown], paper: float, played: str) -> Figure:
    """Draw every tracker against time, a column for each policy."""
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
    for column, one in zip(axes.T, shown, strict=True):
        run, world, settled, time = one.run, one.world, one.settled, times(one.run)
        end = max(_LEAST, _AFTER * settled) if np.isfinite(settled) else time[-1]
        keep = time <= end + 1e-9
        place = relative(run)[keep, world]
        turned = run["tracker_pose"][keep, world, :, 2].astype(np.float64) - run["target_pose"][keep, world, None, 2]
        heading = np.unwrap((turned + np.pi) % (2 * np.pi) - np.pi, axis=0)
        speeds, error = run["tracker_speed"][keep, world], slot_error(run)[keep, world]
        for axis, what in zip(column, (place[..., 0], place[..., 1], speeds, heading, error), strict=True):
            for number in range(what.shape[1]):
                axis.plot(time[keep], what[:, number], lw=1.3, **look_of(number))
            axis.axvline(paper, color=GREY, ls=":", lw=1.2)
            if np.isfinite(settled):
                axis.axvline(settled, color=GREY, lw=1.0)
        when = f"settled at {settled:.1f} s" if np.isfinite(settled) else "not settled"
        column[0].set_title(f"{one.policy}: {when}", loc="left")
        column[-1].set_xlabel("time, s")
    for axis, label in zip(axes[:, 0], rows, strict=True):
        axis.set_ylabel(label)
    robots = range(shown[0].run.scenario.num_trackers)
    handles = [Line2D([], [], lw=1.3, label=f"robot {n}", **look_of(n)) for n in robots]
    handles += [
        Line2D([], [], color=GREY, lw=1.0, label="settled"),
        Line2D([], [], color=GREY, ls=":", lw=1.2, label=f"the paper's {paper:g} s"),
    ]
    note(figure, played)
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure
