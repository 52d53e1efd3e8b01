"""Writes the table of results into README.md, from benchmarks/standings.csv.

python docs/drawing/readme_table.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[1] / "hooks"))

import standings
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import shipped
from posse_training.leaderboard import Standing

README: Final = Path(__file__).parents[2] / "README.md"
BEGIN: Final = "<!-- made by docs/drawing/readme_table.py -->\n"
END: Final = "<!-- end -->\n"
BASELINE: Final = "pngl-l-phi"


def table() -> str:
    """Return the table: baseline, the best team of each kind, and the planner."""
    lines = [
        f"| scenario | baseline, `{BASELINE}` | best script | learned from nothing | learned correction | planner |",
        "|---|---|---|---|---|---|",
    ]
    corrects = {name: LearnedPolicy.from_file(path).adviser is not None for name, path in shipped().items()}
    for scenario in standings.SCENARIOS:
        found = {r.policy: r for r in standings.of_scenario(scenario)}  # the best first
        if not found:
            continue
        teams = {name: r for name, r in found.items() if not r.reads_state}
        kinds = ([name for name in teams if corrects.get(name) is kind] for kind in (None, False, True))
        cells = [_cell(found, BASELINE, named=False)]
        cells += [_cell(found, next(iter(names), ""), named=True) for names in kinds]
        cells += [_cell(found, "planner", named=False)]
        lines.append(f"| `{scenario}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cell(found: dict[str, Standing], policy: str, *, named: bool) -> str:
    if policy not in found:
        return ""
    score = f"{found[policy].safe_score:.3f}"
    return f"{score} `{policy}`" if named else score


def with_table(text: str) -> str:
    """Return the README with the table as it is now."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
