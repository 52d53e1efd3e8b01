"""Replays for tests, recorded once."""

from dataclasses import replace
from functools import cache
from typing import Final

import posse
from posse_baselines import load
from posse_training.replay import Event, Replay, record

ATTACK: Final = (
    "</script><script>window.ran=1</script><img src=x onerror=window.ran=1>"
    "<!--<script>'\"`${window.ran=1}&lt;\u2028]]>{{code}}\\u003c"
)
"""A name that would run as code if a page treated it as markup."""


@cache
def short(scenario: str = "field") -> Replay:
    """Two players on one world with every kind of fault and noise, in which the first has a contact, 20 s."""
    policies = ["ddcs-distributed", "pursuit"]
    return record(policies, scenario, seed=4, world=81, seconds=20, observations=True, num_trackers=4)


@cache
def hostile() -> Replay:
    """A replay in which every external text is an attack."""
    scenario = posse.get_scenario("constant", name=ATTACK, horizon=40)
    replay = record([(ATTACK, load("pursuit"))], scenario)
    player = replace(
        replay.players[0],
        name=ATTACK,
        about={ATTACK: ATTACK, "list": [ATTACK, 1]},
        events=(Event(3, "contact", ATTACK, (1,)),),
    )
    world = replay.world | {"commit": ATTACK, "changed": {ATTACK: [ATTACK, ATTACK]}}
    return Replay(world, (player,))
