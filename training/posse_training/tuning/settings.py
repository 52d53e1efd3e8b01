"""The settings of a tuning run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from posse_training.cluster.settings import RayOption
from posse_training.errors import SettingsError

_RANGES: Final[dict[str, tuple[float, float]]] = {
    "minutes": (0.001, 10_000.0),
    "seed": (0, 2**31 - 1),
    "generations": (1, 1_000_000),
    "population": (4, 1_000),
    "worlds": (1, 100_000),
    "validation_worlds": (1, 100_000),
    "every": (1, 1_000_000),
    "threads": (1, 1_024),
}


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """Arguments of ``posse tune``."""

    policy: Annotated[str, tyro.conf.Positional]
    """Policy with tunable settings: a name, or package.module:Class."""
    scenario: str = "smart"
    """Scenario to tune for."""
    minutes: float = 3.0
    """When to stop: after the generation in which this time is over, resumed parts included."""
    seed: int = 1
    """Seed of the search and of the worlds."""
    out: Path | None = None
    """Run folder; default: runs/tune/POLICY-SCENARIO-SEED. A run that it holds is resumed."""
    generations: int | None = None
    """Stop after so many generations, whatever the time."""
    population: int = 12
    """Candidates in a generation."""
    worlds: int = 16
    """Training worlds of a generation; each generation has its own."""
    validation_worlds: int = 256
    """Validation worlds on which the mean of the search is scored; the best one is kept."""
    every: int = 10
    """Generations between two of these scores."""
    only: tuple[str, ...] = ()
    """Settings to search over; default: all that have an effect on this scenario."""
    threads: int | None = None
    """Threads that step the worlds; default: as many as cores. Never changes the result."""
    ray: RayOption = None
    """Score candidates on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for
    the cluster of this machine, or else all its cores. Extra: cluster."""
    ship: bool = False
    """Write the result to the package, where the policy's tuned version finds it."""

    def check(self) -> None:
        """Check the ranges.

        Raises:
            SettingsError: A value out of its range; the message names it, the range and the fix.
        """
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if value is None:
                continue
            if not math.isfinite(value) or not low <= value <= high:
                raise SettingsError(f"{name}={value!r} is out of range: choose it from {low:g} to {high:,g}")

    @property
    def folder(self) -> Path:
        """The folder that the run is written to."""
        name = f"{self.policy.replace(':', '.')}-{self.scenario}-{self.seed}"
        return self.out or Path("runs/tune") / name

    def identity(self) -> dict[str, Any]:
        """Return what the course of the search depends on; a resumed run must have the same."""
        return {
            "policy": self.policy,
            "scenario": self.scenario,
            "seed": self.seed,
            "population": self.population,
            "worlds": self.worlds,
            "validation_worlds": self.validation_worlds,
            "every": self.every,
            "only": list(self.only),
        }

    def command(self, generations: int, names: Sequence[str]) -> str:
        """Return the command that repeats the run up to a generation.

        It names the settings that were searched: a later version may have more.
        """
        words = ["posse", "tune", self.policy, "--scenario", self.scenario]
        words += ["--generations", str(generations), "--seed", str(self.seed)]
        for name in ("population", "worlds", "validation_worlds", "every"):
            value = getattr(self, name)
            if value != getattr(type(self), name):
                words += [f"--{name.replace('_', '-')}", str(value)]
        return " ".join([*words, "--only", *names])
