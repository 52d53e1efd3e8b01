"""The cross-play matrix as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from posse import get_scenario
from posse_training.league.cross_play import TEST_SEED
from posse_training.league.results import League
from posse_training.reports.pictures.style import RC, WIDTH, note, plain

NAME: Final = "matrix"
_ROW: Final = 0.42  # inches
_LIGHT: Final = 0.55  # scores below are written in white
_META: Final = {"Date": None}


def draw_matrix(found: League) -> list[Path]:
    """Write the matrix of scores as PNG and SVG to the league's folder; return the files."""
    teams, targets = [t.label for t in found.teams], [t.label for t in found.targets]
    scores = np.array([[found.at(a, b).score.value for b in targets] for a in teams])
    with mpl.rc_context({**RC, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH, 1.4 + _ROW * len(teams)), layout="constrained")
        axis = figure.subplots()
        image = axis.imshow(scores, vmin=0, vmax=1, cmap="cividis", aspect="auto")
        axis.set_xticks(range(len(targets)), targets, rotation=35, ha="right")
        axis.set_yticks(range(len(teams)), teams)
        axis.set_xlabel("target")
        axis.set_ylabel("team")
        for i, team in enumerate(teams):
            for j, target in enumerate(targets):
                s = found.at(team, target).score
                colour = "white" if s.value < _LIGHT else "black"
                axis.text(
                    j,
                    i,
                    f"{s.value:.2f}\n±{(s.high - s.low) / 2:.2f}",
                    ha="center",
                    va="center",
                    color=colour,
                    fontsize=7,
                )
        figure.colorbar(image, label="score of the team", shrink=0.8)
        note(figure, _played(found))
        files = [found.settings.path / f"{NAME}.{suffix}" for suffix in ("png", "svg")]
        figure.savefig(files[0], dpi=150)
        figure.savefig(files[1], metadata=_META)
    return files


def _played(found: League) -> str:
    settings = found.settings
    scenario = get_scenario(settings.scenario)
    changed = "".join(f", {name}={value}" for name, value in settings.overrides.items())
    return plain(
        f"{scenario.name} v{scenario.version}{changed}: {settings.episodes:,} worlds a pair, "
        f"test split, seed {TEST_SEED}; training seed {settings.seed}"
    )
