"""In which phase a team's score is lost: what trackers that hold no slot are doing instead.

    python benchmarks/phases.py field ddcs-tuned learned-field --worlds 400

The score is about the share of working trackers in a slot. The others know of no target, or are
under way, or miss their slot. Times are those of the control steps that are counted.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt
import tyro
from rich.console import Console
from rich.table import Table

import posse
from posse.rules import NEVER
from posse_baselines import Policy, load, rollout

NEAR: Final = 1.0
"""Distance from the nearest free slot above which a tracker counts as under way, m."""
PARTS: Final = 6
"""Columns of equal time."""
CAUSES: Final = ("in a slot", "the target is unknown to it", "farther than 1 m", "nearer than 1 m")
"""What a working tracker does; one of these applies."""


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    scenario: Annotated[str, tyro.conf.Positional] = "field"
    policies: Annotated[tuple[str, ...], tyro.conf.Positional] = ("ddcs-tuned",)
    worlds: int = 400
    seed: int = 7
    split: str = "validation"


def causes(batch: posse.Batch, policy: Policy, memory: Any) -> npt.NDArray[np.int64]:
    """Return what each tracker does, (E, N): a position in :data:`CAUSES`; -1: it is broken.

    A policy that does not say what it knows counts as knowing the target.
    """
    trackers = batch.arrays.tracker
    age = policy.annotations(memory).get("estimate_age")
    found = np.where(trackers["slot_distance"] > NEAR, 2, 3)
    if age is not None:
        found[age < 0] = 1
    found[trackers["slot"] >= 0] = 0
    found[trackers["broken_at"] != NEVER] = -1
    return found


def shares(policy: Policy, s: Settings) -> npt.NDArray[np.float64]:
    """Return the share of working trackers for each cause and part of the time, (4, PARTS)."""
    batch = posse.batch(
        s.scenario, s.worlds, seed=s.seed, split=s.split, message_size=policy.message_size, autoreset="disabled"
    )
    horizon = batch.scenario.horizon
    counts = np.zeros((len(CAUSES), PARTS))
    for step, played in enumerate(rollout(batch, policy)):
        found = causes(batch, policy, played.memory)
        for k in range(len(CAUSES)):
            counts[k, step * PARTS // horizon] += np.sum(found == k)
    counts /= counts.sum(axis=0)
    return counts


def main() -> None:
    """Play and print."""
    s = tyro.cli(Settings, description=__doc__)
    scenario = posse.get_scenario(s.scenario)
    seconds = scenario.horizon * scenario.control_step / PARTS
    times = [f"{k * seconds:.0f} to {(k + 1) * seconds:.0f} s" for k in range(PARTS)]
    table = Table("policy", "working trackers", "all", *times)
    for name in s.policies:
        policy = load(name)
        found = shares(policy, s)
        for cause, row in zip(CAUSES, found, strict=True):
            table.add_row(name, cause, *(f"{share:.3f}" for share in (row.mean(), *row)))
    Console(width=None if sys.stdout.isatty() else 140).print(table)


if __name__ == "__main__":
    main()
