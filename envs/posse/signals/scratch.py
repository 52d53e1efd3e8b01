"""Fields of a thread's scratch memory used by observations (:mod:`posse.rules.scratch`)."""

from __future__ import annotations

from typing import Final

from posse.numeric import WIDTH
from posse.rules.scratch import TEAM, Fields

OBSERVING: Final[Fields] = (
    # Eight numbers, one for each of eight worlds.
    ("column", WIDTH),  # of observations
    ("steps", WIDTH),  # control steps
    ("target_x", WIDTH),
    ("target_y", WIDTH),
    ("target_cos", WIDTH),
    ("target_sin", WIDTH),
    ("target_speed", WIDTH),
    ("target_turn_rate", WIDTH),
    ("target_touching", WIDTH),
    # Eight numbers for each tracker.
    ("team_x", WIDTH * TEAM),
    ("team_y", WIDTH * TEAM),
    # Eight numbers for each place of a team-mate.
    ("placed", WIDTH * TEAM),  # number of the team-mate; -1: none
    ("placed_at", WIDTH * TEAM),  # its distance, m
)
