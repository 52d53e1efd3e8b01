"""Figures 7 to 10 of the paper, and of what it announces but does not show: several K and c, a leader's loss."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

import posse
from posse_baselines import DDCS, Trajectory
from posse_baselines.ddcs import TASKS
from posse_baselines.ddcs.baseline import FAMILY
from posse_training.reproduce import runs
from posse_training.reproduce.runs import Floats, relative, slot_error, times, told
from posse_training.style import BLUE, GREEN, GREY, GRID, INK, ORANGE, PINK, RED, note, subplots

COLOURS: Final = (BLUE, RED, GREEN, PINK, GREY)
LINES: Final[tuple[Any, ...]] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (8, 3)))
TARGET: Final = INK
_AFTER: Final = 1.5  # share of the settling time that curves go on for
_LEAST: Final = 5.0  # s
_AWAY: Final = 0.3  # m; a tracker this far from every slot holds none, after the leader broke
_HEADING: Final = 2.6  # rad; of the target in the tracks
_TASK_COLOURS: Final = (GRID, ORANGE, GREEN, BLUE)


def look_of(number: int) -> dict[str, Any]:
    """Colour and line style of a robot."""
    return {"color": COLOURS[number % 5], "ls": LINES[number % 5]}


def finish(figure: Figure, handles: Sequence[Artist], columns: int, played: str) -> Figure:
    """Return a figure with a legend above it, and below it what was played."""
    note(figure, played)
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, frameon=False)
    return figure


def robot_lines(robots: int, name: str = "robot", width: float = 1.3) -> list[Artist]:
    """Return the lines of robots for a legend."""
    return [Line2D([], [], lw=width, label=f"{name} {n}", **look_of(n)) for n in range(robots)]


def frames(shown: Mapping[str, Trajectory], played: str) -> Figure:
    """Draw start, half the settling time and the settled formation, a row for each policy's run of one world.

    ``played`` is written below: world, split, seed and version.
    """
    figure, axes = subplots(len(shown), 3, (9.6, 3.3 * len(shown)), squeeze=False)
    for row, (policy, run) in zip(axes, shown.items(), strict=True):
        time, settled = times(run), runs.settling_times(run)[0]
        last = settled if np.isfinite(settled) else time[-1]
        for axis, when in zip(row, (0.0, last / 2, last), strict=True):
            frame = int(np.searchsorted(time, when - 1e-9))
            draw_robots(axis, run, frame)
            axis.set_title(f"t = {time[frame]:.1f} s", loc="left")
        row[0].set_ylabel(f"{policy}\ny, m")
    for axis in axes[-1]:
        axis.set_xlabel("x, m")
    handles = [
        Line2D([], [], marker="o", ls="", mfc="none", mec=GREY, ms=9, label="slot"),
        Line2D([], [], marker="o", ls="", mfc=TARGET, mec=TARGET, ms=7, label="target"),
        Line2D([], [], color=GREY, lw=1.2, label="trail"),
    ]
    if any((told(run, "leader") >= 0).any() for run in shown.values()):
        handles.append(Line2D([], [], marker="o", ls="", mfc="w", mec=TARGET, mew=2.2, ms=8, label="leader"))
    return finish(figure, handles, 4, played)


def draw_robots(axis: Axes, run: Trajectory, frame: int, since: int = 0) -> None:
    """Draw robots of the first world with headings, trails since a frame, slots; the leader has a thick rim."""
    targets, teams = run["target_pose"][:, 0], run["tracker_pose"][:, 0]
    target, trackers = targets[frame].astype(np.float64), teams[frame].astype(np.float64)
    r = run.scenario.robot_radius
    for x, y in runs.slots(run)[frame, 0]:
        axis.add_patch(Circle((x, y), 1.35 * r, fill=False, ec=GREY, lw=0.8))
    trail = slice(since, frame + 1)
    axis.plot(targets[trail, 0], targets[trail, 1], color=TARGET, lw=0.9)
    for number in range(len(trackers)):
        axis.plot(teams[trail, number, 0], teams[trail, number, 1], lw=1.1, **look_of(number))
    leader = told(run, "leader")[frame, 0].max()
    for number, (x, y, theta) in enumerate([*trackers, target]):
        is_target = number == len(trackers)
        edge = TARGET if is_target else COLOURS[number % 5]
        face = TARGET if is_target else "w"
        rim = 2.4 if number == leader else 1.0
        axis.add_patch(Circle((x, y), r, fc=face, ec=edge, lw=rim, zorder=3))
        nose = (x + 1.5 * r * np.cos(theta), y + 1.5 * r * np.sin(theta))
        axis.plot(*zip((x, y), nose, strict=True), color=edge, lw=1.3, zorder=4)
        if not is_target:
            axis.text(x, y, str(number), ha="center", va="center", fontsize=6, zorder=5)
    centre = np.vstack([trackers, target])[:, :2]
    middle = (centre.min(axis=0) + centre.max(axis=0)) / 2
    reach = max(1.9, 0.35 + float(np.abs(centre - middle).max()))
    (left, low), (right, high) = middle - reach, middle + reach
    axis.set(xlim=(left, right), ylim=(low, high), aspect="equal")


def curves(shown: Mapping[str, Trajectory], paper: float, played: str) -> Figure:
    """Draw every tracker against time, a column for each policy's run of one world."""
    figure, axes = subplots(5, len(shown), (4.6 * len(shown), 8.6), sharex="col", sharey="row", squeeze=False)
    for column, (policy, run) in zip(axes.T, shown.items(), strict=True):
        time, settled = times(run), float(runs.settling_times(run)[0])
        end = max(_LEAST, _AFTER * settled) if np.isfinite(settled) else time[-1]
        keep = time <= end + 1e-9
        place = relative(run)[keep, 0]
        turned = run["tracker_pose"][keep, 0, :, 2].astype(np.float64) - run["target_pose"][keep, 0, None, 2]
        values = {
            "x from the\ntarget, m": place[..., 0],
            "y from the\ntarget, m": place[..., 1],
            "speed V, m/s": run["tracker_speed"][keep, 0],
            "heading from the\ntarget's, rad": np.unwrap((turned + np.pi) % (2 * np.pi) - np.pi, axis=0),
            "distance from\nthe slot, m": slot_error(run)[keep, 0],
        }
        for axis, what in zip(column, values.values(), strict=True):
            for number in range(what.shape[1]):
                axis.plot(time[keep], what[:, number], lw=1.3, **look_of(number))
            axis.axvline(paper, color=GREY, ls=":", lw=1.2)
            if np.isfinite(settled):
                axis.axvline(settled, color=GREY, lw=1.0)
        when = f"settled at {settled:.1f} s" if np.isfinite(settled) else "not settled"
        column[0].set_title(f"{policy}: {when}", loc="left")
        column[-1].set_xlabel("time, s")
    for axis, label in zip(axes[:, 0], values, strict=True):
        axis.set_ylabel(label)
    handles = [
        *robot_lines(run.scenario.num_trackers),
        Line2D([], [], color=GREY, lw=1.0, label="settled"),
        Line2D([], [], color=GREY, ls=":", lw=1.2, label=f"the paper's {paper:g} s"),
    ]
    return finish(figure, handles, 4, played)


def tracks(seed: int) -> Figure:
    """Draw one tracker for three K with c = 0, and a team with different K and c."""
    figure, axes = subplots(2, 3, (10, 5.2), gridspec_kw={"height_ratios": (1.3, 1)})
    alone = posse.get_scenario("constant", num_trackers=1, horizon=300)
    start = {"tracker_pose": [(6.0, -1.5, 3.0)], "target_pose": (0.0, 0.0, _HEADING)}
    for column, name in enumerate(("velocity-pursuit", "pngl")):
        for number, k in enumerate((0.9, 1.0, 1.1)):
            policy = DDCS(FAMILY[name], name).with_settings(navigation_constant=k)
            run = runs.run_of(policy, alone, 1, seed, start)
            _track(axes[:, column], run, 0, number, f"K = {k:g}")
            if column == 0:
                axes[1, 0].axhline(_HEADING / k, color=GREY, lw=0.6)
    team = posse.get_scenario("constant", horizon=300)
    rng = np.random.default_rng(seed)
    pose = [(5.0 + rng.uniform(-1, 1), y, rng.uniform(2, 4)) for y in (-3.0, -1.8, -0.6, 0.6, 1.8)]
    start = {"tracker_pose": pose, "target_pose": (0.0, 0.0, _HEADING)}
    run = runs.run_of("deviated-pursuit", team, 1, seed, start)
    for number in range(5):
        _track(axes[:, 2], run, number, number, f"robot {number}")
    titles = ("K of three values, c = 0", "K of three values, c = ψ - K σ_d", "K = 1, five c")
    for axis, title in zip(axes[0], titles, strict=True):
        axis.set_title(title, loc="left")
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_xlabel("x, m")
    for axis in axes[1]:
        axis.set_xlabel("time, s")
    for axis in axes[1, :2]:
        axis.legend(frameon=False, ncols=3, loc="upper right", columnspacing=1.0)
        axis.set_ylim(axis.get_ylim()[0], axis.get_ylim()[1] + 0.15)
    axes[0, 0].set_ylabel("y, m")
    axes[1, 0].set_ylabel("line of sight σ, rad")
    handles = [*robot_lines(5, width=1.4), Line2D([], [], color=TARGET, lw=1.0, label="target")]
    return finish(figure, handles, 6, f"one run each from a given start, {runs.played(team, seed)}")


def _track(axes: Sequence[Axes], run: Trajectory, number: int, look: int, label: str) -> None:
    """Draw a tracker's path beside the target's, and below it the line of sight over time."""
    target, path = run["target_pose"][:, 0], run["tracker_pose"][:, 0, number]
    axes[0].plot(target[:, 0], target[:, 1], color=TARGET, lw=1.0)
    axes[0].plot(path[:, 0], path[:, 1], lw=1.4, **look_of(look))
    for marker, instant in (("o", 0), ("s", -1)):
        axes[0].plot(*path[instant, :2], marker, ms=4, color=COLOURS[look % 5])
    x, y = -relative(run)[:, 0, number].T
    sigma = np.unwrap(np.arctan2(y, x))
    sigma += 2 * math.pi * round((_HEADING - sigma[-1]) / (2 * math.pi))
    axes[1].plot(times(run), sigma, lw=1.4, label=label, **look_of(look))


def leader_loss(policy: str, worlds: int, seed: int) -> Figure:
    """Draw a run in which the leader breaks: error, task and leader of each robot over time."""
    scenario = posse.get_scenario("leader-loss")
    played = runs.run_of(policy, scenario, worlds, seed)
    breaks, recoveries = _break_times(played)
    world = runs.median_world(recoveries - breaks)
    run, broke, recovered = played.episode(world), float(breaks[world]), float(recoveries[world])
    time, alive, error = times(run), runs.working(run)[:, 0], slot_error(run)[:, 0]
    figure, axes = subplots(4, 1, (8.4, 8.2), gridspec_kw={"height_ratios": (2.6, 2, 1, 1)})
    start = max(0.0, broke - 5.0)
    end = min(time[-1], max(recovered, broke) + 5.0)
    keep = (time > start - 0.5 * time[1]) & (time < end + 0.5 * time[1])  # with the frames at either end
    draw_robots(axes[0], run, *(int(np.searchsorted(time, when)) for when in (broke, start)))
    axes[0].set_title(f"{policy}: the leader (thick rim) breaks at {broke:.1f} s", loc="left")
    axes[0].set(xlabel="x, m", ylabel="y, m")
    robots = scenario.num_trackers
    for number in range(robots):
        at = alive[:, number] & keep
        axes[1].plot(time[at], error[at, number], lw=1.3, **look_of(number))
    axes[1].axhline(_AWAY, color=GREY, lw=0.8)
    axes[1].set(ylabel="distance from\nthe nearest slot, m", ylim=(0.0, None))
    extent = (start, end + time[1], robots - 0.5, -0.5)  # what is decided holds for a step
    for axis, name, colours in ((axes[2], "task", _TASK_COLOURS), (axes[3], "leader", COLOURS)):
        known = np.ma.masked_where(~alive[keep].T, told(run, name)[keep, 0].T)
        look = {"cmap": ListedColormap(colours), "vmin": -0.5, "vmax": len(colours) - 0.5}
        axis.imshow(known, aspect="auto", extent=extent, interpolation="nearest", **look)
        axis.set(ylabel=f"{name} of\nrobot", yticks=range(robots))
        axis.grid(visible=False)
    for axis in axes[1:]:
        axis.set_xlim(start, end)
        axis.axvline(broke, color=TARGET, lw=1.0)
        if np.isfinite(recovered):
            axis.axvline(recovered, color=TARGET, lw=1.0, ls=":")
    axes[3].set_xlabel("time, s (line: the leader breaks; dotted: all slots are held again)")
    tasks = [Patch(fc=colour, label=task) for colour, task in zip(_TASK_COLOURS, TASKS, strict=True)]
    facts = f"world {world}, the median of {worlds:,} worlds, {runs.played(scenario, seed)}"
    return finish(figure, [*robot_lines(robots), *tasks], 5, facts)


def _break_times(run: Trajectory) -> tuple[Floats, Floats]:
    """Return when each world's leader worked last, and when all slots were held again, (E,) s; nan: never."""
    time, alive = times(run), runs.working(run)
    broken = ~alive.all(axis=2)
    broke = np.where(broken.any(axis=0), time[broken.argmax(axis=0) - 1], np.nan)
    off = np.asarray(broken & (alive & (slot_error(run) >= _AWAY)).any(axis=2))  # (T + 1, E)
    recovered = time[np.minimum(runs.first_without(off), run.steps)]
    return broke, np.where(off.any(axis=0) & ~off[-1], recovered, np.nan)
