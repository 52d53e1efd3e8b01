"""Makes docs/media/smart.gif, the film of the README.

    python docs/drawing/readme_film.py

The tuned script and the learned team in one world of `smart`, on one scale, and for each the score
of the last second. The world is no extreme: of the first 101, it has the median difference of the
safe scores. The command prints what a caption may say.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from posse_baselines import load
from posse_training.evaluation import evaluate
from posse_training.film import film

OUT: Final = Path(__file__).parents[1] / "media" / "smart.gif"
TEAMS: Final = ("ddcs-tuned", "learned-smart")
SCENARIO: Final = "smart"
SEED, WORLDS = 7, 101


def median_world() -> int:
    """Return the world with the median difference of the teams' safe scores."""
    first, second = (evaluate(name, SCENARIO, WORLDS, SEED, progress=False)["safe_score"] for name in TEAMS)
    for name, scores in zip(TEAMS, (first, second), strict=True):
        print(f"{name}: mean safe score of {WORLDS} worlds {scores.mean():.3f}")
    print(f"{TEAMS[1]} has the higher one in {(second > first).sum()}")
    return int(np.argsort(second - first, kind="stable")[WORLDS // 2])


def main() -> None:
    """Make the film."""
    world = median_world()
    film(
        [(name, load(name)) for name in TEAMS],
        SCENARIO,
        path=OUT,
        seed=SEED,
        world=world,
        start=15.0,
        seconds=20.0,
        speed=2.0,
        every=3,
        size=(600, 290),
        scores=True,
    )
    print(f"{OUT}: world {world}, {OUT.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
