"""Fields of a thread's scratch memory used by observations (:mod:`posse.rules.scratch`)."""

from __future__ import annotations

from typing import Final

from posse.numeric import WIDTH
from posse.rules.scratch import TEAM, Fields

MOST_IN_TEAM: Final = 16
"""Largest team size for which eight worlds are observed together."""


def observing(worlds: int) -> Fields:
    """Return the fields for observing one world (``worlds`` is 1) or eight together."""
    # A row holds the team twice, then padding for the last block.
    row = (2 * WIDTH * MOST_IN_TEAM if worlds > 1 else 2 * TEAM) + WIDTH
    return (
        # Eight team-mates, one of each observer.
        ("start", WIDTH),  # index in the observation at which each team-mate begins
        ("filled", WIDTH),  # number of team-mates that the observer knows of
        # A team that is observed as a whole.
        ("distance", WIDTH * MOST_IN_TEAM),  # of each team-mate, m
        ("place", WIDTH * MOST_IN_TEAM),  # number of nearer team-mates
        ("steps", WIDTH),  # control steps of each observer's world
        # The team.
        ("team_x", row),
        ("team_y", row),
        ("team_cos", row),
        ("team_sin", row),
        ("team_speed", row),
        ("team_turn_rate", row),
        # The nearest team-mates.
        ("listed", WIDTH * TEAM),  # nearest to each of eight, then second nearest, and so on
        ("so_far", TEAM),  # distances in the list of one observer, m
        ("who", TEAM),  # and numbers
        ("certain", WIDTH),  # 0: the list has to be computed again by exact distances
    )
