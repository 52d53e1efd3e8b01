"""Play episodes with a policy and keep a row for each: the numbers that everything else quotes.

Every policy meets the same worlds: world i of a seed and a split is a function of these alone.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import posse
from posse import Scenario, get_scenario
from posse_baselines import BasePolicy, Policy, load, rollout
from posse_baselines.policy import Memory
from posse_training.reports.statistics import Estimate, mean
from posse_training.runs.settings import SettingsError

WORLDS_AT_ONCE: Final = 500
Column = npt.NDArray[np.float64]


class TrainedSplitError(ValueError):
    """Worlds that a policy has learned from: a score there would flatter it."""


@dataclass(frozen=True)
class Results:
    """What a policy did in a number of episodes of one scenario.

    Attributes:
        policy: The policy's name.
        scenario: What was played, settings included.
        seed: Of the worlds.
        split: Of the worlds.
        columns: Every metric by name, (episodes,) float64; ``nan`` stands for "never".
    """

    policy: str
    scenario: Scenario
    seed: int
    split: str
    columns: dict[str, Column] = field(repr=False)

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return len(self.columns["score"])

    def __getitem__(self, metric: str) -> Column:
        """Return one metric's column."""
        if metric not in self.columns:
            raise KeyError(f"unknown metric {metric!r}; metrics are: {', '.join(self.columns)}")
        return self.columns[metric]

    @property
    def settled(self) -> npt.NDArray[np.bool_]:
        """Which episodes saw the team settle, (episodes,)."""
        settled: npt.NDArray[np.bool_] = np.isfinite(self.columns["settling_time"])
        return settled

    @property
    def contacts(self) -> Column:
        """Contacts of any kind, (episodes,)."""
        kinds = ("tracker_contacts", "obstacle_contacts", "target_contacts")
        total: Column = np.sum([self.columns[kind] for kind in kinds], axis=0)
        return total

    def estimate(self, metric: str) -> Estimate:
        """Return the mean of a metric where it is a number, with its 95 % interval."""
        return mean(self[metric])

    def rows(self) -> list[dict[str, Any]]:
        """Return one dictionary an episode."""
        return [
            {
                "policy": self.policy,
                "scenario": self.scenario.name,
                "scenario_version": self.scenario.version,
                "seed": self.seed,
                "split": self.split,
                "world": world,
                **{name: float(column[world]) for name, column in self.columns.items()},
            }
            for world in range(self.episodes)
        ]

    def write(self, path: Path) -> None:
        """Write the rows as CSV and, beside it, the settings as JSON."""
        path.parent.mkdir(parents=True, exist_ok=True)
        rows = self.rows()
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        settings = {
            "policy": self.policy,
            "seed": self.seed,
            "split": self.split,
            "scenario": self.scenario.to_dict(),
        }
        path.with_suffix(".json").write_text(json.dumps(settings, indent=2) + "\n")


def evaluate(
    policy: str | Policy,
    scenario: str | Scenario,
    episodes: int = 1000,
    seed: int = 7,
    *,
    split: str = "test",
    progress: bool | Callable[[int], object] = True,
    num_threads: int | None = None,
    **overrides: Any,
) -> Results:
    """Play episodes of a scenario with a policy.

    Args:
        policy: A policy, or what :func:`posse_baselines.load` takes.
        scenario: A scenario or its name.
        episodes: How many; episode i is world i of the seed.
        seed: Of the worlds.
        split: ``"test"`` by default: no training and no tuning ever saw these worlds.
        progress: Show a bar; or a function that is told the number of control steps just played.
        num_threads: Threads that step the worlds; never changes a result.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: ``episodes`` below 1.
        TrainedSplitError: A split that the policy was trained on.
        ScenarioError: An unknown scenario or split, an impossible setting or seed.
    """
    if isinstance(policy, str):
        policy = load(policy)
    if episodes < 1:
        raise SettingsError(f"episodes={episodes} must be at least 1")
    refuse_trained_split(policy, split)
    settings = get_scenario(scenario, **overrides)
    settings = settings.replace(message_size=max(settings.message_size, policy.message_size))
    if callable(progress):
        columns = _play_all(policy, settings, episodes, seed, split, num_threads, progress)
    else:
        with progress_bar(disable=not progress) as bar:
            parts = -(-episodes // WORLDS_AT_ONCE)
            task = bar.add_task(f"{policy.name} on {settings.name}", total=parts * settings.horizon)
            columns = _play_all(
                policy, settings, episodes, seed, split, num_threads,
                lambda steps: bar.advance(task, steps),
            )  # fmt: skip
    return Results(policy.name, settings, seed, split, columns)


def progress_bar(*, disable: bool = False) -> Progress:
    """Return the progress bar that all commands show."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        transient=True,
        disable=disable,
    )


def refuse_trained_split(policy: Policy, split: str) -> None:
    """Raise if a policy says that it was trained on this split."""
    trained = tuple(getattr(policy, "trained_splits", ()))
    if split in trained:
        raise TrainedSplitError(
            f"{policy.name!r} was trained on the split {split!r}, a score there would flatter it: "
            f"choose another of 'train', 'validation', 'test' than {', '.join(map(repr, trained))}"
        )


def _play_all(
    policy: Policy,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    num_threads: int | None,
    advance: Callable[[int], object],
) -> dict[str, Column]:
    parts = []
    for first in range(0, episodes, WORLDS_AT_ONCE):
        count = min(WORLDS_AT_ONCE, episodes - first)
        batch = posse.Batch(
            scenario, count, seed=seed, split=split, first_world=first, num_threads=num_threads
        )
        parts.append(play_episode(batch, policy, advance))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def play_episode(
    batch: posse.Batch, policy: Policy, advance: Callable[[int], object] = lambda steps: None
) -> dict[str, Column]:
    """Play one episode in every world of a batch; return every metric by name, (E,).

    Beside the world's own metrics, ``leader_exchanges`` counts how often the leader that most of
    the team follows changed, for policies that tell their leader.
    """
    columns: dict[str, Column] = {}
    running = np.ones(batch.num_worlds, np.bool_)
    exchanges = ExchangeCounter(batch.num_worlds)
    for step in rollout(batch, policy):
        exchanges.count(leaders_of(policy, step.memory), running)
        ended = running & (step.terminated | step.truncated)
        if ended.any():
            for name, values in step.infos["metrics"].items():
                column = columns.setdefault(name, np.full(batch.num_worlds, np.nan))
                column[ended] = values[ended]
            running &= ~ended
        advance(1)
        if not running.any():
            break
    columns["leader_exchanges"] = exchanges.total
    return columns


def leaders_of(policy: Policy, memory: Memory) -> npt.NDArray[Any] | None:
    """Return whom each tracker follows, (E, N); ``None`` for policies that do not tell."""
    if isinstance(policy, BasePolicy):
        return policy.leaders(memory)
    return policy.annotations(memory).get("leader")


class ExchangeCounter:
    """Counts how often the leader that most of a team follows changes, world by world."""

    def __init__(self, num_worlds: int) -> None:
        self.total: Column = np.full(num_worlds, np.nan)
        self._leader = np.full(num_worlds, -1)
        self._seen: npt.NDArray[Any] = np.empty(0)

    def count(self, leaders: npt.NDArray[Any] | None, running: npt.NDArray[np.bool_]) -> None:
        """Look at whom the trackers follow now, (E, N) numbers; ``None``: they do not tell."""
        if leaders is None or np.array_equal(leaders, self._seen):
            return
        self._seen = leaders.copy()
        # Whom more than half follow stands in the middle of the row, sorted.
        n = leaders.shape[1]
        middle = np.sort(leaders, axis=1)[:, n // 2]
        agreed = np.count_nonzero(leaders == middle[:, None], axis=1) > n / 2
        chosen = np.where(agreed, middle, -1)
        known = (chosen >= 0) & running
        self.total[known & np.isnan(self.total)] = 0
        self.total[known & (self._leader >= 0) & (chosen != self._leader)] += 1
        self._leader[known] = chosen[known]
