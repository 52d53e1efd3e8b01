"""Writes the table of results into README.md, from benchmarks/standings.csv.

python docs/drawing/readme_table.py
"""

import sys
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[1] / "hooks"))

import numpy as np
from scipy import stats

import standings
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import policy_names, shipped
from posse_training.leaderboard import Standing

README: Final = Path(__file__).parents[2] / "README.md"
BEGIN: Final = "<!-- made by docs/drawing/readme_table.py -->\n"
END: Final = "<!-- end -->\n"
BASELINE: Final = "pngl-l-phi"
PLAYS_AHEAD: Final = "belief-planner"
"""The script with a column of its own: it takes seconds for each world."""


def table() -> str:
    """Return the table: baseline, a team of each kind (the one trained there, else the best), and the planners."""
    kinds = "best script | belief planner | learned from nothing | learned correction | planner"
    lines = [f"| scenario | baseline, `{BASELINE}` | {kinds} |", "|---|---|---|---|---|---|---|"]
    corrects = {name: LearnedPolicy.from_file(path).adviser is not None for name, path in shipped().items()}
    for scenario in standings.SCENARIOS:
        found = {r.policy: r for r in standings.of_scenario(scenario)}  # the best first
        if not found:
            continue
        teams = [name for name, r in found.items() if name in policy_names() and not standings.is_reference(r)]
        teams.sort(key=lambda name: name not in (f"learned-{scenario}", f"corrected-{scenario}"))  # those first
        script, nothing, correction = (
            _cell(found, next((name for name in teams if corrects.get(name) is kind), ""))
            for kind in (None, False, True)
        )
        baseline, ahead, planner = (_cell(found, name) for name in (BASELINE, PLAYS_AHEAD, "planner"))
        cells = (baseline, script, ahead, nothing, correction, planner)
        lines.append(f"| `{scenario}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cell(found: dict[str, Standing], policy: str) -> str:
    """Return a policy's safe score with its interval, share of contact, name, and the mean of its training seeds.

    The planners play fewer worlds: instead of the name, what they gain over ``ddcs-tuned`` there.
    """
    if policy not in found:
        return ""
    row = found[policy]
    half, contact = (row.high - row.low) / 2, 1 - row.contact_free
    score = f"{row.safe_score:.3f}&nbsp;±&nbsp;{half:.3f}<br>contact&nbsp;{contact:.1%}"
    if standings.is_reference(row):
        beside = standings.tuned_beside(row.scenario, row.worlds, row.seed)
        return f"{score}<br>gain&nbsp;{row.safe_score - beside:+.3f}"
    seeds = standings.test_scores(row)
    means = f"<br>{len(seeds)}&nbsp;seeds&nbsp;{_over_seeds(seeds)}" if len(seeds) > 1 else ""
    return score if policy == BASELINE else f"{score}<br>`{policy}`{means}"


def _over_seeds(scores: list[float]) -> str:
    """Return the mean of training seeds with half its 95 % interval, by Student's t."""
    low, high = stats.t.interval(0.95, len(scores) - 1, np.mean(scores), stats.sem(scores))
    return f"{np.mean(scores):.3f}&nbsp;±&nbsp;{(high - low) / 2:.3f}"


def with_table(text: str) -> str:
    """Return the README with the table as it is now."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
