"""The declared rules of a world, as the functions that a kernel is made of."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

from posse.rules.targets import TargetMotion
from posse.rules.targets.declaring import drawing, setting_goals


class Rules(NamedTuple):
    """Functions for compiled code, which do what the world's scenario asks for."""

    draw_motion: Any
    """(c, w): draws what the target's motion depends on in an episode."""
    set_goal: Any
    """(c, w, trackers, obstacles, s): sets a scripted target's goal heading."""


@functools.cache
def rules_of(motions: Sequence[TargetMotion]) -> Rules:
    """Return the functions for worlds whose targets move in one of these ways."""
    return Rules(drawing(motions), setting_goals(motions))
