"""Parts that several figures share: panels, step functions, legends, what was played."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.sweeps import BOUND
from posse_training.reports.pictures.palette import NOTE
from posse_training.reports.pictures.style import WIDTH, Looks, in_order, marker_of

_MARKERS: Final = 6
_LEGEND: Final = 124
"""Characters that fit side by side in a legend; a line and marker count as seven."""
_TITLES: Final = {"planner": "planner (reads the state)"}


def panels(rows: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of a height in inches, and its axes row by row."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    return figure, list(axes.flat)


def names_of(plays: Mapping[tuple[str, str], Plays]) -> tuple[list[str], list[str]]:
    """Return the scenarios in the order of play, and the policies in the order of a legend."""
    return list(dict.fromkeys(name for name, _ in plays)), in_order({p for _, p in plays})


def versions_of(plays: Mapping[tuple[str, str], Plays]) -> dict[str, str]:
    """Return every scenario's name with its version."""
    return {name: f"{plain(name)} v{found.scenario.version}" for (name, _), found in plays.items()}


def facts_of(plays: Sequence[Plays]) -> str:
    """Return the number of worlds, with the policies that played another one, split and seed."""
    counts = {found.label: found.results[0].episodes for found in plays}
    ((usual, _),) = Counter(counts.values()).most_common(1)
    other = ", ".join(f"{plain(label)} {n:,}" for label, n in counts.items() if n != usual)
    first = plays[0].results[0]
    return f"{usual:,} worlds{f' ({other})' if other else ''}, {first.split} split, seed {first.seed}"


def note(figure: Figure, text: str) -> None:
    """Write what was played below a figure."""
    figure.supxlabel(text, fontsize=8, color=NOTE, x=0.99, ha="right")


def steps(axis: Axes, x: Any, y: Any, policy: str, looks: Looks, phase: float | None = None) -> None:
    """Draw a step function; with a phase in [0, 1), also markers spread along it."""
    style = looks[policy]
    axis.step(x, y, where="post", zorder=1.5 if policy == BOUND else 2, linestyle=style.line, color=style.colour)
    if phase is not None:
        at = ((np.arange(_MARKERS) + phase) / _MARKERS * len(x)).astype(int)
        look = marker_of(policy, style) | {"linestyle": ""}
        axis.plot(np.asarray(x)[at], np.asarray(y)[at], **look)


def legend(figure: Figure, policies: Sequence[str], looks: Looks, *, lines: bool = True) -> None:
    """Add a legend above a figure; ``lines``: of lines as well as markers."""
    handles = []
    for policy in policies:
        look = marker_of(policy, looks[policy])
        if policy == BOUND:
            look |= {"marker": ""}
        elif not lines:
            look |= {"linestyle": ""}
        handles.append(Line2D([], [], label=_label(policy), **look))
    longest = max(len(str(handle.get_label())) for handle in handles)
    figure.legend(
        handles=handles,
        loc="outside upper center",
        frameon=False,
        ncols=max(1, min(4, len(handles), _LEGEND // (longest + 7))),
        handlelength=3.2,
        columnspacing=1.6,
    )


def plain(text: str) -> str:
    """Return a text without what matplotlib would interpret in it."""
    return text.replace("$", r"\$")


def _label(policy: str) -> str:
    """Return a policy's label; matplotlib leaves out those that begin with an underscore."""
    label = plain(_TITLES.get(policy, policy))
    return f" {label}" if label.startswith("_") else label
