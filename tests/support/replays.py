"""Replays for tests, recorded once."""

from __future__ import annotations

from functools import cache
from typing import Any

import posse
from posse_training.replay import Replay, record


@cache
def short(scenario: str = "field", observations: bool = True) -> Replay:
    """Two players on one world with every kind of fault and noise, 20 s."""
    return record(
        ["ddcs-distributed", "pursuit"], scenario, seed=3, world=1, seconds=20,
        observations=observations, num_trackers=4,
    )  # fmt: skip


def hostile_scenario() -> posse.Scenario:
    """A scenario whose name is an attack."""
    return posse.get_scenario("constant", name=ATTACK, horizon=20, settle_time=0.5)


ATTACK = (
    "</script><script>window.ran=1</script><img src=x onerror=window.ran=1>"
    "<!--<script>'\"`${window.ran=1}&lt;\u2028]]>{{code}}\\u003c"
)


def hostile_card() -> dict[str, Any]:
    return {"name": ATTACK, ATTACK: ATTACK, "list": [ATTACK, 1]}
