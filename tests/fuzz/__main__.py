"""Run every campaign, one after the other, and print how each went.

For half an hour each::

    python -m tests.fuzz --minutes 30 --seed 1
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.fuzz import calls, interrupts, kernel_cache, processes, worlds
from tests.fuzz.campaign import campaign

Outcome = tuple[int, list[str]]


def _kernel_cache(seed: int, seconds: float) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        counts, failures = kernel_cache.campaign(Path(folder), seed, seconds=seconds)
    return sum(counts.values()), failures


def _interrupts(seed: int, seconds: float) -> Outcome:
    counts, failures = interrupts.campaign(seed, seconds=seconds)
    return sum(counts.values()), failures


CAMPAIGNS: dict[str, Callable[[int, float], Outcome]] = {
    "interrupts": _interrupts,  # first: it counts the threads of the process
    "worlds": lambda seed, seconds: campaign(worlds.case, seed, seconds=seconds),
    "calls": lambda seed, seconds: campaign(calls.case, seed, seconds=seconds),
    "processes": lambda seed, seconds: campaign(processes.case, seed, seconds=seconds),
    "kernel_cache": _kernel_cache,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="for each campaign")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    table = [f"{'campaign':14} {'tries':>8} {'failures':>8}"]
    failed = False
    for name, play in CAMPAIGNS.items():
        tries, failures = play(chosen.seed, 60 * chosen.minutes)
        failed = failed or bool(failures)
        sys.stdout.write("".join(f"{name}: {failure}\n" for failure in failures))
        table.append(f"{name:14} {tries:8,} {len(failures):8,}")
    sys.stdout.write("\n".join([*table, ""]))
    sys.exit(failed)


if __name__ == "__main__":
    main()
