"""``posse reproduce``: the paper's section 4, figures 7 to 10: one shown run, and many starts.

The paper gives neither scale, gains nor starts; docs/reproduction.md says what was chosen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import tyro
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

import posse
from posse_baselines import begin, load

Floats = npt.NDArray[np.floating[Any]]

TARGET_HEADING: Final = math.pi
"""In the paper's figure 7 the target is the leftmost robot: it heads towards -x."""
DRAWN_AT_ONCE: Final = 2000
"""Worlds drawn at a time, to take the starts from."""
SPEED_TOLERANCE: Final = 0.1
"""m/s; a speed within this of its last value has settled."""


@dataclass(frozen=True)
class Experiment:
    """One model of the paper: what plays it, and what the paper says of it."""

    name: str
    scenario: str
    policy: str
    figures: str
    paper_settling_time: float


EXPERIMENTS: Final = (
    Experiment("centralized", "paper-centralized", "ddcs-centralized", "7 and 8", 1.6),
    Experiment("distributed", "paper-distributed", "ddcs-distributed", "9 and 10", 2.0),
    Experiment("distributed-pngl", "paper-distributed", "pngl", "9 and 10", 2.0),
)


@dataclass(frozen=True)
class Settings:
    """What ``posse reproduce`` takes."""

    out: Path = Path("runs/paper")
    """Folder for figures (PNG and SVG) and numbers (JSON)."""
    starts: int = 200
    """Drawn starts, beside the shown one, which is the first of them."""
    seed: int = 7
    """Of the starts, on the test split."""
    tolerance: float = 0.1
    """A position relative to the target within this of its last value has settled, m."""


@dataclass(frozen=True)
class Recording:
    """Paths of every robot in E worlds, T + 1 instants.

    Attributes:
        time: (T + 1,) s.
        trackers: (T + 1, E, N, 3): x, y, θ.
        target: (T + 1, E, 3).
        speeds: (T + 1, E, N) m/s.
        radius: Of a robot, m.
    """

    time: Floats
    trackers: Floats
    target: Floats
    speeds: Floats
    radius: float

    @property
    def relative(self) -> Floats:
        """Positions of the trackers as seen from the target, (T + 1, E, N, 2)."""
        return self.trackers[..., :2] - self.target[:, :, None, :2]


def draw_starts(scenario: posse.Scenario, starts: int, seed: int) -> tuple[Floats, Floats]:
    """Return starts as in figure 7, tracker poses (E, N, 3) and target poses (E, 3).

    The target is the leftmost robot and heads towards -x: of the worlds that the scenario draws,
    those in which every tracker stands behind it are taken, in order.
    """
    trackers, targets = [], []
    for first in range(0, 1_000_000, DRAWN_AT_ONCE):
        batch = posse.Batch(scenario, DRAWN_AT_ONCE, seed=seed, split="test", first_world=first)
        batch.reset()
        tracker, target = _poses(batch.arrays.tracker), _poses(batch.worlds)
        behind = (tracker[..., 0] > target[:, None, 0]).all(axis=1)
        trackers.append(tracker[behind])
        targets.append(target[behind])
        if sum(map(len, targets)) >= starts:
            break
    drawn = np.concatenate(targets)[:starts]
    drawn[:, 2] = TARGET_HEADING
    return np.concatenate(trackers)[:starts], drawn


def record(experiment: Experiment, starts: int, seed: int) -> Recording:
    """Play an experiment from drawn starts."""
    policy = load(experiment.policy)
    scenario = posse.get_scenario(experiment.scenario, message_size=policy.message_size)
    tracker_pose, target_pose = draw_starts(scenario, starts, seed)
    batch = posse.Batch(scenario, starts, seed=seed, split="test", autoreset="disabled")
    options = {"tracker_pose": tracker_pose, "target_pose": target_pose}
    observations = batch.reset(options=options)
    memory = begin(policy, batch)
    instants = [_instant(batch)]
    for _ in range(scenario.horizon):
        actions, memory = policy.act(observations, memory)
        observations, *_ = batch.step(actions)
        instants.append(_instant(batch))
    trackers, target, speeds = (np.stack(parts) for parts in zip(*instants, strict=True))
    time = np.arange(len(instants)) * scenario.control_step
    return Recording(time, trackers, target, speeds, scenario.robot_radius)


def _poses(records: npt.NDArray[Any]) -> Floats:
    theta = np.arctan2(records["heading_sin"], records["heading_cos"])
    return np.stack([records["x"], records["y"], theta], axis=-1).astype(np.float64)


def _instant(batch: posse.Batch) -> tuple[Floats, Floats, Floats]:
    tracker = batch.arrays.tracker
    return _poses(tracker), _poses(batch.worlds), tracker["speed"].astype(np.float64)


def settling_times(recording: Recording, tolerance: float) -> Floats:
    """Return when each world came to rest, (E,) s: the paper's "keep a certain value".

    From then on every tracker's position relative to the target stays within ``tolerance`` of its
    last value, and its speed within :data:`SPEED_TOLERANCE` of its last; ``nan`` where that holds
    for less than the last second.
    """
    relative, speeds = recording.relative, recording.speeds
    moved = np.linalg.norm(relative - relative[-1], axis=-1) > tolerance
    changed = np.abs(speeds - speeds[-1]) > SPEED_TOLERANCE
    unsettled = (moved | changed).any(axis=-1)  # (T + 1, E)
    steps = len(recording.time)
    last = np.where(unsettled.any(axis=0), steps - 1 - unsettled[::-1].argmax(axis=0), -1)
    times = recording.time[np.minimum(last + 1, steps - 1)]
    return np.where(times > recording.time[-1] - 1.0, np.nan, times)


def frames_figure(recording: Recording, world: int, settled: float) -> Figure:
    """Draw the initial, a middle and the final formation, as in figures 7 and 9."""
    figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
    end = len(recording.time) - 1
    middle = int(np.searchsorted(recording.time, (settled if np.isfinite(settled) else 2.0) / 2))
    for axis, instant in zip(axes, (0, middle, end), strict=True):
        _draw_robots(axis, recording, world, instant)
        axis.set_title(f"t = {recording.time[instant]:.1f} s", fontsize=10)
    return figure


def _draw_robots(axis: Axes, recording: Recording, world: int, instant: int) -> None:
    """Draw wafers with a line for the heading; the target is set apart."""
    target, trackers = recording.target[instant, world], recording.trackers[instant, world]
    for number, (x, y, theta) in enumerate(np.vstack([trackers, target])):
        is_target = number == len(trackers)
        colour = "#d1495b" if is_target else "#b8bec6"
        r = recording.radius
        axis.add_patch(mpl.patches.Circle((x, y), r, facecolor=colour, edgecolor="#3c4450"))
        axis.plot([x, x + r * np.cos(theta)], [y, y + r * np.sin(theta)], color="#20242a", lw=1.4)
        label = "target" if is_target else str(number)
        axis.annotate(label, (x, y + 1.4 * r), ha="center", fontsize=7, color="#3c4450")
    centre = target[:2]
    axis.set_xlim(centre[0] - 2.6, centre[0] + 2.6)
    axis.set_ylim(centre[1] - 2.6, centre[1] + 2.6)
    axis.set_aspect("equal")
    axis.tick_params(labelsize=7)
    axis.set_xlabel("x, m", fontsize=8)
    axis.set_ylabel("y, m", fontsize=8)


def curves_figure(recording: Recording, world: int, settled: float, paper: float) -> Figure:
    """Draw position and velocity of every tracker against time, as in figures 8 and 10.

    Upper row relative to the target, which alone can become constant; lower row absolute.
    """
    figure, axes = plt.subplots(2, 3, figsize=(11, 5.6), sharex=True, layout="constrained")
    positions = recording.trackers[:, world]
    target = recording.target[:, world]
    relative = recording.relative[:, world]
    speed = recording.speeds[:, world]
    velocity_x = np.gradient(relative[..., 0], recording.time, axis=0)
    upper = (
        ("x relative to the target, m", relative[..., 0]),
        ("y relative to the target, m", relative[..., 1]),
        ("velocity in x relative to the target, m/s", velocity_x),
    )
    lower = (
        ("x, m", positions[..., 0]),
        ("y, m", positions[..., 1]),
        ("speed V, m/s", speed),
    )
    for axis, (label, values) in zip(axes.flat, (*upper, *lower), strict=True):
        for number in range(values.shape[1]):
            axis.plot(recording.time, values[:, number], lw=1.3, label=f"robot {number}")
        axis.set_ylabel(label, fontsize=8)
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.25)
        axis.axvline(paper, color="#888", ls=":", lw=1)
        if np.isfinite(settled):
            axis.axvline(settled, color="#d1495b", ls="--", lw=1)
    for column in range(2):
        axes[1, column].plot(recording.time, target[:, column], "k--", lw=1, label="target")
    for axis in axes[1]:
        axis.set_xlabel("time, s", fontsize=8)
    axes[0, 0].legend(fontsize=6, ncols=2)
    axes[1, 0].legend(handles=axes[1, 0].lines[-1:], fontsize=6)  # the target
    here = f"dashed red: settled, {settled:.1f} s" if np.isfinite(settled) else "never settled"
    figure.suptitle(f"{here}; dotted: the paper's {paper:g} s", fontsize=9)
    return figure


def summary(experiment: Experiment, times: Floats) -> dict[str, Any]:
    """Return the numbers of an experiment."""
    known = times[np.isfinite(times)]
    quartiles = np.percentile(known, [25, 50, 75]).tolist() if len(known) else [None] * 3
    return {
        "model": experiment.name,
        "policy": experiment.policy,
        "figures": experiment.figures,
        "paper_settling_time": experiment.paper_settling_time,
        "shown_settling_time": None if np.isnan(times[0]) else float(times[0]),
        "settling_time_quartiles": quartiles,
        "settled": len(known),
        "starts": len(times),
    }


def reproduce(settings: Settings) -> list[dict[str, Any]]:
    """Play every experiment, write figures and numbers, and return the numbers."""
    mpl.use("Agg")
    settings.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for experiment in EXPERIMENTS:
        recording = record(experiment, settings.starts, settings.seed)
        times = settling_times(recording, settings.tolerance)
        rows.append(summary(experiment, times))
        for kind, figure in (
            ("frames", frames_figure(recording, 0, times[0])),
            ("curves", curves_figure(recording, 0, times[0], experiment.paper_settling_time)),
        ):
            for suffix in ("png", "svg"):
                path = settings.out / f"{experiment.name}-{kind}.{suffix}"
                figure.savefig(path, dpi=130, metadata={"Date": None} if suffix == "svg" else None)
            plt.close(figure)
    stated = {"seed": settings.seed, "split": "test", "tolerance": settings.tolerance}
    text = json.dumps({**stated, "experiments": rows}, indent=2)
    (settings.out / "settling.json").write_text(text + "\n")
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Redo the paper's experiments and print the settling times beside the paper's."""
    settings = tyro.cli(Settings, prog="posse reproduce", args=arguments)
    rows = reproduce(settings)
    table = Table(title=f"settling time, s: within {settings.tolerance:g} m and 0.1 m/s for good")
    for column in ("model", "policy", "paper", "shown run", "median [quartiles]", "settled"):
        table.add_column(column)
    for row in rows:
        low, middle, high = row["settling_time_quartiles"]
        shown = row["shown_settling_time"]
        table.add_row(
            row["model"],
            row["policy"],
            f"{row['paper_settling_time']:.1f}",
            "-" if shown is None else f"{shown:.1f}",
            "-" if middle is None else f"{middle:.1f} [{low:.1f}, {high:.1f}]",
            f"{row['settled']} of {row['starts']}",
        )
    console = Console()
    console.print(table)
    console.print(f"figures and numbers: {settings.out}")


if __name__ == "__main__":
    main()
