"""A trained target becomes a target of the package, if it is worth it.

    python -m posse_training.shipping.ship_target runs/train/duel-target-ppo-1 --name evader

plays the reference team on test worlds against the scripted target and against the trained one,
from the same starts under the same limits. The trained one is shipped only if it costs the team
more by ``--least``. Its card has both scores, and a check that an installed target must reproduce.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from posse import Scenario
from posse_baselines import Target, load_target
from posse_baselines.learned import LearnedPolicy
from posse_baselines.targets import SHIPPED_TARGETS
from posse_training.errors import SettingsError
from posse_training.provenance import commit
from posse_training.reports.evaluation import evaluate
from posse_training.reports.statistics import difference
from posse_training.runs.saved.command import command_of
from posse_training.runs.saved.folder import BEST, SETTINGS
from posse_training.runs.settings import read_settings

TEST_SEED = 7
CHECK_WORLDS = 16


@dataclass(frozen=True)
class Settings:
    """Arguments of the command."""

    run: Annotated[Path, tyro.conf.Positional]
    """Run folder of the target's training."""
    name: str
    """Name of the target."""
    team: str = "ddcs-tuned"
    """The team whose score decides."""
    scripted: str = "smart"
    """The scripted target that it is compared with."""
    least: float = 0.10
    """By how much it must cost the team more, at least: the lower end of the 95 % interval."""
    worlds: int = 500
    """Test worlds."""
    out: Path = SHIPPED_TARGETS
    """Folder to write to; default: the package's own."""


def ship_target(settings: Settings) -> Path:
    """Write a target to the package; return its file.

    Raises:
        SettingsError: Not the run of a target, or it does not cost the team enough.
        PolicyError: A run without a policy, or with a damaged one.
    """
    trained = read_settings(settings.run / SETTINGS)
    policy = LearnedPolicy.from_file(settings.run / BEST)
    if trained.side != "target":
        raise SettingsError(f"{settings.run} is the run of a team: its side is {trained.side!r}")
    scenario = trained.scenarios[0]
    new = Target(settings.name, "agent", policy)
    plays = {
        target.name: evaluate(settings.team, scenario, settings.worlds, TEST_SEED, target=target, progress=False)
        for target in (load_target(settings.scripted), new)
    }
    scripted, learned = plays[settings.scripted], plays[settings.name]
    cost = difference(scripted["score"][None], learned["score"][None])
    if not cost.low >= settings.least:
        raise SettingsError(
            f"{settings.name!r} costs {settings.team} {cost} more than {settings.scripted!r}: at "
            f"least {settings.least:g} is wanted"
        )
    card: dict[str, Any] = {
        **policy.card,
        "name": settings.name,
        "settings": {**trained.to_dict(), "folder": None},
        "command": command_of(trained),
        "shipped_at": commit(),
        "comparison": {
            "team": settings.team,
            "split": "test",
            "seed": TEST_SEED,
            "worlds": settings.worlds,
            "scores": {name: played.estimate("score").to_dict() for name, played in plays.items()},
            "target_contacts": {name: float((played["target_contacts"] > 0).mean()) for name, played in plays.items()},
            "cost": cost.to_dict(),
        },
        "check": make_target_check(settings.team, scenario, new),
    }
    path = settings.out / f"{settings.name}.safetensors"
    policy.with_card(card).save(path)
    return path


def make_target_check(team: str, scenario: Scenario, target: Target) -> dict[str, Any]:
    """Return the score of a team against a target on a few validation worlds."""
    played = evaluate(team, scenario, CHECK_WORLDS, TEST_SEED, target=target, split="validation", progress=False)
    return {
        "team": team,
        "scenario": scenario.name,
        "version": scenario.version,
        "split": "validation",
        "seed": TEST_SEED,
        "worlds": CHECK_WORLDS,
        "score": float(played["score"].mean()),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Ship a target, and say what it costs the team."""
    settings = tyro.cli(Settings, prog="ship_target", args=arguments)
    path = ship_target(settings)
    found = LearnedPolicy.from_file(path).card["comparison"]
    Console().print(found)
    Console().print(str(path), markup=False, soft_wrap=True)


if __name__ == "__main__":
    main()
