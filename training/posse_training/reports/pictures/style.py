"""The colours, markers and lines of policies in figures.

A policy that ships looks the same in every figure, and any other one in every figure of a
comparison. No two policies of a figure have the same marker, so that they can be told apart without
colour.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from posse_training.reports.comparing.sweeps import BOUND
from posse_training.reports.pictures.palette import (
    BLUE,
    GREEN,
    GREY,
    GRID,
    INK,
    NOTE,
    ORANGE,
    PAPER,
    PINK,
    PURPLE,
    RED,
    SKY,
)

WIDTH: Final = 7.2
"""Width of every figure, inches: that of a page of the manual."""
RC: Final[Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": NOTE,
    "axes.facecolor": PAPER,
    "figure.facecolor": PAPER,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "posse",  # equal figures give equal files
}
_SOLID, _DASHED, _DOTTED = "-", (0, (5, 2)), (0, (1, 1.5))
_SHORT, _DASH_DOT = (0, (3, 1.5)), (0, (5, 1, 1, 1))
_OPEN: Final = frozenset([*"1234x_+|", (6, 2, 0)])
"""Markers that are strokes without an area."""
_SMALL: Final = frozenset("odDshHp8")
"""Markers that fill their square."""


@dataclass(frozen=True)
class Style:
    """Colour, marker and line of a policy."""

    colour: str
    marker: str | tuple[int, int, int]
    line: Any = _SOLID


STYLES: Final[dict[str, Style]] = {
    BOUND: Style(INK, "", _DOTTED),
    "planner": Style(INK, "D", _DASHED),
    "pngl-l-phi": Style(PINK, "d"),
    "pngl-l-phi-tuned": Style(PINK, "8", _DASHED),
    "pngl": Style(PINK, "1", _SHORT),
    "deviated-pursuit": Style(PINK, "2", _DOTTED),
    "velocity-pursuit": Style(PINK, "3", _DASH_DOT),
    "ddcs-distributed": Style(BLUE, "o"),
    "ddcs-tuned": Style(BLUE, "s", _DASHED),
    "ddcs-no-radio": Style(BLUE, "h", _SHORT),
    "ddcs-centralized": Style(SKY, "H"),
    "ddcs-centralized-l-l": Style(SKY, "4", _DASHED),
    "ddcs-centralized-no-exchange": Style(SKY, "p", _SHORT),
    "ddcs-centralized-pursuit": Style(SKY, "+", _DASH_DOT),
    "pursuit": Style(GREY, "v"),
    "idle": Style(GREY, "_", _DASHED),
    "random": Style(GREY, "x", _DOTTED),
    "learned-smart": Style(RED, "^"),
    "learned-radio": Style(ORANGE, "P"),
    "learned-obstacles": Style(GREEN, "X"),
    "learned-field": Style(PURPLE, "<"),
    "learned-search": Style(PURPLE, (6, 1, 0), _DASHED),
    "learned-leader-loss": Style(GREEN, (3, 1, 0)),
    "learned-duel": Style(ORANGE, (8, 1, 0), _DASHED),
    "learned-generalist": Style(RED, "*", _DASHED),
}
_OTHERS: Final = tuple(
    Style(colour, marker, line)
    for marker, line in (
        (">", _SOLID),
        ((4, 1, 0), _DASHED),
        ((6, 2, 0), _SHORT),
        ((7, 1, 0), _DASH_DOT),
        ("|", _SOLID),
        ((5, 0, 180), _DASHED),
        ((4, 1, 45), _SHORT),
        (".", _DOTTED),
    )
    for colour in (RED, GREEN, ORANGE, PURPLE)
)
"""Styles of all other policies."""

Looks = Mapping[str, Style]


def looks_of(policies: Iterable[str]) -> Looks:
    """Return the style of each policy of a comparison, by name.

    Policies that do not ship get one that depends on their name, unless another has its marker.
    With more than eight of them, markers repeat, in another colour.
    """
    looks = {BOUND: STYLES[BOUND]}
    for policy in sorted(set(policies)):
        looks[policy] = STYLES[policy] if policy in STYLES else _free(policy, looks.values())
    return looks


def _free(policy: str, taken: Collection[Style]) -> Style:
    """Return a style for a policy whose marker no other has; if there is none, a free style."""
    first = zlib.crc32(policy.encode()) % len(_OTHERS)
    candidates = [*_OTHERS[first:], *_OTHERS[:first]]
    markers = {style.marker for style in taken}
    for style in candidates:
        if style.marker not in markers:
            return style
    return next((style for style in candidates if style not in taken), candidates[0])


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


def marker_of(policy: str, style: Style) -> dict[str, Any]:
    """Return the look of a point; the planner's is hollow, since it reads the state."""
    hollow, stroked = policy == "planner", style.marker in _OPEN
    return {
        "marker": style.marker,
        "color": style.colour,
        "markerfacecolor": PAPER if hollow else style.colour,
        "markeredgecolor": style.colour if hollow or stroked else PAPER,
        "markeredgewidth": 1.4 if hollow or stroked else 0.5,
        "markersize": 5.5 if style.marker in _SMALL else 7,
        "linestyle": style.line,
    }
