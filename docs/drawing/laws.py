"""Draws docs/media/law-*.svg: the geometry of each law, and a team that plays it.

    python docs/drawing/laws.py

The middle shows 10 s of one world of `accelerating` with starts 2 to 4 m from the target, the right
how far each tracker is from the nearest slot or, in velocity pursuit, which has none, the target.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import geometry
import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import posse
from posse_baselines import Trajectory
from posse_training.reproduce.figures import TARGET, draw_robots, finish, look_of, robot_lines
from posse_training.reproduce.runs import played, relative, run_of, slot_error, times
from posse_training.style import RC

MEDIA: Final = Path(__file__).parents[1] / "media"
SEED: Final = 7
SECONDS: Final = 10.0


@dataclass(frozen=True)
class Law:
    """A law, a policy that plays it, its geometry, and whether it keeps a slot or a range."""

    name: str
    policy: str
    geometry: Callable[[Axes], None]
    keeps: str


LAWS: Final = (
    Law("velocity-pursuit", "velocity-pursuit", geometry.pursuit, "range"),
    Law("deviated-pursuit", "deviated-pursuit", lambda axes: geometry.pursuit(axes, deviated=True), "slot"),
    Law("pngl", "pngl", geometry.navigation, "slot"),
    Law("l-phi", "pngl-l-phi", geometry.l_phi, "slot"),
    Law("slot", "ddcs-distributed", geometry.slot_law, "slot"),
)


def draw(law: Law) -> Figure:
    """Draw a law."""
    scenario = posse.get_scenario("accelerating", horizon=round(SECONDS / 0.1), start_distance=(2.0, 4.0))
    run = run_of(law.policy, scenario, 1, SEED)
    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(10, 3.7), layout="constrained", width_ratios=(1.0, 1.15, 1.0)
    )
    law.geometry(left)
    _tracks(middle, run)
    _kept(right, run, law.keeps)
    middle.set_title(f"{law.policy}, {SECONDS:g} s", loc="left")
    handles = [*robot_lines(scenario.num_trackers, "tracker"), Line2D([], [], color=TARGET, lw=1.0, label="target")]
    return finish(figure, handles, 6, f"world 0 of {played(scenario, SEED)}; starts 2 to 4 m from the target")


def _tracks(axes: Axes, run: Trajectory) -> None:
    draw_robots(axes, run, run.steps)
    points = np.vstack([run["tracker_pose"][:, 0, :, :2].reshape(-1, 2), run["target_pose"][:, 0, :2]])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    reach = 0.4 + float(np.abs(points - middle).max())
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach, middle[1] + reach)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def _kept(axes: Axes, run: Trajectory, keeps: str) -> None:
    for number in range(run.scenario.num_trackers):
        if keeps == "range":
            values = np.linalg.norm(relative(run)[:, 0, number], axis=-1)
        else:
            values = slot_error(run)[:, 0, number]
        axes.plot(times(run), values, lw=1.3, **look_of(number))
    axes.set_ylim(0.0, None)
    axes.set_xlabel("time, s")
    axes.set_ylabel("range r, m" if keeps == "range" else "from the nearest slot, m")


def main() -> None:
    """Draw all laws."""
    mpl.use("Agg")
    for law in LAWS:
        # Text stays text, and equal sources give equal files.
        with mpl.rc_context({**RC, "svg.fonttype": "none"}):
            figure = draw(law)
            figure.savefig(MEDIA / f"law-{law.name}.svg", metadata={"Date": None})
            plt.close(figure)


if __name__ == "__main__":
    main()
