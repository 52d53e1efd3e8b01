"""The table and the learning curves of docs/algorithms.md, from the results that are kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from posse_training.reports.pictures.palette import BLUE, GREY, ORANGE, PURPLE, RED, SKY
from posse_training.reports.pictures.parts import legend, note
from posse_training.reports.pictures.style import RC, WIDTH, Style, marker_of
from posse_training.reports.statistics import mean
from posse_training.runs.defaults import default_settings

ROOT: Final = Path(__file__).parents[1]
RESULTS: Final = ROOT / "benchmarks" / "algorithms"
TEMPLATE: Final = ROOT / "benchmarks" / "algorithms_page.md"
PAGE: Final = ROOT / "docs" / "algorithms.md"
FIGURE: Final = ROOT / "docs" / "media" / "algorithms.svg"
MARK: Final = "<!-- table -->"
COLUMNS: Final = (
    "scenario",
    "algorithm",
    "steps",
    "seeds",
    "safe score [least, greatest seed]",
    "worlds with contact",
    "area under the curve",
    "steps/s",
)
LOOKS: Final = {
    "ppo": Style(BLUE, "o"),
    "mappo": Style(SKY, "s", (0, (5, 2))),
    "ppo-imitation": Style(ORANGE, "D", (0, (3, 1.5))),
    "sac": Style(RED, "v"),
    "qmix": Style(GREY, "P", (0, (1, 1))),
    "td3": Style(PURPLE, "X", (0, (5, 1, 1, 1))),
}
"""Each algorithm in a colour of its own."""

Run = dict[str, Any]


def area(run: Run) -> float:
    """Return the mean height of a run's learning curve over its steps."""
    steps = [0.0, *(point["steps"] for point in run["curve"])]
    scores = [0.0, *(point["safe_score"] for point in run["curve"])]
    return float(np.trapezoid(scores, steps) / steps[-1])


def rate(run: Run) -> float:
    """Return training steps per second, evaluations included."""
    last = run["curve"][-1]
    return float(last["steps"] / last["seconds"])


def row(runs: Sequence[Run]) -> str:
    """Return the row of one algorithm on one scenario."""
    first = runs[0]
    scores = [run["test"]["safe_score"]["value"] for run in runs]
    whole = mean(scores)
    spread = f"[{min(scores):.3f}, {max(scores):.3f}]" if len(scores) > 1 else ""
    contact = 1 - float(np.mean([run["test"]["contact_free"] for run in runs]))
    return (
        f"| `{first['scenario']}` | {first['algorithm']} | {first['steps'] / 1e6:.0f} M "
        f"| {len(runs)} | {whole.value:.3f} {spread} | {contact:.1%} "
        f"| {np.mean([area(run) for run in runs]):.3f} "
        f"| {np.mean([rate(run) for run in runs]):,.0f} |"
    )


def grouped(runs: Sequence[Run]) -> dict[tuple[str, str], list[Run]]:
    """Return the runs of each scenario and algorithm, best first."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run["scenario"], run["algorithm"]), []).append(run)
    order = list(dict.fromkeys(run["scenario"] for run in runs))

    def place(item: tuple[tuple[str, str], list[Run]]) -> tuple[int, float]:
        (scenario, _), members = item
        return order.index(scenario), -mean([m["test"]["safe_score"]["value"] for m in members]).value

    return dict(sorted(groups.items(), key=place))


def draw(groups: dict[tuple[str, str], list[Run]]) -> None:
    """Draw the curves over steps and over time: mean of the seeds, and their range."""
    scenarios = list(dict.fromkeys(scenario for scenario, _ in groups))
    algorithms = sorted({algorithm for _, algorithm in groups})
    looks = {algorithm: LOOKS[algorithm] for algorithm in algorithms}
    figure = Figure(figsize=(WIDTH, 1.2 + 2.2 * len(scenarios)), layout="constrained")
    axes = list(figure.subplots(len(scenarios), 2, squeeze=False, sharey="row").flat)
    for (scenario, algorithm), runs in groups.items():
        k = 2 * scenarios.index(scenario)
        for axis, measure, scale in ((axes[k], "steps", 1e6), (axes[k + 1], "seconds", 60.0)):
            band(axis, runs, measure, scale, marker_of(algorithm, looks[algorithm]))
        axes[k].set_title(f"{scenario} v{runs[0]['version']}", loc="left")
        axes[k].set(ylabel="validation safe score", xlabel="steps, millions")
        axes[k + 1].set(xlabel="time, min")
        axes[k].set_xscale("log")
        axes[k + 1].set_xscale("log")
    counts = [len(runs) for runs in groups.values()]
    most = "" if min(counts) == max(counts) else f" to {max(counts)}"
    seeds = f"{min(counts)}{most} training seeds; band: their range"
    worlds = default_settings(own=False).evaluate_worlds
    note(figure, f"{worlds:,} worlds of the validation split; {seeds}")
    legend(figure, algorithms, looks)
    figure.savefig(FIGURE, metadata={"Date": None})


def band(axis: Axes, runs: Sequence[Run], measure: str, scale: float, look: Any) -> None:
    """Draw the mean of several curves and their range."""
    points = min(len(run["curve"]) for run in runs)
    x = np.mean([[p[measure] for p in run["curve"][:points]] for run in runs], axis=0) / scale
    y = np.array([[p["safe_score"] for p in run["curve"][:points]] for run in runs])
    axis.fill_between(x, y.min(0), y.max(0), color=look["color"], alpha=0.15, linewidth=0)
    axis.plot(x, y.mean(0), **{**look, "markevery": 4})


def write_page(console: Console) -> None:
    """Write the page from its template, and the figure; mkdocs.yml has to list a new page."""
    runs = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(RESULTS.glob("*.json"))]
    if not runs:
        console.print(f"no results in {RESULTS}")
        return
    groups = grouped(runs)
    lines = [
        f"| {' | '.join(COLUMNS)} |",
        "|---|---|---:|---:|---|---:|---:|---:|",
        *(row(members) for members in groups.values()),
    ]
    with mpl.rc_context(RC):
        draw(groups)
    text = TEMPLATE.read_text(encoding="utf-8").replace(MARK, "\n".join(lines))
    PAGE.write_text(text, encoding="utf-8")
    console.print(f"{PAGE} and {FIGURE} written from {len(runs)} runs")
