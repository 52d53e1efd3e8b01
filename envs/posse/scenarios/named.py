"""The named scenarios of the benchmark."""

from __future__ import annotations

import difflib
import functools
from typing import Any

from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import ScenarioError, is_number, is_one_of
from posse.shown import shown


@functools.cache  # lazily, after all declarations that scenarios may name
def _named() -> dict[str, Scenario]:
    # The reasons for these settings are in docs/scenarios.md.
    paper = Scenario(
        name="paper",
        horizon=80,
        start_distance=(0.6, 1.8),
        tracker_speed=1.5,
        tracker_turn_rate=3.0,
        target_speed=0.5,
        formation_distance=0.8,
        formation_spacing=0.8,
        tolerance=0.2,
    )
    scenarios = (
        Scenario(name="constant"),
        Scenario(name="accelerating", target_motion="accelerating"),
        Scenario(name="smart", target_motion="smart", tracker_turn_rate=1.2, target_turn_rate=2.0),
        Scenario(
            name="search",
            version=2,
            target_motion="accelerating",
            tracker_turn_rate=1.2,
            target_turn_rate=1.2,
            arena=20.0,
            start_distance=(4.0, 20.0),
            sensing_range=3.0,
        ),
        Scenario(
            name="obstacles",
            version=2,
            target_motion="smart",
            tracker_turn_rate=1.8,
            target_turn_rate=1.8,
            arena=20.0,
            num_obstacles=8,
        ),
        Scenario(
            name="radio",
            target_motion="smart",
            tracker_turn_rate=1.5,
            target_turn_rate=2.0,
            start_distance=(2.0, 5.0),
            sensing_range=4.0,
            radio_range=6.0,
            radio_delay=3,
            radio_loss=0.3,
        ),
        Scenario(
            name="leader-loss",
            target_motion="accelerating",
            tracker_turn_rate=1.1,
            target_turn_rate=0.2,
            formation_distance=2.4,
            formation_spacing=2.4,
            start_distance=(2.0, 3.9),
            sensing_range=4.0,
            breaks=1,
            horizon=300,
        ),
        Scenario(
            name="field",
            version=2,
            target_motion="smart",
            tracker_turn_rate=1.5,
            target_turn_rate=1.5,
            arena=24.0,
            num_obstacles=6,
            start_distance=(4.0, 20.0),
            sensing_range=6.0,
            range_noise=0.02,
            bearing_noise=0.02,
            velocity_smoothing=0.5,
            radio_range=8.0,
            radio_delay=2,
            radio_loss=0.2,
            breaks=1,
            break_choice="drawn",
            sensor_outages=0.2,
            radio_outages=0.2,
        ),
        Scenario(
            name="duel",
            version=2,
            target_speed=0.8,
            target_motion="smart",
            tracker_turn_rate=1.5,
            target_turn_rate=1.5,
            target_reward_weights={"team": -1.0, "contact": -0.2},
        ),
        paper.replace(name="paper-centralized"),
        paper.replace(name="paper-distributed"),
    )
    return {scenario.name: scenario for scenario in scenarios}


def scenario_names() -> tuple[str, ...]:
    """Return the names of all scenarios."""
    return tuple(_named())


def get_scenario(scenario: str | Scenario, *, target: Any = None, **overrides: Any) -> Scenario:
    """Return a scenario by name, or the given one, with fields overridden.

    A ``horizon`` that is given without ``settle_time`` shortens ``settle_time`` to the episode.

    Args:
        scenario: Its name, or a scenario.
        target: ``"agent"`` makes the target an agent; short for ``target_motion="agent"``.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown name (the message suggests similar ones), an unknown or invalid
            setting.
    """
    overrides = _with_target(target, overrides)
    if isinstance(scenario, Scenario):
        found = scenario
    elif is_one_of(_named(), scenario):
        found = _named()[scenario]
    else:
        near = difflib.get_close_matches(shown(scenario), _named(), n=3)
        hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
        raise ScenarioError(f"unknown scenario {shown(scenario)}{hint}; scenarios are: {', '.join(_named())}")
    if "horizon" in overrides and "settle_time" not in overrides:
        length = overrides["horizon"], overrides.get("control_step", found.control_step)
        if all(is_number(each) and each > 0 for each in length):
            overrides = {**overrides, "settle_time": min(found.settle_time, length[0] * length[1])}
    return found.replace(**overrides) if overrides else found


def _with_target(target: Any, overrides: dict[str, Any]) -> dict[str, Any]:
    """Return the overrides with ``target="agent"`` resolved."""
    if target is None:
        return overrides
    if target != "agent":
        raise ScenarioError(
            f"target={shown(target)} is not possible: the one choice is 'agent'; "
            "target_motion= chooses among the scripted ones"
        )
    if overrides.get("target_motion", "agent") != "agent":
        raise ScenarioError(f"target='agent' and target_motion={shown(overrides['target_motion'])} exclude each other")
    return {**overrides, "target_motion": "agent"}
