"""``make results``: every shipped policy on every scenario, the worlds of the leaderboard.

Writes benchmarks/standings.csv, which README and manual are made from. Rows of policies that do not ship stay.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro

import posse
from posse_baselines import load, policy_names
from posse_training.leaderboard import SEED, WORLDS, measure, read_standings, standings_text

TABLE: Final = Path(__file__).parent / "standings.csv"
SCENARIOS: Final = tuple(name for name in posse.scenario_names() if not name.startswith("paper"))
ONLY: Final = {
    "ddcs-centralized-no-exchange": ("leader-loss",),
    "ddcs-no-radio": ("search", "radio", "field"),
    "idle": (),
    "random": (),
}
"""Policies that are of interest on some scenarios alone."""
SLOW: Final = ("planner", "belief-planner")
"""Policies that take 0.3 to 5 s for each world."""


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    policies: tuple[str, ...] = policy_names()
    scenario: tuple[str, ...] = SCENARIOS
    worlds: int = WORLDS
    slow_worlds: int = 100
    """Worlds of policies that play ahead."""


def plays(name: str, scenario: str) -> bool:
    """Return whether a policy has a row on a scenario: learned ones on their own and on robots, a generalist on all."""
    own = name.removeprefix("learned-").removeprefix("corrected-")
    fits = own in (name, scenario, "generalist") or scenario == "robots"
    return scenario in ONLY.get(name, SCENARIOS) and fits


def main() -> None:
    """Play, and replace the rows of what was played."""
    settings = tyro.cli(Settings, description=__doc__)
    order = posse.scenario_names().index
    rows = {(row.scenario, row.label): row for row in read_standings(TABLE)}
    for scenario in settings.scenario:
        for name in settings.policies:
            if not plays(name, scenario):
                continue
            policy = load(name)
            worlds = settings.slow_worlds if name in SLOW else settings.worlds
            row = measure(name, name, policy, scenario, worlds, SEED)
            rows[scenario, name] = row
            print(f"{scenario:12s} {name:30s} {row.safe_score:.3f} [{row.low:.3f}, {row.high:.3f}]", flush=True)
            ordered = sorted(rows.values(), key=lambda row: (order(row.scenario), row.label))
            TABLE.write_text(standings_text(ordered), encoding="utf-8")


if __name__ == "__main__":
    main()
