"""Part of ``make results``: evaluates the scripted teams on every scenario, 1,000 test worlds each.

Writes docs/results.md, with seed and commit, its figure and data, and result files for the
leaderboard.
Nothing was tuned on these worlds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import tyro
from leaderboard import keep

import posse
from posse_baselines import load
from posse_training.provenance import commit
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.evaluation import Results, evaluate
from posse_training.reports.pictures.figures import scores
from posse_training.reports.pictures.style import RC, looks_of
from posse_training.reports.statistics import Estimate, mean, share

SCENARIOS = tuple(name for name in posse.scenario_names() if not name.startswith("paper"))
PLANNER = "planner"
POLICIES = (
    "pursuit",
    "pngl-l-phi",
    "pngl",
    "deviated-pursuit",
    "velocity-pursuit",
    "pngl-l-phi-tuned",
    "ddcs-centralized-pursuit",
    "ddcs-centralized",
    "ddcs-centralized-l-l",
    "ddcs-distributed",
    "ddcs-tuned",
    PLANNER,
)
ABLATIONS = (
    ("leader-loss", "ddcs-centralized-no-exchange"),
    ("search", "ddcs-no-radio"),
    ("radio", "ddcs-no-radio"),
    ("field", "ddcs-no-radio"),
)

DRAWN = ("pngl-l-phi", "pngl-l-phi-tuned", "ddcs-centralized", "ddcs-distributed", "ddcs-tuned", PLANNER)
"""Policies of the figure: those that reach a safe score of 0.4 on most scenarios."""
FIGURE = "results-scenarios.svg"

SMART_COST = (
    "The scenario `smart`, compared with the same starts, speeds and limits and a target that "
    'moves straight ahead (`target_motion="constant"`).'
)


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    episodes: int = 1000
    planner_episodes: int = 100
    """Worlds of the planner, the first of the others'; it takes 0.3 s and more per world."""
    seed: int = 2026
    split: str = "test"
    page: Path = Path("docs/results.md")
    rows: Path = Path("runs/results")

    def worlds(self, policy: str) -> int:
        """Return the number of worlds that a policy plays."""
        return self.planner_episodes if policy == PLANNER else self.episodes


def main() -> None:
    """Run all evaluations and write the page."""
    settings = tyro.cli(Settings)
    plays = [(scenario, policy) for scenario in SCENARIOS for policy in POLICIES]
    plays += list(ABLATIONS)
    results = {}
    for scenario, policy in sorted(plays, key=lambda play: SCENARIOS.index(play[0])):
        result = evaluate(
            policy, scenario, settings.worlds(policy), settings.seed, split=settings.split, progress=False
        )
        result.write(settings.rows / f"{scenario}-{policy}.csv")
        keep(policy, load(policy), result)
        results[scenario, policy] = result
        print(f"{scenario:12s} {policy:30s} {mean(result['safe_score'])}", flush=True)
    straight = {
        policy: evaluate(
            policy,
            "smart",
            settings.worlds(policy),
            settings.seed,
            split=settings.split,
            progress=False,
            target_motion="constant",
        )
        for policy in ("ddcs-distributed", PLANNER)
    }
    settings.page.write_text(page(settings, results, straight))
    draw(results, settings.page.parent / "media" / FIGURE)


def draw(results: Mapping[tuple[str, str], Results], path: Path) -> None:
    """Draw the safe scores of the policies of the figure."""
    plays = {
        (scenario, policy): Plays(policy, (result,))
        for (scenario, policy), result in results.items()
        if policy in DRAWN
    }
    with mpl.rc_context(RC):
        scores(plays, looks_of(DRAWN)).savefig(path, metadata={"Date": None})


def page(settings: Settings, results: dict[tuple[str, str], Results], straight: dict[str, Results]) -> str:
    """Return the page; ``straight`` has results of ``smart`` with a target that moves straight."""
    made = (
        f"Made by `make results` at commit `{commit()}`: {settings.episodes:,} worlds of the "
        f"`{settings.split}` split for each row, seed {settings.seed}. Nothing was tuned on these "
        "worlds. Brackets are 95 % intervals: bootstrap for means, Wilson's for shares. Teams are "
        "ranked by the *safe score*, in which every step from a team's first contact on counts 0. "
        "The *planner*, a reference that reads the full state and plans in copies of the worlds, "
        f"plays the first {settings.planner_episodes:,} of them; shares of it are taken on these. "
        "The *bound* is the score if every tracker moved straight to a slot at full speed and "
        "stayed."
    )
    header = (
        "| scenario | policy | safe score | of the planner's | score | contact-free | bound "
        "| settled | settling time, s | target found | recovered |"
    )
    picture = f"![Mean safe score of six teams on every scenario](media/{FIGURE})"
    wide = ["---", "hide: [toc]", "---", ""]
    lines = [*wide, "# Results of the scripted teams", "", made, "", picture, ""]
    lines += [*pivot(results), ""]
    lines += ["## Details", "", header, "|---" * 11 + "|"]
    for (scenario, policy), result in ranked(results):
        best = results[scenario, PLANNER]
        of_best = result["safe_score"][: best.episodes].mean() / best["safe_score"].mean()
        lines.append(
            "| "
            + " | ".join(
                (
                    scenario,
                    f"`{policy}`",
                    cell(mean(result["safe_score"])),
                    f"{of_best:.2f}",
                    cell(mean(result["score"])),
                    percent(share(result["contact_free"] == 1)),
                    f"{result['bound'].mean():.3f}",
                    percent(share(result.settled)),
                    cell(mean(result["settling_time"]), 1),
                    percent(share(np.isfinite(result["detection_time"]))),
                    percent(share(np.isfinite(result["recovery_time"]))) if result.scenario.breaks else "",
                )
            )
            + " |"
        )
    lines += [
        "",
        "## Cost of the smart target",
        "",
        SMART_COST,
        "",
        "| policy | constant | smart | cost |",
        "|---|---|---|---|",
    ]
    for name, play in straight.items():
        constant, smart = play["safe_score"], results["smart", name]["safe_score"]
        lines.append(f"| `{name}` | {cell(mean(constant))} | {cell(mean(smart))} | {cell(mean(constant - smart))} |")
    return "\n".join(lines) + "\n"


def pivot(results: dict[tuple[str, str], Results]) -> list[str]:
    """Return a table of safe scores, policies by scenarios."""
    lines = ["Safe score:", "", f"| | {' | '.join(SCENARIOS)} |", "|---" * (1 + len(SCENARIOS)) + "|"]
    for policy in POLICIES:
        cells = (cell(mean(results[scenario, policy]["safe_score"])) for scenario in SCENARIOS)
        lines.append(f"| `{policy}` | {' | '.join(cells)} |")
    return lines


def ranked(results: dict[tuple[str, str], Results]) -> list[tuple[tuple[str, str], Results]]:
    """Return the results sorted by scenario, then by safe score in descending order."""
    return sorted(results.items(), key=lambda item: (SCENARIOS.index(item[0][0]), -item[1]["safe_score"].mean()))


def cell(estimate: Estimate, digits: int = 3) -> str:
    """Return an estimate with its interval."""
    if estimate.count == 0:
        return "never"
    return f"{estimate.value:.{digits}f} [{estimate.low:.{digits}f}, {estimate.high:.{digits}f}]"


def percent(estimate: Estimate) -> str:
    """Return a share with its interval, in per cent."""
    value, low, high = (100 * x for x in (estimate.value, estimate.low, estimate.high))
    return f"{value:.1f} % [{low:.1f}, {high:.1f}]"


if __name__ == "__main__":
    main()
