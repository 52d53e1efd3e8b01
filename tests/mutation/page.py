"""Write the figures of mutation testing, and the survivors with why, into docs/mutation.md.

After ``make mutants``, or of one of its files::

    python -m tests.mutation.page runs/mutation/sample400-seed1.jsonl
"""

from __future__ import annotations

import argparse
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any, Final

from tests.mutation.judge import FAST_S, HUNG, SURVIVED
from tests.mutation.mutants import Mutant
from tests.mutation.outcomes import FOLDER, head_of, read

from posse_training.reports.statistics import share

PAGE: Final = Path("docs/mutation.md")
REASONS: Final = Path(__file__).with_name("survivors.toml")
BEGIN: Final = "<!-- figures: `python -m tests.mutation.page` writes what follows -->"
END: Final = "<!-- end of the figures -->"
MISSING: Final = "A test is missing."


def name_of(mutant: Mutant) -> str:
    """Return file and change of a mutant, independent of where in the file it is."""
    before, after = mutant.change()
    return f"{mutant.path.removeprefix('posse_baselines/')}: {before} → {after}"


def reason_of(name: str, reasons: list[dict[str, Any]]) -> str:
    """Return why a mutant survives."""
    return next((str(r["why"]) for r in reasons if name in r["mutants"]), MISSING)


def table(outcomes: dict[Mutant, str]) -> str:
    """Return the table of the modules."""
    tried, alive, hung = (
        Counter(m.path.removeprefix("posse_baselines/") for m, o in outcomes.items() if keep(o))
        for keep in (lambda o: True, lambda o: o == SURVIVED, lambda o: o == HUNG)
    )
    lines = ["| module | mutants | killed | of them hung | survived |", "|---|--:|--:|--:|--:|"]
    for path in sorted(tried):
        killed = tried[path] - alive[path]
        lines.append(f"| `{path}` | {tried[path]} | {killed} | {hung[path]} | {alive[path]} |")
    total, left = tried.total(), alive.total()
    lines.append(f"| all | {total} | {total - left} | {hung.total()} | {left} |")
    return "\n".join(lines)


def survivors(outcomes: dict[Mutant, str]) -> str:
    """Return the survivors, grouped by why they survive."""
    reasons = tomllib.loads(REASONS.read_text(encoding="utf-8"))["reason"]
    groups: dict[str, list[str]] = {str(r["why"]): [] for r in reasons}
    groups[MISSING] = []
    for mutant, outcome in outcomes.items():
        if outcome == SURVIVED:
            name = name_of(mutant)
            path, _, change = name.partition(": ")
            before, _, after = change.partition(" → ")
            line = f"- `{path}`, line {mutant.line}: `{before}` → `{after}`"
            groups[reason_of(name, reasons)].append(line)
    parts = [f"**{why}** ({len(g)})\n\n" + "\n".join(g) for why, g in groups.items() if g]
    return "\n\n".join(parts)


def figures(head: dict[str, Any], outcomes: dict[Mutant, str]) -> str:
    """Return the figures of a run."""
    total = len(outcomes)
    if total != (head["sample"] or head["all"]):
        raise SystemExit(f"only {total} mutants were tried yet: run `make mutants` again")
    killed = share([outcome != SURVIVED for outcome in outcomes.values()])
    of_all = f"a random sample of {total} of all {head['all']:,} mutants (seed {head['seed']})"
    what = of_all if head["sample"] else f"all {total:,} mutants"
    found = f"{killed.value:.1%} of {what} killed"
    if head["sample"]:
        found += f"; 95 % interval of the share of all: {killed.low:.1%} to {killed.high:.1%}"
    return (
        f"{found}. Commit `{head['commit']}`, {head['tests']} tests of at most {FAST_S:g} s.\n\n"
        f"{table(outcomes)}\n\n### Survivors\n\n{survivors(outcomes)}"
    )


def main() -> None:
    """Write the page's figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("files", nargs="*", type=Path, help="default: the last that was written")
    files = parser.parse_args().files
    files = files or [max(FOLDER.glob("*.jsonl"), key=lambda file: file.stat().st_mtime)]
    parts = [figures(head_of(file), read(file)) for file in files]
    page = PAGE.read_text(encoding="utf-8")
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{PAGE} lacks the lines {BEGIN!r} and {END!r}")
    text = "\n\n".join([f"{before}{BEGIN}", *parts, f"{END}{after}"])
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
