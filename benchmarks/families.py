"""Teams inside and outside of the ranges of a family: python benchmarks/families.py POLICY ...

Prints a table and draws docs/media/families.svg.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import posse
from posse_training import evaluate

OUTSIDE = {"target_speed": (0.7, 0.85), "target_turn_rate": (2.5, 3.5), "tracker_turn_rate": (0.8, 1.0)}
"""Ranges beyond those of ``family-open``."""
WORLDS = 500
PICTURE = Path(__file__).parents[1] / "docs" / "media" / "families.svg"


def main(policies: list[str]) -> None:
    """Evaluate each team in 50 drawn scenarios of ten worlds, inside and outside."""
    inside = posse.family("family-open")
    outside = posse.family(inside, name="family-open-outside", **OUTSIDE)
    figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
    print("| team | inside | contact | outside | contact | gap |\n|---|---|---|---|---|---|")
    names = []
    for row, policy in enumerate(policies):
        both = [evaluate(policy, family, WORLDS, progress=False) for family in (inside, outside)]
        scores = [found.estimate("safe_score") for found in both]
        cells = [
            f"{score.value:.3f} [{score.low:.3f}, {score.high:.3f}] | {1 - found['contact_free'].mean():.1%}"
            for score, found in zip(scores, both, strict=True)
        ]
        names.append(both[0].policy)
        print(f"| `{names[-1]}` | {' | '.join(cells)} | {scores[1].value - scores[0].value:+.3f} |", flush=True)
        for score, place, colour in zip(scores, ("inside", "outside"), ("#2a6f97", "#c8553d"), strict=True):
            reach = np.array([[score.value - score.low], [score.high - score.value]])
            label = place if row == 0 else None
            axes.errorbar(score.value, row, xerr=reach, fmt="o", color=colour, capsize=3, label=label)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel("safe score, mean with its 95 % interval")
    axes.legend(frameon=False)
    figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    main(sys.argv[1:] or ["pngl-l-phi", "ddcs-distributed", "ddcs-tuned", "learned-smart", "learned-generalist"])
