"""Run campaigns as parallel processes, print how each went, and keep the figures as JSON.

All of them at once, for half an hour each::

    python -m tests.fuzz --minutes 30 --seed 1

Some of them, one after the other::

    python -m tests.fuzz worlds calls --minutes 30 --jobs 1

``python -m tests.fuzz.page`` writes the figures into docs/reliability.md.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.fuzz.campaigns import CAMPAIGNS

from posse_training.provenance import commit

FIGURES = Path("runs/fuzz.json")
GRACE_S = 1800.0
"""For the first and the last try of a campaign, beside its minutes."""


def play_here(name: str, seed: int, seconds: float, cases: int) -> None:
    """Play a campaign in this process; print the outcome as one line of JSON."""
    tries, failures = CAMPAIGNS[name].play(seed, seconds, cases)
    sys.stdout.write("\n" + json.dumps({"tries": tries, "failures": failures}) + "\n")


def play_apart(name: str, chosen: argparse.Namespace) -> dict[str, Any]:
    """Play a campaign in a process of its own; return its figures, and the failures as texts."""
    command = [sys.executable, "-m", "tests.fuzz", name, "--here"]
    for option in ("seed", "minutes", "cases"):
        command += [f"--{option}", str(getattr(chosen, option))]
    began = time.monotonic()
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=60 * chosen.minutes + GRACE_S
        )
        outcome = json.loads(done.stdout.rstrip().rpartition("\n")[2])
    except subprocess.TimeoutExpired:
        outcome = {"tries": 0, "failures": ["the campaign hangs"]}
    except ValueError:
        why = f"it ended with {done.returncode}: {done.stderr[-1500:]}"
        outcome = {"tries": 0, "failures": [why]}
    return {
        **outcome,
        "seed": chosen.seed,
        "minutes": round((time.monotonic() - began) / 60, 1),
        "commit": commit(),
        "date": datetime.now(UTC).date().isoformat(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(CAMPAIGNS)}")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each campaign")
    parser.add_argument("--cases", type=int, default=10**9, help="at most, of each campaign")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=len(CAMPAIGNS), help="campaigns at once")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="JSON to add the figures to")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    names = chosen.names or list(CAMPAIGNS)
    for name in names:
        if name not in CAMPAIGNS:
            parser.error(f"no campaign {name!r}; there are: {', '.join(CAMPAIGNS)}")
    if chosen.here:
        play_here(names[0], chosen.seed, 60 * chosen.minutes, chosen.cases)
        return
    with ThreadPoolExecutor(max(1, chosen.jobs)) as pool:
        played = dict(zip(names, pool.map(lambda n: play_apart(n, chosen), names), strict=True))
    table = [f"{'campaign':14} {'tries':>9} {'failures':>8} {'minutes':>7}  seed  commit"]
    for name, row in played.items():
        sys.stdout.write("".join(f"{name}: {failure}\n" for failure in row["failures"]))
        row["failures"] = len(row["failures"])
        table.append(
            f"{name:14} {row['tries']:9,} {row['failures']:8,} {row['minutes']:7} {row['seed']:5}  {row['commit']}"
        )
    sys.stdout.write("\n".join([*table, ""]))
    before = json.loads(chosen.figures.read_text()) if chosen.figures.exists() else {}
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(before | played, indent=2) + "\n")
    sys.exit(any(row["failures"] for row in played.values()))


if __name__ == "__main__":
    main()
