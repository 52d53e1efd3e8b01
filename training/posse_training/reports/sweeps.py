"""Policies beyond the settings that they were made for: one setting varied, all else as it is."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posse import Scenario, get_scenario
from posse_baselines import PolicyError
from posse_training.reports.contenders import Contender, Plays, play
from posse_training.reports.evaluation import progress_bar
from posse_training.reports.statistics import Estimate

BOUND: Final = "bound"
"""Stands for a policy's name where a point is the attainable bound."""


@dataclass(frozen=True)
class Sweep:
    """A setting of a scenario and the values that it takes."""

    name: str
    scenario: str
    setting: str
    values: tuple[float, ...]
    label: str

    @property
    def own(self) -> float:
        """The value that the scenario itself has, which policies are trained with."""
        return float(getattr(get_scenario(self.scenario), self.setting))

    def at(self, value: float) -> Scenario:
        """Return the scenario with the setting at a value."""
        return get_scenario(self.scenario, **{self.setting: value})


SWEEPS: Final = (
    Sweep("team-size", "smart", "num_trackers", (3, 4, 5, 6, 8, 10, 12), "trackers in the team"),
    Sweep(
        "radio-loss", "radio", "radio_loss", (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9),
        "share of messages lost",
    ),
    Sweep(
        "target-speed", "smart", "target_speed", (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
        "speed of the target, m/s (trackers: 1.0)",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Point:
    """The score of a policy, or the bound, at one value of a sweep."""

    sweep: str
    value: float
    policy: str
    score: Estimate


def play_sweeps(
    contenders: Sequence[Contender],
    episodes: int,
    seed: int,
    split: str,
    left_out: Callable[[str, str, str], None],
    sweeps: Sequence[Sweep] = SWEEPS,
) -> list[Point]:
    """Play every sweep with everybody; the same worlds of a value for each.

    The bound depends on where a target flees, and so on the team a little: it is that of the last
    contender, as the oracle is where there is one.

    Args:
        contenders: Who plays.
        episodes: Worlds at each value.
        seed: Of the worlds.
        split: Of the worlds.
        left_out: Told of a policy that cannot play a value: its label, what, and why.
        sweeps: Which.
    """
    points = []
    with progress_bar() as bar:
        task = bar.add_task("", total=sum(len(s.values) for s in sweeps) * len(contenders))
        for sweep in sweeps:
            for value in sweep.values:
                bound: Estimate | None = None
                for contender in contenders:
                    bar.update(task, description=f"{contender.label}, {sweep.name} {value:g}")
                    bar.advance(task)
                    try:
                        plays = play(
                            contender, sweep.at(value), episodes, seed, split, progress=False
                        )
                    except PolicyError as error:
                        left_out(contender.label, f"{sweep.name} {value:g}", str(error))
                        continue
                    points.append(Point(sweep.name, value, contender.label, plays.mean("score")))
                    bound = plays.mean("bound")
                if bound is not None:
                    points.append(Point(sweep.name, value, BOUND, bound))
    return points


def write_points(path: Path, points: Sequence[Point]) -> None:
    """Write points as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["sweep", "value", "policy", "score", "low", "high", "count"])
        for p in points:
            writer.writerow([p.sweep, p.value, p.policy, *p.score.to_dict().values()])


LEADER_LOSS: Final = "leader-loss"
"""The scenario whose recovery is drawn."""


def play_leader_loss(
    contenders: Sequence[Contender],
    episodes: int,
    seed: int,
    split: str,
    left_out: Callable[[str, str, str], None],
) -> list[Plays]:
    """Play the loss of a leader with everybody who can."""
    found = []
    for contender in contenders:
        try:
            found.append(play(contender, LEADER_LOSS, episodes, seed, split))
        except PolicyError as error:
            left_out(contender.label, LEADER_LOSS, str(error))
    return found
