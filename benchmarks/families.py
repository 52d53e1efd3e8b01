"""Teams inside and outside of the ranges of a family: python benchmarks/families.py POLICY ..."""

from __future__ import annotations

import sys

import posse
from posse_training import evaluate

OUTSIDE = {"target_speed": (0.7, 0.85), "target_turn_rate": (2.5, 3.5), "tracker_turn_rate": (0.8, 1.0)}
"""Ranges beyond those of ``family-open``."""
WORLDS = 500


def main(policies: list[str]) -> None:
    """Print a table of safe scores, each in 50 drawn scenarios of ten worlds."""
    inside = posse.family("family-open")
    outside = posse.family(inside, name="family-open-outside", **OUTSIDE)
    print("| team | inside | contact | outside | contact | gap |\n|---|---|---|---|---|---|")
    for policy in policies:
        both = [evaluate(policy, family, WORLDS, progress=False) for family in (inside, outside)]
        scores = [found.estimate("safe_score") for found in both]
        cells = [
            f"{score.value:.3f} [{score.low:.3f}, {score.high:.3f}] | {(found.contacts > 0).mean():.1%}"
            for score, found in zip(scores, both, strict=True)
        ]
        print(f"| `{both[0].policy}` | {' | '.join(cells)} | {scores[1].value - scores[0].value:+.3f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["ddcs-distributed", "ddcs-tuned"])
