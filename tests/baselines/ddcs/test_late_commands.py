"""Robots that obey late: commands make up for the lag, and decisions foresee the delay."""

from __future__ import annotations

import pytest

import posse
from posse_baselines import load, play


@pytest.mark.parametrize("name", ["pngl-l-phi", "ddcs-distributed"])
def test_late_commands_cost_the_team_little(name: str) -> None:
    policy = load(name)
    late = posse.get_scenario("constant", actuator_lag=0.5, command_delay=3)
    metrics = play(posse.batch(late, 60, split="train", message_size=policy.message_size), policy)
    assert metrics["safe_score"].mean() >= 0.75
    assert (metrics["contact_free"] == 0).mean() <= 0.02
