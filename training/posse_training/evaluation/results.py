"""The results of an evaluation: one row for each episode."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Family, Scenario
from posse.scenarios.family import BLOCK
from posse_baselines.files import write_json
from posse_training.errors import SettingsError
from posse_training.evaluation.statistics import Estimate, mean, share
from posse_training.files import write_csv

Column = npt.NDArray[np.float64]


def block_of(given: Scenario | Family) -> int:
    """Return how many worlds in a row play the same drawn scenario, and are resampled as one."""
    return BLOCK if isinstance(given, Family) else 1


@dataclass(frozen=True, repr=False)
class Results:
    """The metrics of a policy in a number of episodes of one scenario.

    Attributes:
        policy: The policy's name.
        scenario: The scenario or family with all its settings.
        seed: Seed of the worlds.
        split: Split of the worlds.
        columns: Every metric by name, (episodes,) float64; ``nan`` means "never".
        target: Name of the target, where one was given; else the scenario's own motion was played.
    """

    policy: str
    scenario: Scenario | Family
    seed: int
    split: str
    columns: dict[str, Column]
    target: str | None = None

    def __repr__(self) -> str:
        played = f"{self.policy} on {self.scenario.name}{f' against {self.target}' if self.target else ''}"
        return f"<Results of {played}: safe score {self.estimate('safe_score')}, {self.episodes} episodes>"

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return len(next(iter(self.columns.values())))

    def __getitem__(self, metric: str) -> Column:
        """Return one metric's column."""
        if metric not in self.columns:
            raise KeyError(f"unknown metric {metric!r}; metrics are: {', '.join(self.columns)}")
        return self.columns[metric]

    def __iter__(self) -> Iterator[str]:
        """Return the names of the metrics."""
        return iter(self.columns)

    def estimate(self, metric: str) -> Estimate:
        """Return the mean of a metric over the episodes that have it, with its 95 % interval.

        Of a family, drawn scenarios are resampled, ten worlds each: the interval is for other scenarios of it.
        """
        column, block = self[metric], block_of(self.scenario)
        return share(column[None] == 1, block) if metric == "contact_free" else mean(column, block)

    def rows(self) -> list[dict[str, Any]]:
        """Return one dictionary for each episode."""
        return [
            {
                "policy": self.policy,
                "scenario": self.scenario.name,
                "scenario_version": self.scenario.version,
                **({} if self.target is None else {"target": self.target}),
                "seed": self.seed,
                "split": self.split,
                "world": world,
                **{name: float(column[world]) for name, column in self.columns.items()},
            }
            for world in range(self.episodes)
        ]

    def write(self, path: str | Path) -> None:
        """Write the rows as CSV and the settings as a JSON file of the same name.

        Raises:
            SettingsError: A path that does not end in ``.csv``.
            OSError: A file could not be written; an old one of that name is unchanged.
        """
        path = Path(path)
        if path.suffix != ".csv":
            raise SettingsError(f"path={str(path)!r} must end in .csv: the settings are written beside it as .json")
        path.parent.mkdir(parents=True, exist_ok=True)
        rows = self.rows()
        write_csv(path, rows)
        settings = {name: rows[0][name] for name in ("policy", "target", "seed", "split") if name in rows[0]}
        write_json(path.with_suffix(".json"), {**settings, "scenario": self.scenario.to_dict()})
