"""Part of ``make results``: compares the shipped learned teams with the scripted ones.

Fills docs/comparison.md below its mark, and draws the figures into docs/media. Without
shipped policies the page is not changed.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import tyro

import posse
from posse_baselines import load
from posse_baselines.registry import shipped
from posse_training.provenance import commit
from posse_training.reports.compare import Settings as CompareSettings
from posse_training.reports.compare import compare
from posse_training.reports.comparison import Comparison
from posse_training.reports.comparison_run import PLANNER
from posse_training.reports.contenders import play, read_contenders
from posse_training.reports.plays import Plays
from posse_training.reports.statistics import Estimate

SCENARIOS = tuple(name for name in posse.scenario_names() if not name.startswith("paper"))
SCRIPTED = ("ddcs-distributed", "ddcs-centralized")
MARK = "<!-- `make results` writes what follows -->"
FIGURES = {
    "scenarios": "Mean safe score of every team on every scenario.",
    "profile": "Share of worlds with at least a safe score.",
    "team-size": "Safe score against the size of the team.",
    "radio-loss": "Safe score against the share of messages lost.",
    "target-speed": "Safe score against the speed of the target.",
    "recovery": "Share of teams that have settled again, by time since their leader broke.",
}


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    groups: tuple[str, ...] = ()
    """LABEL=FILE,FILE,...: training seeds of a learned policy, for intervals that include seeds."""
    scenarios: tuple[str, ...] = SCENARIOS
    """Scenarios."""
    episodes: int = 500
    """Worlds for each policy and scenario."""
    planner_episodes: int = 500
    """Worlds that the planner plays, the first of those of the other policies; at least 1."""
    sweep_episodes: int = 100
    """Worlds at each point of the figures that vary a setting."""
    seed: int = 2026
    """Seed of the worlds."""
    split: str = "test"
    """Split of the worlds."""
    page: Path = Path("docs/comparison.md")
    """The page to fill."""
    rows: Path = Path("runs/comparison")
    """Folder for the rows and figures."""


THEIR_COMMANDS: Final = (
    "The policies were trained with these commands, each at its commit. The commands include "
    "settings that have become defaults of a scenario since."
)
ANOTHER_TRAINING: Final = (
    "The difference to the better DDCS model, with training seeds and worlds resampled. Only the "
    "best seed of each policy is shipped: to repeat this section, train the others with the "
    "commands above, and name all files in `SEEDS`."
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all evaluations, write the page and its figures."""
    settings = tyro.cli(Settings, args=arguments)
    learned = tuple(shipped())
    if not learned:
        print(f"no learned policy is shipped: {settings.page} is not changed")
        return
    found = compare(
        CompareSettings(
            (*SCRIPTED, *learned), settings.scenarios, settings.episodes, settings.seed,
            settings.split, settings.rows, sweep_episodes=settings.sweep_episodes,
            planner_episodes=settings.planner_episodes,
        )
    )  # fmt: skip
    media = settings.page.parent / "media"
    media.mkdir(exist_ok=True)
    drawn = [path for path in found.figures if path.suffix == ".svg"]
    for path in drawn:
        shutil.copyfile(path, media / f"comparison-{path.name}")
    block = report(settings, found, learned, [path.stem for path in drawn])
    fill(settings.page, block)


def fill(page: Path, block: str) -> None:
    """Replace the part of a page below its mark."""
    text = page.read_text(encoding="utf-8")
    if text.count(MARK) != 1:
        raise ValueError(f"{page} must contain the line {MARK!r} exactly once")
    page.write_text(f"{text.partition(MARK)[0]}{MARK}\n\n{block}", encoding="utf-8")


def report(
    settings: Settings, found: Comparison, learned: Sequence[str], figures: Sequence[str]
) -> str:
    """Return the part of the page below its mark."""
    cards: dict[str, Mapping[str, Any]] = {name: load(name).card for name in learned}  # type: ignore[attr-defined]
    worlds = f"{settings.episodes:,} worlds of the `{settings.split}` split for each row"
    lines = [
        f"Made at commit `{commit()}`: {worlds}, seed {settings.seed}.",
        "",
        "## Learned teams and the better DDCS model",
        "",
        row(
            "scenario", "learned", "trained on it", "safe score", "of the planner's", "score",
            "contact-free", "better DDCS model", "its safe score", "difference", "improvement",
            "bound",
        ),
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for scenario in settings.scenarios:
        best = better_ddcs(found, scenario)
        for name in learned:
            mine = found.plays.get((scenario, name))
            if mine is None:
                continue
            trained = {part["name"] for part in cards[name]["scenarios"]}
            lines.append(
                row(
                    scenario, f"`{name}`", "yes" if scenario in trained else "no",
                    mine.mean("safe_score"), f"{mine.ratio(found.plays[scenario, PLANNER]):.2f}",
                    mine.mean("score"),
                    percent(mine.share([result["contact_free"] == 1 for result in mine.results])),
                    f"`{best.label}`", best.mean("safe_score"),
                    mine.difference(best), percent(mine.improvement(best)),
                    f"{mine.mean('bound').value:.3f}",
                )
            )  # fmt: skip
    if found.left_out:
        lines += ["", "Incompatible with the scenario:", ""]
        lines += [f"- `{out['policy']}` on {out['what']}: {out['why']}" for out in found.left_out]
    lines += ["", *training_seeds(cards)]
    if settings.groups:
        lines += ["", *over_training_seeds(settings, found)]
    lines += ["", "## Figures", ""]
    for name in figures:
        lines += [f"![{FIGURES[name]}](media/comparison-{name}.svg)", "", f"*{FIGURES[name]}*", ""]
    return "\n".join(lines).rstrip("\n") + "\n"


def better_ddcs(found: Comparison, scenario: str) -> Plays:
    """Return the plays of the DDCS model with the higher mean safe score on the same worlds."""
    plays = [found.plays[scenario, name] for name in SCRIPTED]
    return max(plays, key=lambda play: play["safe_score"].mean())


def training_seeds(cards: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the validation score of every training seed, from the cards."""
    lines = [
        "## Training seeds",
        "",
        "The seed of each policy with the best score on validation worlds is shipped.",
        "",
        "| policy | training seed | score on validation worlds | steps |",
        "|---|---|---|---|",
    ]
    for name, card in cards.items():
        for seed in card["training_seeds"]:
            mark = " (shipped)" if seed["seed"] == card["seed"] else ""
            score = Estimate(**seed["score"])
            lines.append(row(f"`{name}`", f"{seed['seed']}{mark}", score, f"{seed['steps']:,}"))
    lines += ["", THEIR_COMMANDS, "", "```"]
    for name, card in cards.items():
        for seed in card["training_seeds"]:
            lines.append(f"{seed['command']}  # {name}, commit {seed['commit']}")
    return [*lines, "```"]


def over_training_seeds(settings: Settings, found: Comparison) -> list[str]:
    """Return the differences with training seeds resampled as well as worlds."""
    lines = [
        "## Another training, other worlds",
        "",
        ANOTHER_TRAINING,
        "",
        "| scenario | policy | training seeds | difference |",
        "|---|---|---|---|",
    ]
    for group in read_contenders(settings.groups):
        card: Mapping[str, Any] = group.policies[0].card  # type: ignore[union-attr]
        trained = {part["name"] for part in card["scenarios"]}
        for scenario in (name for name in settings.scenarios if name in trained):
            mine = play(group, scenario, settings.episodes, settings.seed, settings.split)
            difference = mine.difference(better_ddcs(found, scenario))
            lines.append(row(scenario, f"`{group.label}`", str(len(mine.results)), difference))
    return lines


def row(*cells: str | Estimate) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(map(str, cells))} |"


def percent(estimate: Estimate) -> str:
    """Return a share of worlds with its interval, in per cent."""
    value, low, high = (100 * x for x in (estimate.value, estimate.low, estimate.high))
    return f"{value:.0f} % [{low:.0f}, {high:.0f}]"


if __name__ == "__main__":
    main()
