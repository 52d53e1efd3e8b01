"""Draws docs/media/tasks.svg: the tasks of the DDCS and what changes them.

python docs/drawing/tasks.py
"""

from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

MEDIA: Final = Path(__file__).parents[1] / "media"
PLACES: Final = {"searching": (0.0, 0.0), "converging": (4.6, 1.8), "flocking": (4.6, -1.8), "exchange": (9.2, 0.0)}
STAGES: Final = ("converging", "flocking")
ARROWS: Final = (  # from, to, bend, why, where that is written
    ("searching", "converging", -0.12, "target seen\nor reported", (1.75, 1.75)),
    ("searching", "flocking", 0.12, "the same,\nalready in place", (1.65, -1.75)),
    ("converging", "flocking", 0.22, "distance to place\nbelow near", (3.1, 0.0)),
    ("flocking", "converging", 0.22, "distance\nabove far", (5.95, 0.0)),
    ("converging", "exchange", -0.25, "leader changed", (8.0, 2.0)),
    ("flocking", "exchange", 0.25, "leader changed", (8.0, -2.0)),
    ("exchange", "converging", -0.12, "new leader heard:\nplace far, or near", (7.2, 0.0)),
    ("exchange", "flocking", 0.12, "", (0.0, 0.0)),
)


def draw() -> None:
    """Draw the picture."""
    mpl.use("Agg")
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "posse"}):
        figure, axes = plt.subplots(figsize=(9.6, 4.4))
        for name, (x, y) in PLACES.items():
            axes.add_patch(
                FancyBboxPatch(
                    (x - 0.85, y - 0.3), 1.7, 0.6, boxstyle="round,pad=0.1", fc="#e3edf5", ec="#334455", zorder=3
                )
            )
            axes.text(x, y, name, ha="center", va="center", fontweight="bold", zorder=4)
        for start, end, bend, why, at in ARROWS:
            axes.add_patch(
                FancyArrowPatch(
                    PLACES[start],
                    PLACES[end],
                    connectionstyle=f"arc3,rad={bend}",
                    arrowstyle="-|>",
                    mutation_scale=14,
                    color="#334455",
                    shrinkA=34 if {start, end} == set(STAGES) else 62,
                    shrinkB=34 if {start, end} == set(STAGES) else 62,
                )
            )
            axes.text(*at, why, ha="center", va="center", fontsize=9)
        axes.text(
            4.6,
            -3.1,
            "converging, flocking, leader exchange → searching: no fix of the target for 10 s",
            ha="center",
            fontsize=9,
        )
        axes.set_xlim(-1.2, 10.4)
        axes.set_ylim(-3.3, 2.6)
        axes.axis("off")
        figure.tight_layout()
        figure.savefig(MEDIA / "tasks.svg", metadata={"Date": None})


if __name__ == "__main__":
    draw()
