"""The declared rules of a world, as functions for kernels."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

from posse.rules.senses.declaring import Sensor, measuring, seeing
from posse.rules.senses.sensing import add_noise
from posse.rules.targets import TargetMotion
from posse.rules.targets.declaring import drawing, setting_goals


class Rules(NamedTuple):
    """Functions for compiled code that dispatch on the scenario."""

    draw_motion: Any
    """(c, w): draws the parameters of the target's motion for an episode."""
    set_goal: Any
    """(c, w, trackers, obstacles, s): sets a scripted target's goal heading."""
    sees: Any
    """(c, w, t, dx, dy, s) -> whether the target is in sight of a tracker."""
    measure: Any
    """(c, w, number, dx, dy) -> the measured position."""


@functools.cache
def rules_of(motions: Sequence[TargetMotion], sensors: Sequence[Sensor]) -> Rules:
    """Return the functions for worlds of any of these motions and sensors."""
    return Rules(drawing(motions), setting_goals(motions), seeing(sensors), measuring(sensors, add_noise))
