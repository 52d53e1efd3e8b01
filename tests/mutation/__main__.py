"""Mutation testing of the laws and the DDCS: which changes of the code no fast test notices.

All mutants, or a sample of them; interrupted, it resumes::

    python -m tests.mutation
    python -m tests.mutation --sample 400 --seed 1

``python -m tests.mutation.page`` writes the figures into docs/mutation.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import random
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from rich.progress import track
from tests.mutation.judge import SURVIVED, fast_tests, judge, warm_up
from tests.mutation.mutants import Mutant, all_mutants

from posse_training.provenance import commit

FOLDER = Path("runs/mutation")


def chosen(sample: int, seed: int) -> list[Mutant]:
    """Return a random sample of all mutants, in the order of the files; all for 0."""
    mutants = all_mutants()
    if sample:
        picked = set(random.Random(seed).sample(range(len(mutants)), min(sample, len(mutants))))
        mutants = [m for k, m in enumerate(mutants) if k in picked]
    return mutants


def read(file: Path) -> dict[Mutant, str]:
    """Return the outcomes that a file holds."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    rows = [json.loads(line) for line in lines[1:]]
    return {
        Mutant(**{k: v for k, v in row.items() if k != "outcome"}): row["outcome"] for row in rows
    }


def run(file: Path, head: dict[str, Any], mutants: list[Mutant], jobs: int) -> None:
    """Try the mutants that a file lacks, and append each outcome to it."""
    known = read(file)
    missing = [m for m in mutants if m not in known]
    warm_up()
    times = fast_tests()
    print(
        f"{len(mutants)} mutants, {len(missing)} to try; {len(times)} tests, {sum(times.values()):.0f} s"
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    if not known:
        file.write_text(json.dumps({**head, "tests": len(times)}) + "\n", encoding="utf-8")
    with ThreadPoolExecutor(jobs) as pool, file.open("a", encoding="utf-8") as lines:
        outcomes = pool.map(lambda m: (m, judge(m, times)), missing)
        for mutant, outcome in track(outcomes, "mutants", total=len(missing)):
            lines.write(json.dumps({**dataclasses.asdict(mutant), "outcome": outcome}) + "\n")
            lines.flush()


def main() -> None:
    """Read the command line and try the mutants."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--sample", type=int, default=0, help="mutants in the sample; 0: all")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    chosen_ = parser.parse_args()
    mutants = chosen(chosen_.sample, chosen_.seed)
    file = FOLDER / (
        f"sample{chosen_.sample}-seed{chosen_.seed}.jsonl" if chosen_.sample else "all.jsonl"
    )
    head = {
        "sample": chosen_.sample,
        "seed": chosen_.seed,
        "commit": commit(),
        "all": len(all_mutants()),
    }
    run(file, head, mutants, chosen_.jobs)
    outcomes = read(file)
    survivors = [m for m in mutants if outcomes[m] == SURVIVED]
    print(f"killed {1 - len(survivors) / len(mutants):.1%} of {len(mutants)}")
    for m in survivors:
        before, after = m.change()
        print(f"{m.path}:{m.line}\n  - {before}\n  + {after}")


if __name__ == "__main__":
    main()
