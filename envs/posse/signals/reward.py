"""The built-in terms of the reward, unscaled; a scenario weights them, and ``info`` reports each by name.

To add one, declare it here, or in a module of your own (:func:`posse.reward_term`). Those declared here are computed
and reported in every scenario, others in scenarios that give them a weight.
"""

from collections.abc import Sequence

import numpy as np

from posse.declarations import reward_term
from posse.numeric import ONE, ZERO, FloatArray, Record


@reward_term("1")
def slot(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker occupies a slot: its nearest, within tolerance, touching nothing; of two the lower number."""
    return ONE if t.slot >= 0 else ZERO


@reward_term("m")
def progress(c: Record, w: Record, t: Record) -> np.float32:
    """Decrease in this step of the distance to the nearest slot that no other tracker occupies."""
    return np.float32(t.slot_progress)


@reward_term("m")
def distance(c: Record, w: Record, t: Record) -> np.float32:
    """Distance to the nearest slot that no other tracker occupies."""
    return np.float32(t.slot_distance)


@reward_term("1")
def sight(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker's own sensor sees the target, else 0."""
    return ONE if t.sees else ZERO


def _contact_of_target(c: Record, w: Record) -> np.float32:
    return np.float32(w.onsets)


@reward_term("count", target=_contact_of_target)
def contact(c: Record, w: Record, t: Record) -> np.float32:
    """Contacts that began in this step; of the target: those with trackers."""
    return np.float32(t.onsets)


def _effort_of_target(c: Record, w: Record) -> np.float32:
    v, turn = w.speed / c.target_speed, w.turn_rate / c.target_turn_rate
    return np.float32(v * v + turn * turn)


@reward_term("1", target=_effort_of_target)
def effort(c: Record, w: Record, t: Record) -> np.float32:
    """(V / V_max)² + (ω / ω_max)² of the robot's actual motion."""
    v, turn = t.speed / t.max_speed, t.turn_rate / t.max_turn_rate
    return np.float32(v * v + turn * turn)


@reward_term("1")
def team(c: Record, w: Record) -> np.float32:
    """The team's score of this step: occupied slots per working tracker, at most 1."""
    return np.float32(w.score)


def check_terms(terms: Sequence[reward_term], values: FloatArray) -> None:
    """Raise DeclarationError for a term whose values, of (..., K), are not all finite."""
    for k, term in enumerate(terms):
        wrong = values[..., k][~np.isfinite(values[..., k])]
        if wrong.size:
            raise term.error(f"it returned {wrong[0]:g}, and a reward must be finite")
