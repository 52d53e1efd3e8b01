"""The file of a run's outcomes: a line about the run, then a line for each mutant."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any, Final

from tests.mutation.mutants import Mutant

FOLDER: Final = Path("runs/mutation")


def begin(file: Path, head: dict[str, Any]) -> None:
    """Write the line about a run."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(head) + "\n", encoding="utf-8")


def append(file: Path, mutant: Mutant, outcome: str) -> None:
    """Add the outcome of a mutant."""
    with file.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps({**dataclasses.asdict(mutant), "outcome": outcome}) + "\n")


def head_of(file: Path) -> dict[str, Any]:
    """Return what a file says about its run."""
    return dict(json.loads(file.read_text(encoding="utf-8").partition("\n")[0]))


def read(file: Path) -> dict[Mutant, str]:
    """Return the outcomes that a file holds; none if there is no file."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    outcomes = {}
    for line in lines[1:]:
        row = json.loads(line)
        outcome = row.pop("outcome")
        outcomes[Mutant(**row)] = outcome
    return outcomes
