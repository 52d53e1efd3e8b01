"""Parts that several figures share: panels, step functions, legends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_training.reports.pictures.style import WIDTH, in_order, marker_of, style_of
from posse_training.reports.plays import Plays
from posse_training.reports.sweeps import BOUND

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


def steps(axis: Axes, x: Any, y: Any, policy: str, phase: float | None = None) -> None:
    """Draw a step function; with a phase in [0, 1), also markers spread along it."""
    style = style_of(policy)
    axis.step(
        x, y, where="post", zorder=1.5 if policy == BOUND else 2, linestyle=style.line,
        color=style.colour,
    )  # fmt: skip
    if phase is not None:
        at = ((np.arange(_MARKERS) + phase) / _MARKERS * len(x)).astype(int)
        axis.plot(np.asarray(x)[at], np.asarray(y)[at], **{**marker_of(policy), "linestyle": ""})


def legend(figure: Figure, policies: Sequence[str], *, lines: bool = True) -> None:
    """Add a legend above a figure; ``lines``: of lines as well as markers."""
    handles = []
    for policy in policies:
        look = marker_of(policy)
        if policy == BOUND:
            look |= {"marker": ""}
        elif not lines:
            look |= {"linestyle": ""}
        handles.append(Line2D([], [], label=_label(policy), **look))
    longest = max(len(str(handle.get_label())) for handle in handles)
    figure.legend(
        handles=handles, loc="outside upper center", frameon=False,
        ncols=max(1, min(4, len(handles), _LEGEND // (longest + 7))),
        handlelength=2.6, columnspacing=1.6,
    )  # fmt: skip


def _label(policy: str) -> str:
    """Return a policy's label, without what matplotlib would interpret in it."""
    label = _TITLES.get(policy, policy).replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label
