"""Play cases of a campaign until the time is up; each follows from the seed and its number."""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections.abc import Callable

Case = Callable[[int, int], None]
"""Plays the case of a seed and a number; raises where something is wrong."""


def campaign(case: Case, seed: int, first: int = 0, cases: int = 10**9, seconds: float = 1e9) -> tuple[int, list[str]]:
    """Play cases from ``first`` on; return how many, and what failed."""
    failures = []
    end, number = time.monotonic() + seconds, first
    while number < first + cases and time.monotonic() < end:
        try:
            case(seed, number)
        except Exception:
            last = traceback.format_exc().strip()
            failures.append(f"seed {seed}, case {number}:\n{last[-1500:]}")
        number += 1
    return number - first, failures


def main(doc: str | None, case: Case) -> None:
    """Play from the command line: ``--minutes``, ``--seed``, ``--first`` to play one again."""
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="the first case, to play one again")
    chosen = parser.parse_args()
    tries, failures = campaign(case, chosen.seed, chosen.first, seconds=60 * chosen.minutes)
    sys.stdout.write("\n".join([*failures, f"{tries} cases, {len(failures)} failures", ""]))
    sys.exit(bool(failures))
