"""Where a team's safe score is lost: the same worlds, with one difficulty at a time taken away.

    python benchmarks/losses.py ddcs-tuned field --worlds 400

``--against`` plays the unchanged worlds with a second team too, and names those of the greatest
difference; look at them with ``posse replay TEAM OTHER --scenario NAME --world K``.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from posse import Scenario, get_scenario
from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Results
from posse_training.reports.statistics import mean


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    policy: Annotated[str, tyro.conf.Positional] = "ddcs-tuned"
    scenario: Annotated[str, tyro.conf.Positional] = "field"
    worlds: int = 400
    seed: int = 7
    split: str = "validation"
    against: str | None = None
    """A second team, on the unchanged worlds."""
    against_worlds: int = 40


VARIATIONS: Final[dict[str, dict[str, Any]]] = {
    "sight at any distance": {"sensing_range": math.inf},
    "a radio without range, loss and delay": {"radio_range": math.inf, "radio_loss": 0.0, "radio_delay": 0},
    "no noise": {"range_noise": 0.0, "bearing_noise": 0.0},
    "no outages": {"sensor_outages": 0.0, "radio_outages": 0.0},
    "sight, radio, noise and outages at once": {
        "sensing_range": math.inf,
        "radio_range": math.inf,
        "radio_loss": 0.0,
        "radio_delay": 0,
        "range_noise": 0.0,
        "bearing_noise": 0.0,
        "velocity_smoothing": 0.0,
        "sensor_outages": 0.0,
        "radio_outages": 0.0,
    },
    "nobody breaks": {"breaks": 0},
    "no obstacles": {"num_obstacles": 0},
    "a target that drives straight on": {"target_motion": "constant"},
}
"""Settings of the scenario that take away one difficulty each, or all that hide the target."""


def makes_a_difference(scenario: Scenario, changes: dict[str, Any]) -> bool:
    """Return whether a variation changes the scenario."""
    return any(getattr(scenario, name) != value for name, value in changes.items())


def written(results: Results) -> tuple[str, str]:
    """Return the mean safe score with its interval, and the share of worlds with contact."""
    estimate = mean(results["safe_score"])
    interval = f"{estimate.value:.3f} [{estimate.low:.3f}, {estimate.high:.3f}]"
    return interval, f"{1 - results['contact_free'].mean():.1%}"


def main() -> None:
    """Play and print."""
    s = tyro.cli(Settings, description=__doc__)
    scenario = get_scenario(s.scenario)
    table = Table("what is taken away", "safe score", "worlds with contact")

    def play(policy: str, worlds: int, **changes: Any) -> Results:
        return evaluate(policy, scenario.replace(**changes), worlds, s.seed, split=s.split)

    team = play(s.policy, s.worlds)
    table.add_row("nothing", *written(team))
    for name, changes in VARIATIONS.items():
        if makes_a_difference(scenario, changes):
            table.add_row(name, *written(play(s.policy, s.worlds, **changes)))
    console = Console(width=None if sys.stdout.isatty() else 120)
    if s.against is not None:
        other = play(s.against, s.against_worlds)
        table.add_row(f"nothing; {s.against}, {s.against_worlds} worlds", *written(other))
    console.print(table)
    if s.against is not None:
        lost = other["safe_score"] - team["safe_score"][: s.against_worlds]
        worst = np.argsort(-lost)[:5]
        console.print("worlds lost most: " + ", ".join(f"{k} (-{lost[k]:.2f})" for k in worst))


if __name__ == "__main__":
    main()
