"""Policies beyond their training settings: one setting of a scenario is varied."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posse import Scenario, get_scenario
from posse_training.reports.comparing.contenders import Contender
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.statistics import Estimate

BOUND: Final = "bound"
"""Name used instead of a policy's for points of the bound."""


@dataclass(frozen=True)
class Sweep:
    """A setting of a scenario and its values."""

    name: str
    scenario: str
    setting: str
    values: tuple[float, ...]
    label: str

    @property
    def own(self) -> float:
        """The value in the scenario itself, which policies are trained with."""
        return float(getattr(get_scenario(self.scenario), self.setting))

    def at(self, value: float) -> Scenario:
        """Return the scenario with another value of the setting."""
        return get_scenario(self.scenario).replace(**{self.setting: value})


SWEEPS: Final = (
    Sweep("team-size", "smart", "num_trackers", (3, 4, 5, 6, 8, 10, 12), "trackers in the team"),
    Sweep("radio-loss", "radio", "radio_loss", (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9), "share of messages lost"),
    Sweep(
        "target-speed",
        "smart",
        "target_speed",
        (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
        "speed of the target, m/s (trackers: 1.0)",
    ),
)


@dataclass(frozen=True)
class Point:
    """The safe score of a policy, or the bound, at one value of a sweep."""

    sweep: str
    value: float
    policy: str
    score: Estimate


def play_sweeps(
    contenders: Sequence[Contender],
    attempt: Callable[[Contender, Sweep, float], Plays | None],
    sweeps: Sequence[Sweep] = SWEEPS,
) -> list[Point]:
    """Play every sweep with every contender, each value on the same worlds.

    The bound depends on the path of the target, and therefore slightly on the team: it is that of
    the last contender, which is the planner if present.

    Args:
        contenders: Contenders to evaluate.
        attempt: Plays a contender at a value of a sweep; returns ``None`` if it cannot.
        sweeps: Sweeps to evaluate.
    """
    points = []
    for sweep in sweeps:
        for value in sweep.values:
            bound: Estimate | None = None
            for contender in contenders:
                plays = attempt(contender, sweep, value)
                if plays is None:
                    continue
                points.append(Point(sweep.name, value, contender.label, plays.mean("safe_score")))
                bound = plays.mean("bound")
            if bound is not None:
                points.append(Point(sweep.name, value, BOUND, bound))
    return points


def write_points(path: Path, points: Sequence[Point]) -> None:
    """Write points as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["sweep", "value", "policy", "safe_score", "low", "high", "count"])
        for p in points:
            writer.writerow([p.sweep, p.value, p.policy, *p.score.to_dict().values()])


LEADER_LOSS: Final = "leader-loss"
"""The scenario whose recovery times are drawn."""
