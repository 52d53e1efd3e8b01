"""``posse tune``: search the tunable settings of a policy for a scenario."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import tyro

from posse_training.errors import require
from posse_training.files import read_json
from posse_training.tuning.settings import TuneSettings


def main(arguments: Sequence[str]) -> None:
    """Tune a policy, and print what was found."""
    settings = tyro.cli(
        TuneSettings,
        prog="posse tune",
        description="Search the tunable settings of a policy for a scenario by CMA-ES. The same "
        "command again resumes a run.",
        args=arguments,
    )
    require("training", "cmaes")
    from posse_training.tuning.tune import tune

    try:
        path = tune(settings)
    except KeyboardInterrupt:
        print("\nto resume: run the same command again", file=sys.stderr)
        raise
    card = read_json(path)
    scores = card["scores"]
    for which in ("untuned", "tuned"):
        found = scores[which]
        safe = found["safe_score"]
        print(
            f"{which:>8}: safe score {safe['value']:.3f} [{safe['low']:.3f}, {safe['high']:.3f}], "
            f"contact in {1 - found['contact_free']:.1%} of {safe['count']} validation worlds"
        )
    print(path)
