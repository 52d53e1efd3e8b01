"""Results that the paper announces but does not show: several K and c, and the loss of a leader."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

import posse
from posse_baselines import Trajectory, with_settings
from posse_baselines.ddcs import TASKS
from posse_training.reproduce.formations import COLOURS, TARGET, draw_robots, look_of
from posse_training.reproduce.runs import median_world, played, relative, run_of, slot_error, times, told, working
from posse_training.style import BLUE, GREEN, GREY, GRID, ORANGE, note

_HEADING: Final = 2.6  # rad; of the target in the tracks
_TASK_COLOURS: Final = (GRID, ORANGE, GREEN, BLUE)


def tracks(seed: int) -> Figure:
    """Draw one tracker for three K with c = 0, and a team with different K and c."""
    figure, axes = plt.subplots(2, 3, figsize=(10, 5.2), layout="constrained", gridspec_kw={"height_ratios": (1.3, 1)})
    alone = posse.get_scenario("constant", num_trackers=1, horizon=300)
    start = {"tracker_pose": [(6.0, -1.5, 3.0)], "target_pose": (0.0, 0.0, _HEADING)}
    for column, name in ((0, "velocity-pursuit"), (1, "pngl")):
        for number, k in enumerate((0.9, 1.0, 1.1)):
            policy = with_settings(name, navigation_constant=k)
            run = run_of(policy, alone, 1, seed, start)
            _track(axes[0, column], run, 0, number)
            _bearing(axes[1, column], run, 0, number, f"K = {k:g}")
            if column == 0:
                axes[1, 0].axhline(_HEADING / k, color=GREY, lw=0.6)
    axes[0, 0].set_title("K of three values, c = 0", loc="left")
    axes[0, 1].set_title("K of three values, c = ψ - K σ_d", loc="left")
    team = posse.get_scenario("constant", horizon=300)
    rng = np.random.default_rng(seed)
    pose = [(5.0 + rng.uniform(-1, 1), y, rng.uniform(2, 4)) for y in (-3.0, -1.8, -0.6, 0.6, 1.8)]
    start = {"tracker_pose": pose, "target_pose": (0.0, 0.0, _HEADING)}
    run = run_of("deviated-pursuit", team, 1, seed, start)
    for number in range(5):
        _track(axes[0, 2], run, number, number)
        _bearing(axes[1, 2], run, number, number, f"robot {number}")
    axes[0, 2].set_title("K = 1, five c", loc="left")
    for axis in axes[0]:
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_xlabel("x, m")
    for axis in axes[1]:
        axis.set_xlabel("time, s")
    for axis in axes[1, :2]:
        axis.legend(frameon=False, ncols=3, loc="upper right", columnspacing=1.0)
        axis.set_ylim(axis.get_ylim()[0], axis.get_ylim()[1] + 0.15)
    axes[0, 0].set_ylabel("y, m")
    axes[1, 0].set_ylabel("line of sight σ, rad")
    handles = [Line2D([], [], lw=1.4, label=f"robot {n}", **look_of(n)) for n in range(5)]
    handles.append(Line2D([], [], color=TARGET, lw=1.0, label="target"))
    note(figure, f"one run each from a given start, {played(team, seed)}")
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    return figure


def _track(axis: Axes, run: Trajectory, number: int, look: int) -> None:
    target, path = run["target_pose"][:, 0], run["tracker_pose"][:, 0, number]
    axis.plot(target[:, 0], target[:, 1], color=TARGET, lw=1.0)
    axis.plot(path[:, 0], path[:, 1], lw=1.4, **look_of(look))
    for marker, instant in (("o", 0), ("s", -1)):
        axis.plot(*path[instant, :2], marker, ms=4, color=COLOURS[look % 5])


def _bearing(axis: Axes, run: Trajectory, number: int, look: int, label: str) -> None:
    x, y = -relative(run)[:, 0, number].T
    sigma = np.unwrap(np.arctan2(y, x))
    sigma += 2 * math.pi * round((_HEADING - sigma[-1]) / (2 * math.pi))
    axis.plot(times(run), sigma, lw=1.4, label=label, **look_of(look))


def leader_loss(policy: str, worlds: int, seed: int) -> Figure:
    """Draw a run in which the leader breaks: error, task and leader of each robot over time."""
    scenario = posse.get_scenario("leader-loss")
    run = run_of(policy, scenario, worlds, seed)
    world, broke, recovered = _shown(run)
    time, alive, error = times(run), working(run)[:, world], slot_error(run)[:, world]
    figure, axes = plt.subplots(
        4, 1, figsize=(8.4, 8.2), layout="constrained", gridspec_kw={"height_ratios": (2.6, 2, 1, 1)}
    )
    start = max(0.0, broke - 5.0)
    end = min(time[-1], max(recovered, broke) + 5.0)
    keep = (time >= start) & (time <= end)
    draw_robots(axes[0], run, world, *(int(np.searchsorted(time, when)) for when in (broke, start)))
    axes[0].set_title(f"{policy}: the leader (thick rim) breaks at {broke:.1f} s", loc="left")
    axes[0].set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    robots = scenario.num_trackers
    for number in range(robots):
        at = alive[:, number] & keep
        axes[1].plot(time[at], error[at, number], lw=1.3, **look_of(number))
    axes[1].axhline(0.3, color=GREY, lw=0.8)
    axes[1].set_ylabel("distance from\nthe nearest slot, m")
    axes[1].set_ylim(0.0, None)
    extent = (start, end, robots - 0.5, -0.5)
    for axis, name, colours in ((axes[2], "task", _TASK_COLOURS), (axes[3], "leader", COLOURS)):
        known = np.ma.masked_where(~alive[keep].T, told(run, name)[keep, world].T)
        look = {"cmap": ListedColormap(colours), "vmin": -0.5, "vmax": len(colours) - 0.5}
        axis.imshow(known, aspect="auto", extent=extent, interpolation="nearest", **look)
        axis.set_ylabel(f"{name} of\nrobot")
        axis.set_yticks(range(robots))
        axis.grid(visible=False)
    for axis in axes[1:]:
        axis.set_xlim(start, end)
        axis.axvline(broke, color=TARGET, lw=1.0)
        if np.isfinite(recovered):
            axis.axvline(recovered, color=TARGET, lw=1.0, ls=":")
    axes[3].set_xlabel("time, s (line: the leader breaks; dotted: all slots are held again)")
    handles: list[Artist] = [Line2D([], [], lw=1.3, label=f"robot {n}", **look_of(n)) for n in range(robots)]
    handles += [Patch(fc=c, label=t) for c, t in zip(_TASK_COLOURS, TASKS, strict=True)]
    note(figure, f"world {world}, the median of {worlds:,} worlds, {played(scenario, seed)}")
    figure.legend(handles=handles, loc="outside upper center", ncols=5, frameon=False)
    return figure


def _shown(run: Trajectory) -> tuple[int, float, float]:
    """Return the world of the median recovery, when its leader broke, and when it recovered (s)."""
    time, alive = times(run), working(run)
    broken = np.asarray(~alive.all(axis=2))
    broke = np.where(broken.any(axis=0), time[broken.argmax(axis=0)], np.nan)
    away = np.asarray(alive & (slot_error(run) >= 0.3))
    off = broken & away.any(axis=2)  # (T + 1, E)
    last = run.steps - off[::-1].argmax(axis=0)
    recovered = time[np.minimum(last + 1, run.steps)]
    taken = np.where(off.any(axis=0) & ~off[-1], recovered - broke, np.nan)
    world = median_world(taken)
    return world, float(broke[world]), float(broke[world] + taken[world])
