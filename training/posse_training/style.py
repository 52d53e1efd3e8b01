"""What figures share: colours, the look of each policy, notes and legends."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posse_baselines.files import replacing

PAPER: Final = "#ffffff"
INK: Final = "#1a1a1a"
NOTE: Final = "#666666"
GRID: Final = "#e5e5e5"
BAND: Final = "#f6f6f6"
"""Every second row of a figure."""
GREY: Final = "#a3a3a3"
BLUE: Final = "#0072b2"
SKY: Final = "#6aaef5"
GREEN: Final = "#00ae6b"
RED: Final = "#d55e00"
ORANGE: Final = "#ee9600"
PINK: Final = "#b0527f"
PURPLE: Final = "#5a2a80"

BOUND: Final = "bound"
PLANNER: Final = "planner"
WIDTH: Final = 7.2
"""Width of every figure, inches: that of a page of the manual."""
RC: Final[Any] = mpl.rc_params_from_file(str(Path(__file__).with_name("posse.mplstyle")), use_default_template=False)
"""Settings of matplotlib for every figure."""
_LEGEND: Final = 124
"""Characters that fit side by side in a legend; a line and marker count as seven."""


@dataclass(frozen=True)
class Style:
    """Colour, marker and line of a policy."""

    colour: str
    marker: str
    line: Any = "-"

    @property
    def point(self) -> dict[str, Any]:
        """Look of a point and its line, as matplotlib takes it."""
        hollow = self.colour == INK  # the planner's, since it reads the state
        return {
            "color": self.colour,
            "linestyle": self.line,
            "marker": self.marker,
            "markerfacecolor": PAPER if hollow else self.colour,
            "markeredgecolor": self.colour if hollow else PAPER,
            "markeredgewidth": 1.4 if hollow else 0.5,
        }


Looks = Mapping[str, Style]


def looks_of(policies: Iterable[str]) -> Looks:
    """Return the style of each policy, in the order of a legend: planner and bound come last."""
    colours = itertools.cycle((BLUE, RED, GREEN, ORANGE, PURPLE, SKY, PINK, GREY))
    markers = itertools.cycle("osD^vPX<>")
    names = list(dict.fromkeys(policies))
    looks = {name: Style(next(colours), next(markers)) for name in names if name != PLANNER}
    if PLANNER in names:
        looks[PLANNER] = Style(INK, "D", (0, (5, 2)))
    return {**looks, BOUND: Style(INK, "", (0, (1, 1.5)))}


def subplots(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of a size in inches, and its axes."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG to a folder; return the files."""
    files = [folder / f"{name}.png", folder / f"{name}.svg"]
    for path in files:
        with replacing(path) as part:
            figure.savefig(part, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)
    return files


def note(figure: Figure, text: str) -> None:
    """Write what was played below a figure."""
    figure.supxlabel(text, fontsize=8, color=NOTE, x=0.99, ha="right")


def legend(figure: Figure, policies: Sequence[str], looks: Looks) -> None:
    """Add a legend above a figure."""
    handles = [Line2D([], [], label=_label(policy), **looks[policy].point) for policy in policies]
    longest = max(len(str(handle.get_label())) for handle in handles)
    columns = max(1, min(4, len(handles), _LEGEND // (longest + 7)))
    figure.legend(handles=handles, loc="outside upper center", frameon=False, ncols=columns, handlelength=3.2)


def plain(text: str) -> str:
    """Return a text without what matplotlib would interpret in it."""
    return text.replace("$", r"\$")


def _label(policy: str) -> str:
    """Return a policy's label; matplotlib leaves out those that begin with an underscore."""
    label = "planner (reads the state)" if policy == PLANNER else plain(policy)
    return f" {label}" if label.startswith("_") else label
