"""The colours and markers of policies in figures.

A policy looks the same in every figure, whichever others are in it. The colours are those of Okabe
and Ito, which are distinct for all kinds of colour vision; markers distinguish policies without
colour.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from posse_training.reports.sweeps import BOUND

WIDTH: Final = 7.2
"""Width of every figure, inches: that of a page of the manual."""
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
    "svg.hashsalt": "posse",  # equal figures give equal files
}


@dataclass(frozen=True)
class Style:
    """Colour, marker and line of a policy."""

    colour: str
    marker: str
    line: Any = "-"


BLACK, _GREY = "#1A1A1A", "#8C8C8C"
_BLUE, _SKY, _GREEN = "#0072B2", "#56B4E9", "#009E73"
_RED, _ORANGE, _PINK, _YELLOW = "#D55E00", "#E69F00", "#CC79A7", "#C9B800"

STYLES: Final[dict[str, Style]] = {
    BOUND: Style(BLACK, "", (0, (1, 1.5))),
    "planner": Style(BLACK, "D", (0, (5, 2))),
    "pngl-l-phi": Style(_PINK, "D"),
    "pngl": Style(_PINK, "d", (0, (3, 1.5))),
    "deviated-pursuit": Style(_PINK, "1", (0, (1, 1))),
    "velocity-pursuit": Style(_PINK, "2", (0, (5, 1, 1, 1))),
    "ddcs-centralized-pursuit": Style(_SKY, "3", (0, (5, 1, 1, 1))),
    "ddcs-distributed": Style(_BLUE, "o"),
    "ddcs-tuned": Style(_BLUE, "s"),
    "pngl-l-phi-tuned": Style(_PINK, "p"),
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
"""Styles of all other policies, chosen by a hash of the name."""


def style_of(policy: str) -> Style:
    """Return the style of a policy, which depends on its name only."""
    if policy in STYLES:
        return STYLES[policy]
    return _OTHERS[zlib.crc32(policy.encode()) % len(_OTHERS)]


def in_order(policies: set[str]) -> list[str]:
    """Return policies in the order of a legend: learned ones, scripted ones, references."""
    known = list(STYLES)

    def place(policy: str) -> tuple[int, int, str]:
        if policy in (BOUND, "planner"):
            return (2, -known.index(policy), policy)
        if policy not in known or policy.startswith("learned-"):
            return (0, known.index(policy) if policy in known else len(known), policy)
        return (1, known.index(policy), policy)

    return sorted(policies, key=place)


def reference_of(policies: Sequence[str]) -> str:
    """Return the policy whose worlds the bound is taken from."""
    return "planner" if "planner" in policies else policies[0]


def marker_of(policy: str) -> dict[str, Any]:
    """Return the look of a point; the planner's is hollow, since it reads the state."""
    style = style_of(policy)
    return {
        "marker": style.marker,
        "color": style.colour,
        "markerfacecolor": "white" if policy == "planner" else style.colour,
        "markeredgecolor": style.colour if policy == "planner" or style.marker in "x_" else "white",
        "markeredgewidth": 1.2 if policy == "planner" or style.marker in "x_" else 0.5,
        "markersize": 7 if style.marker in "*PX^v<>" else 5.5,
        "linestyle": style.line,
    }
