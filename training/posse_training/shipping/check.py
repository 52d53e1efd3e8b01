"""The check of a shipped policy: scores on a few fixed worlds, which tests reproduce.

    python -m posse_training.shipping.check

evaluates every shipped policy again on the current scenarios and updates its card, without changing
the policy. This is necessary after a change of a scenario's version or of an adviser.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console

from posse import Scenario, get_scenario
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import SHIPPED
from posse_training.provenance import commit
from posse_training.reports.evaluation import evaluate

SPLIT: Final = "validation"
CHECK_SEED: Final = 2
CHECK_WORLDS: Final = 32
AGAIN_SEED: Final = 3
AGAIN_WORLDS: Final = 100
_NOT_PLAYED: Final = {"name", "version", "reward_weights", "target_reward_weights", "message_size"}
"""Fields of a scenario that change no score, or that a check states separately."""


def make_check(policy: LearnedPolicy, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Return the scores of a policy on a few fixed worlds of each scenario."""
    check: dict[str, Any] = {
        "split": SPLIT,
        "seed": CHECK_SEED,
        "worlds": max(4, CHECK_WORLDS // len(scenarios)),
        "plays": [{"scenario": s.name, "version": s.version, "settings": _settings_of(s)} for s in scenarios],
    }
    for play, score in zip(check["plays"], replay(policy, check), strict=True):
        play["score"] = score
    return check


def replay(policy: LearnedPolicy, check: Mapping[str, Any]) -> list[float]:
    """Return the current scores of a policy on the worlds of a check."""
    return [
        float(
            evaluate(policy, scenario, check["worlds"], check["seed"], split=check["split"], progress=False)[
                "score"
            ].mean()
        )
        for scenario in check_scenarios(check)
    ]


def check_scenarios(check: Mapping[str, Any]) -> list[Scenario]:
    """Return the scenarios of a check, in their current versions."""
    return [
        get_scenario(
            play["scenario"],
            **dict[str, Any]((k, tuple(v) if isinstance(v, list) else v) for k, v in play["settings"].items()),
        )
        for play in check["plays"]
    ]


def _settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return the settings that differ from those of the named scenario."""
    named = get_scenario(scenario.name)
    return {
        field.name: getattr(scenario, field.name)
        for field in dataclasses.fields(scenario)
        if field.name not in _NOT_PLAYED and getattr(scenario, field.name) != getattr(named, field.name)
    }


def check_again(path: Path) -> LearnedPolicy:
    """Evaluate a shipped policy on the current scenarios, and write its scores to its card.

    ``card["evaluated_again"]`` states the versions, the commit, and the mean score, safe score and
    contact-free share over about ``AGAIN_WORLDS`` worlds in total.
    """
    policy = LearnedPolicy.from_file(path)
    old = policy.card["check"]
    scenarios = check_scenarios(old)
    worlds = max(8, AGAIN_WORLDS // len(scenarios))
    results = [evaluate(policy, s, worlds, AGAIN_SEED, split=SPLIT, progress=False) for s in scenarios]
    again = {
        "commit": commit(),
        "split": SPLIT,
        "seed": AGAIN_SEED,
        "worlds": worlds,
        "versions": {s.name: s.version for s in scenarios},
        "trained_on_versions": policy.card.get("evaluated_again", {}).get(
            "trained_on_versions", {play["scenario"]: play["version"] for play in old["plays"]}
        ),
        **{name: float(np.mean([r[name].mean() for r in results])) for name in ("score", "safe_score", "contact_free")},
    }
    card = {**policy.card, "check": make_check(policy, scenarios), "evaluated_again": again}
    policy.with_card(card).save(path)
    return policy.with_card(card)


if __name__ == "__main__":
    console = Console()
    for file in sorted(SHIPPED.glob("*.safetensors")):
        again = check_again(file).card["evaluated_again"]
        console.print(
            f"{file.stem}: score {again['score']:.3f}, safe score {again['safe_score']:.3f}, "
            f"contact-free {again['contact_free']:.2f}"
        )
