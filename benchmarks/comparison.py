"""Part of ``make results``: compares the shipped learned teams with the scripted ones.

Fills docs/comparison.md between its marks, and draws the figures into docs/media. Without shipped
policies the page is not changed.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import tyro

import posse
from posse_baselines import load
from posse_baselines.registry import shipped
from posse_baselines.tuned import TUNED
from posse_baselines.tuned.files import tuned_files
from posse_training.provenance import commit
from posse_training.reports.comparing.compare import Settings as CompareSettings
from posse_training.reports.comparing.compare import compare
from posse_training.reports.comparing.comparison import Comparison
from posse_training.reports.comparing.contenders import play, read_contenders
from posse_training.reports.pictures.figures import CAPTIONS
from posse_training.reports.pivots import Pivot, pivots
from posse_training.reports.statistics import Estimate

SCENARIOS = tuple(n for n in posse.scenario_names() if not n.startswith(("paper", "duel")))
"""In `duel` the target plays too: ``posse league`` makes its table."""
SCRIPTED = ("ddcs-tuned", "ddcs-distributed", "ddcs-centralized", "pngl-l-phi-tuned", "pngl-l-phi")
"""The first is the baseline of the differences."""
KEPT = Path(__file__).with_name("training_seeds")
MARK = "<!-- `make results` writes what follows -->"
END = "<!-- the end of what `make results` writes -->"
FIRST = ("scenarios", "profile")
"""Figures above the tables; the others stand below them."""


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    groups: tuple[str, ...] = ()
    """LABEL=FILE,FILE,...: training seeds of a learned policy, for intervals that include seeds;
    default: those in benchmarks/training_seeds."""
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
    f"The difference to `{SCRIPTED[0]}`, with training seeds and worlds resampled. The policies of "
    "all training seeds are in `benchmarks/training_seeds`."
)
TABLES: Final = (
    "Brackets are 95 % intervals. **Bold**: the best team that does not read the state. †: trained "
    "on this scenario, or tuned for it."
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
            (*SCRIPTED, *learned),
            settings.scenarios,
            settings.episodes,
            settings.seed,
            settings.split,
            settings.rows,
            sweeps=("all",),
            replays=0,
            sweep_episodes=settings.sweep_episodes,
            planner_episodes=settings.planner_episodes,
        )
    )
    media = settings.page.parent / "media"
    media.mkdir(exist_ok=True)
    drawn = [path for path in found.figures if path.suffix == ".svg"]
    for path in drawn:
        shutil.copyfile(path, media / f"comparison-{path.name}")
    block = report(settings, found, learned, [path.stem for path in drawn])
    fill(settings.page, block)


def fill(page: Path, block: str) -> None:
    """Replace the part of a page between its marks."""
    text = page.read_text(encoding="utf-8")
    for mark in (MARK, END):
        if text.count(mark) != 1:
            raise ValueError(f"{page} must contain the line {mark!r} exactly once")
    before, _, rest = text.partition(MARK)
    _, _, after = rest.partition(END)
    page.write_text(f"{before}{MARK}\n\n{block}\n{END}{after}", encoding="utf-8")


def report(settings: Settings, found: Comparison, learned: Sequence[str], figures: Sequence[str]) -> str:
    """Return the part of the page between its marks."""
    cards: dict[str, Mapping[str, Any]] = {name: load(name).card for name in learned}  # type: ignore[attr-defined]
    versions = ", ".join(f"`{n}` {posse.get_scenario(n).version}" for n in settings.scenarios)
    made = (
        f"Made by `make results` at commit `{commit()}`: {settings.episodes:,} worlds of the "
        f"`{settings.split}` split for each policy and scenario (planner: "
        f"{min(settings.planner_episodes, settings.episodes):,}), seed {settings.seed}. Versions "
        f"of the scenarios: {versions}."
    )
    lines = [made, "", "## Results", "", *drawn(name for name in figures if name in FIRST), TABLES, ""]
    trained = made_for(cards)
    for pivot in pivots(found):
        lines += [f"### {pivot.title}", "", pivot.meaning, "", *pivot_table(pivot, trained), ""]
    if found.left_out:
        lines += ["Incompatible with the scenario:", ""]
        lines += [f"- `{out['policy']}` on {out['what']}: {out['why']}" for out in found.left_out]
        lines.append("")
    lines += drawn(name for name in figures if name not in FIRST)
    lines += training_seeds(cards)
    groups = settings.groups or kept_seeds()
    if groups:
        lines += ["", *over_training_seeds(settings, groups, found)]
    return "\n".join(lines).rstrip("\n") + "\n"


def drawn(figures: Iterable[str]) -> list[str]:
    """Return figures with their captions."""
    lines = []
    for name in figures:
        lines += [f"![{CAPTIONS[name]}](media/comparison-{name}.svg)", "", f"*{CAPTIONS[name]}*", ""]
    return lines


def made_for(cards: Mapping[str, Mapping[str, Any]]) -> set[tuple[str, str]]:
    """Return the pairs of policy and scenario it was trained on or tuned for."""
    pairs = {(name, part["name"]) for name, card in cards.items() for part in card["scenarios"]}
    return pairs | {(name, scenario) for name in TUNED for scenario in tuned_files(name)}


def pivot_table(pivot: Pivot, trained: Collection[tuple[str, str]]) -> list[str]:
    """Return a table of policies by scenarios."""
    lines = [row("", *(f"`{name}`" for name in pivot.scenarios))]
    lines.append("|---" * (1 + len(pivot.scenarios)) + "|")
    for policy, cells in pivot.rows:
        shown = []
        for scenario, cell in zip(pivot.scenarios, cells, strict=True):
            mark = " †" if cell.value and (policy, scenario) in trained else ""
            value = f"**{cell.value}**{mark}" if cell.best else f"{cell.value}{mark}"
            parts = (value, cell.interval) if cell.interval else (value,)
            shown.append("<br>".join(parts).replace(" ", "&nbsp;"))
        lines.append(row(f"`{policy}`", *shown))
    return lines


def training_seeds(cards: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the validation score of every training seed, from the cards."""
    lines = [
        "## Training seeds",
        "",
        "The seed of each policy with the best validation score is shipped.",
        "",
        "| policy | training seed | validation score | steps |",
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


def kept_seeds() -> tuple[str, ...]:
    """Return the policies of all training seeds that ``posse ship --keep`` has kept, by name."""
    files: dict[str, list[str]] = {}
    for path in sorted(KEPT.glob("*.safetensors")):
        files.setdefault(path.stem.rpartition("-")[0], []).append(str(path))
    return tuple(f"{name}={','.join(paths)}" for name, paths in files.items())


def over_training_seeds(settings: Settings, groups: Sequence[str], found: Comparison) -> list[str]:
    """Return the differences with training seeds resampled as well as worlds."""
    lines = [
        "## Another training, other worlds",
        "",
        ANOTHER_TRAINING,
        "",
        "| scenario | policy | training seeds | difference |",
        "|---|---|---|---|",
    ]
    for group in read_contenders(groups):
        card: Mapping[str, Any] = group.policies[0].card  # type: ignore[union-attr]
        trained = {part["name"] for part in card["scenarios"]}
        for scenario in (name for name in settings.scenarios if name in trained):
            mine = play(group, scenario, settings.episodes, settings.seed, settings.split)
            difference = mine.difference(found.plays[scenario, SCRIPTED[0]])
            lines.append(row(scenario, f"`{group.label}`", str(len(mine.results)), difference))
    return lines


def row(*cells: str | Estimate) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    main()
