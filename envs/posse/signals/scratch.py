"""What observations need of a thread's scratch memory (:mod:`posse.rules.scratch`)."""

from __future__ import annotations

from typing import Final

from posse.numeric import WIDTH
from posse.rules.scratch import TEAM, Fields

MOST_IN_TEAM: Final = 16
"""Up to this team size, eight worlds are observed together."""


def observing(worlds: int) -> Fields:
    """Return the fields for observing one world, or eight together."""
    # A team is there twice, and then comes room for the last block: of one world, or of eight.
    row = (2 * WIDTH * MOST_IN_TEAM if worlds > 1 else 2 * TEAM) + WIDTH
    return (
        # Of eight observers.
        ("step", WIDTH),  # control steps since the start
        ("fix_step", WIDTH),
        # Of eight team-mates.
        ("column", WIDTH),  # of an observation
        ("start", WIDTH),  # where in an observation each belongs
        ("filled", WIDTH),  # how many team-mates an observer knows of
        # Of a team that is observed as a whole.
        ("distance", WIDTH * MOST_IN_TEAM),  # how far each mate is, m
        ("place", WIDTH * MOST_IN_TEAM),  # how many are nearer
        # The team.
        ("team_x", row),
        ("team_y", row),
        ("team_cos", row),
        ("team_sin", row),
        ("team_speed", row),
        ("team_turn_rate", row),
        # The nearest.
        ("listed", WIDTH * TEAM),  # the nearest to each of eight, the second nearest, and so on
        ("so_far", TEAM),  # of one: how far, m
        ("who", TEAM),  # and which
        ("certain", WIDTH),  # 0: a list has to be made again, exactly
    )
