"""Mutation testing of the laws and the DDCS: which changes of the code no fast test notices.

All mutants, or a sample of them; interrupted, it resumes::

    python -m tests.mutation
    python -m tests.mutation --sample 400 --seed 1

``python -m tests.mutation.page`` writes the figures into docs/mutation.md.
"""

from __future__ import annotations

import argparse
import random
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.progress import track
from tests.mutation.judge import SURVIVED, fast_tests, judge, warm_up
from tests.mutation.mutants import Mutant, all_mutants
from tests.mutation.outcomes import FOLDER, append, begin, read

from posse_training.provenance import commit


def sample_of(mutants: list[Mutant], size: int, seed: int) -> list[Mutant]:
    """Return a random sample, in the order of the files."""
    picked = set(random.Random(seed).sample(range(len(mutants)), min(size, len(mutants))))
    return [m for k, m in enumerate(mutants) if k in picked]


def run(file: Path, head: dict[str, object], mutants: list[Mutant], jobs: int) -> None:
    """Try the mutants that a file lacks, and append each outcome to it."""
    known = read(file)
    missing = [m for m in mutants if m not in known]
    warm_up()
    times = fast_tests()
    print(f"{len(missing)} of {len(mutants)} mutants to try with {len(times)} tests")
    if missing and judge(missing[0].module, missing[0].original(), times) != SURVIVED:
        raise SystemExit("the code without a mutant does not survive")
    if not known:
        begin(file, {**head, "tests": len(times)})
    with ThreadPoolExecutor(jobs) as pool:
        outcomes = pool.map(lambda m: judge(m.module, m.code(), times), missing)
        for mutant, outcome in track(zip(missing, outcomes, strict=True), "mutants", total=len(missing)):
            append(file, mutant, outcome)


def main() -> None:
    """Read the command line and try the mutants."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sample", type=int, default=0, help="mutants in the sample; 0: all")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    given = parser.parse_args()
    mutants, file = all_mutants(), FOLDER / "all.jsonl"
    head = {"sample": given.sample, "seed": given.seed, "commit": commit(), "all": len(mutants)}
    if given.sample:
        mutants = sample_of(mutants, given.sample, given.seed)
        file = FOLDER / f"sample{given.sample}-seed{given.seed}.jsonl"
    run(file, head, mutants, given.jobs)
    outcomes = read(file)
    survivors = [m for m in mutants if outcomes[m] == SURVIVED]
    print(f"killed {1 - len(survivors) / len(mutants):.1%} of {len(mutants)}")
    for m in survivors:
        print(f"{m.path}:{m.line}", *m.change(), sep="\n    ")


if __name__ == "__main__":
    main()
