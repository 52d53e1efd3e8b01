"""The figures of ``posse compare``, as PNG and SVG.

A policy has the same colour and marker in every figure, whoever else is in it. The colours are
Okabe and Ito's, which people with any colour vision tell apart; markers tell policies apart
without them.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_training.reports.contenders import Plays
from posse_training.reports.statistics import Estimate, share
from posse_training.reports.sweeps import BOUND, SWEEPS, Point, Sweep

WIDTH: Final = 7.2
"""Of every figure, inches: as wide as a page of the manual."""
RC: Final[Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.4",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "svg.hashsalt": "posse",  # the same figure is the same file
}


@dataclass(frozen=True)
class Style:
    """How a policy is drawn."""

    colour: str
    marker: str
    line: Any = "-"


_BLACK, _GREY = "#1A1A1A", "#8C8C8C"
_BLUE, _SKY, _GREEN = "#0072B2", "#56B4E9", "#009E73"
_RED, _ORANGE, _PINK, _YELLOW = "#D55E00", "#E69F00", "#CC79A7", "#C9B800"

STYLES: Final[dict[str, Style]] = {
    BOUND: Style(_BLACK, "", (0, (1, 1.5))),
    "oracle": Style(_BLACK, "D", (0, (5, 2))),
    "pngl-l-phi": Style(_PINK, "D"),
    "pngl": Style(_PINK, "d", (0, (3, 1.5))),
    "deviated-pursuit": Style(_PINK, "1", (0, (1, 1))),
    "velocity-pursuit": Style(_PINK, "2", (0, (5, 1, 1, 1))),
    "ddcs-centralized-pursuit": Style(_SKY, "3", (0, (5, 1, 1, 1))),
    "ddcs-distributed": Style(_BLUE, "o"),
    "ddcs-centralized": Style(_SKY, "s"),
    "ddcs-centralized-l-l": Style(_SKY, "8"),
    "ddcs-centralized-no-exchange": Style(_SKY, "p", (0, (3, 1.5))),
    "ddcs-no-radio": Style(_BLUE, "h", (0, (3, 1.5))),
    "pursuit": Style(_GREY, "v"),
    "idle": Style(_GREY, "_"),
    "random": Style(_GREY, "x"),
    "learned-smart": Style(_RED, "^"),
    "learned-radio": Style(_ORANGE, "P"),
    "learned-obstacles": Style(_GREEN, "X"),
    "learned-field": Style(_PINK, "<"),
    "learned-generalist": Style(_YELLOW, "*"),
}
_OTHERS: Final = tuple(
    Style(colour, marker)
    for marker in ("H", ">", "8")
    for colour in (_RED, _GREEN, _ORANGE, _PINK, _YELLOW)
)
"""For policies that are not known by name, found by their names."""


def style_of(policy: str) -> Style:
    """Return how a policy is drawn: a function of its name alone."""
    if policy in STYLES:
        return STYLES[policy]
    return _OTHERS[zlib.crc32(policy.encode()) % len(_OTHERS)]


def draw(
    folder: Path,
    plays: Mapping[tuple[str, str], Plays],
    points: Sequence[Point],
    losses: Sequence[Plays],
) -> list[Path]:
    """Draw every figure that there is something for; return the files.

    Args:
        folder: Where to write.
        plays: What was played, by scenario and policy.
        points: Of the sweeps.
        losses: Of the scenario in which the leader breaks.
    """
    with mpl.rc_context(RC):
        drawn: dict[str, Figure] = {}
        if plays:
            drawn["profile"] = profile(plays)
            drawn["scenarios"] = scores(plays)
        for sweep in SWEEPS:
            mine = [point for point in points if point.sweep == sweep.name]
            if mine:
                drawn[sweep.name] = sweep_figure(sweep, mine)
        if losses:
            drawn["recovery"] = recovery(losses)
        files = []
        for name, figure in drawn.items():
            for suffix in (".png", ".svg"):
                path = folder / f"{name}{suffix}"
                dated = {"Date": None} if suffix == ".svg" else None
                figure.savefig(path, dpi=160, metadata=dated)
                files.append(path)
        return files


def profile(plays: Mapping[tuple[str, str], Plays]) -> Figure:
    """Draw the share of worlds with at least a score, a panel for each scenario."""
    names, policies = _names(plays)
    columns = 4 if len(names) > 6 else min(3, len(names))
    rows = -(-len(names) // columns)
    figure, axes = _panels(rows, columns, 0.75 + 1.6 * rows)
    scores = np.linspace(0, 1, 401)
    for axis, name in zip(axes, names, strict=False):
        axis.set_title(name, fontweight="bold")
        for k, policy in enumerate(policies):
            if (name, policy) not in plays:
                continue
            mine = plays[name, policy]["score"]
            _steps(axis, scores, _at_least(mine, scores), policy, (k + 0.5) / len(policies))
            if policy == _reference(policies):
                _steps(axis, scores, _at_least(plays[name, policy]["bound"], scores), BOUND)
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
        axis.set_xticks((0, 0.5, 1), ("0", "0.5", "1"))
        axis.set_yticks((0, 0.5, 1), ("0", "0.5", "1"))
    for k, axis in enumerate(axes):
        axis.set_visible(k < len(names))
        axis.label_outer()
        if k < len(names) and k + columns >= len(names):
            axis.tick_params(labelbottom=True)
    figure.supxlabel("score τ", fontsize=9)
    figure.supylabel("share of worlds with τ or more", fontsize=9)
    _legend(figure, [*policies, BOUND])
    return figure


def _at_least(values: Any, scores: Any) -> Any:
    """Return the share of values (S, W) that are at least each score."""
    ordered = np.sort(values.reshape(-1))
    return 1 - np.searchsorted(ordered, scores, side="left") / len(ordered)


def scores(plays: Mapping[tuple[str, str], Plays]) -> Figure:
    """Draw the mean score of every policy on every scenario, with its interval."""
    names, policies = _names(plays)
    figure, (axis,) = _panels(1, 1, 0.9 + len(names) * (0.2 + 0.11 * len(policies)))
    apart = 0.8 / max(len(policies), 1)
    for row, name in enumerate(names):
        if row % 2:
            axis.axhspan(row - 0.5, row + 0.5, color="0.965", zorder=0, linewidth=0)
        for k, policy in enumerate(policies):
            if (name, policy) not in plays:
                continue
            found, style = plays[name, policy], style_of(policy)
            score = found.mean("score")
            y = row + (k - (len(policies) - 1) / 2) * apart
            axis.plot([score.low, score.high], [y, y], color=style.colour, linewidth=1.4)
            axis.plot(score.value, y, **_marker(policy))
            if policy == _reference(policies):
                bound = found.mean("bound").value
                axis.plot(
                    [bound, bound], [row - 0.42, row + 0.42], color=_BLACK,
                    linestyle=STYLES[BOUND].line, linewidth=1.6,
                )  # fmt: skip
    axis.set_yticks(range(len(names)), names)
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False, axis="y")
    axis.set(ylim=(len(names) - 0.5, -0.5), xlim=(0, 1), xlabel="mean score, 95 % interval")
    _legend(figure, [*policies, BOUND], lines=False)
    return figure


def sweep_figure(sweep: Sweep, points: Sequence[Point]) -> Figure:
    """Draw the mean score of every policy against a setting, with its interval."""
    figure, (axis,) = _panels(1, 1, 3.6)
    policies = _in_order({point.policy for point in points})
    axis.axvline(sweep.own, color="0.75", linewidth=5, zorder=0)
    for policy in policies:
        mine = sorted((p for p in points if p.policy == policy), key=lambda p: p.value)
        style = style_of(policy)
        x = [p.value for p in mine]
        axis.plot(
            x, [p.score.value for p in mine], color=style.colour, linestyle=style.line,
            zorder=2 + (policy != BOUND),
        )  # fmt: skip
        if policy == BOUND:
            continue
        axis.vlines(
            x, [p.score.low for p in mine], [p.score.high for p in mine],
            color=style.colour, linewidth=1.4,
        )  # fmt: skip
        axis.plot(x, [p.score.value for p in mine], **{**_marker(policy), "linestyle": ""})
    axis.set(
        ylim=(0, 1), xticks=sweep.values, xlabel=sweep.label,
        ylabel=f"mean score on {sweep.scenario}",
    )  # fmt: skip
    axis.annotate(
        f"as in {sweep.scenario}", (sweep.own, 1), (0, 3), textcoords="offset points",
        color="0.45", fontsize=8, ha="center",
    )  # fmt: skip
    _legend(figure, policies)
    return figure


def recovery(losses: Sequence[Plays]) -> Figure:
    """Draw the share of teams that have settled anew by a time after their leader broke."""
    figure, (axis,) = _panels(1, 1, 3.4)
    scenario = losses[0].scenario
    # Later than this, an episode may have ended before a recovery could show.
    latest = scenario.duration * (1 - scenario.break_window[1]) - scenario.settle_time
    times = np.arange(0, latest + 1e-9, scenario.control_step)
    policies = _in_order({plays.label for plays in losses})
    for plays in sorted(losses, key=lambda plays: policies.index(plays.label)):
        bands = [_recovered(plays, time) for time in times]
        style = style_of(plays.label)
        axis.fill_between(
            times, [b.low for b in bands], [b.high for b in bands], step="post",
            color=style.colour, alpha=0.15, linewidth=0,
        )  # fmt: skip
        phase = (policies.index(plays.label) + 0.5) / len(policies)
        _steps(axis, times, [b.value for b in bands], plays.label, phase)
    axis.set(
        xlim=(0, latest), ylim=(-0.02, 1.02), xlabel="time since the loss, s",
        ylabel="share of teams that have settled anew",
    )  # fmt: skip
    _legend(figure, policies)
    return figure


def _recovered(plays: Plays, time: float) -> Estimate:
    """Return the share of teams that have settled anew by a time after the loss.

    The interval is Wilson's; of several training seeds, it goes from the lowest to the highest.
    """
    by_then = plays["recovery_time"] <= time + 1e-9  # never is nan, which is not
    if len(by_then) == 1:
        return share(by_then)
    shares = by_then.mean(axis=1)
    return Estimate(shares.mean(), shares.min(), shares.max(), by_then.size)


# --- parts of a figure ---------------------------------------------------------------------------


def _panels(rows: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    return figure, list(axes.flat)


def _names(plays: Mapping[tuple[str, str], Plays]) -> tuple[list[str], list[str]]:
    """Return the scenarios in the order of play, and the policies in the order of the styles."""
    return list(dict.fromkeys(name for name, _ in plays)), _in_order({p for _, p in plays})


def _in_order(policies: set[str]) -> list[str]:
    """Return policies as a legend lists them: learned ones, scripted ones, references."""
    known = list(STYLES)

    def place(policy: str) -> tuple[int, int, str]:
        if policy in (BOUND, "oracle"):
            return (2, -known.index(policy), policy)
        if policy not in known or policy.startswith("learned-"):
            return (0, known.index(policy) if policy in known else len(known), policy)
        return (1, known.index(policy), policy)

    return sorted(policies, key=place)


def _reference(policies: Sequence[str]) -> str:
    """Return whose worlds the bound is taken from."""
    return "oracle" if "oracle" in policies else policies[0]


def _marker(policy: str) -> dict[str, Any]:
    """Return how a point is drawn; the oracle's is hollow, for it does not play by the rules."""
    style = style_of(policy)
    return {
        "marker": style.marker,
        "color": style.colour,
        "markerfacecolor": "white" if policy == "oracle" else style.colour,
        "markeredgecolor": style.colour if policy == "oracle" or style.marker in "x_" else "white",
        "markeredgewidth": 1.2 if policy == "oracle" or style.marker in "x_" else 0.5,
        "markersize": 7 if style.marker in "*PX^v<>" else 5.5,
        "linestyle": style.line,
    }


def _steps(axis: Axes, x: Any, y: Any, policy: str, phase: float | None = None) -> None:
    """Draw a function of steps, with markers spread along it if there is a phase for them."""
    style = style_of(policy)
    axis.step(
        x, y, where="post", zorder=1.5 if policy == BOUND else 2, linestyle=style.line,
        color=style.colour,
    )  # fmt: skip
    if phase is not None:
        at = ((np.arange(_MARKERS) + phase) / _MARKERS * len(x)).astype(int)
        axis.plot(np.asarray(x)[at], np.asarray(y)[at], **{**_marker(policy), "linestyle": ""})


_MARKERS: Final = 6
_LEGEND: Final = 124
"""Letters that have room side by side in a legend, the lines before them counted as seven each."""
_TITLES: Final = {BOUND: "attainable bound", "oracle": "oracle (reads the state)"}


def _legend(figure: Figure, policies: Sequence[str], *, lines: bool = True) -> None:
    handles = []
    for policy in policies:
        look = _marker(policy)
        if policy == BOUND:
            look |= {"marker": ""}
        elif not lines:
            look |= {"linestyle": ""}
        handles.append(Line2D([], [], label=_TITLES.get(policy, policy), **look))
    longest = max(len(str(handle.get_label())) for handle in handles)
    figure.legend(
        handles=handles, loc="outside upper center", frameon=False,
        ncols=max(1, min(4, len(handles), _LEGEND // (longest + 7))),
        handlelength=2.6, columnspacing=1.6,
    )  # fmt: skip
