"""The check of a shipped policy: scores on a few fixed worlds, which tests play again."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Final

from posse import Scenario, get_scenario
from posse_baselines.learned import LearnedPolicy
from posse_training.reports.evaluation import evaluate

SPLIT: Final = "validation"
CHECK_SEED: Final = 2
CHECK_WORLDS: Final = 32
_NOT_PLAYED: Final = {"name", "version", "reward_weights", "message_size"}
"""Fields of a scenario that change no score, or that a check states separately."""


def make_check(policy: LearnedPolicy, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Return the scores of a policy on a few fixed worlds of each scenario."""
    check: dict[str, Any] = {
        "split": SPLIT,
        "seed": CHECK_SEED,
        "worlds": max(4, CHECK_WORLDS // len(scenarios)),
        "plays": [
            {"scenario": s.name, "version": s.version, "settings": _settings_of(s)}
            for s in scenarios
        ],
    }
    for play, score in zip(check["plays"], replay(policy, check), strict=True):
        play["score"] = score
    return check


def replay(policy: LearnedPolicy, check: Mapping[str, Any]) -> list[float]:
    """Return the present scores of a policy on the worlds of a check."""
    return [
        float(
            evaluate(
                policy, scenario, check["worlds"], check["seed"], split=check["split"],
                progress=False,
            )["score"].mean()
        )
        for scenario in check_scenarios(check)
    ]  # fmt: skip


def check_scenarios(check: Mapping[str, Any]) -> list[Scenario]:
    """Return the scenarios of a check, in their present versions."""
    return [
        get_scenario(
            play["scenario"],
            **{k: tuple(v) if isinstance(v, list) else v for k, v in play["settings"].items()},
        )
        for play in check["plays"]
    ]


def _settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return the settings that differ from those of the named scenario."""
    named = get_scenario(scenario.name)
    return {
        field.name: getattr(scenario, field.name)
        for field in dataclasses.fields(scenario)
        if field.name not in _NOT_PLAYED
        and getattr(scenario, field.name) != getattr(named, field.name)
    }
