"""The reward: named, unscaled terms, weighted by the scenario; ``info`` reports each by name.

A term is declared on its formula, here or in a module of your own. Those declared here are computed
and reported in every scenario, others in scenarios that give them a weight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from posse.numeric import ONE, ZERO, FloatArray, Record
from posse.registry import REWARD_TERMS, Declaration, Function
from posse.scenarios import Scenario


@dataclass(frozen=True, eq=False, kw_only=True)
class RewardTerm(Declaration):
    """One term of the reward.

    Its function gives the value for a tracker, ``(c, w, t)``, or one of the world, ``(c, w)``.

    Attributes:
        target: The value for a target that is an agent, ``(c, w)``, if it differs.
    """

    target: Function | None = None
    further: ClassVar = {"target": (("c", "w"), "a number")}

    @property
    def of_target(self) -> Function | None:
        """The function for a target that is an agent; ``None``: it has none."""
        return self.function if self.target is None and "t" not in self.parameters else self.target


def reward_term(unit: str, *, target: Function | None = None) -> Callable[[Function], Function]:
    """Declare a function as a reward term with its name; its docstring is the meaning.

    The function takes ``(c, w, t)``: the records of the scenario, the world and a tracker
    (:mod:`posse.rules.state`) after the step; or ``(c, w)``, for a value of the world that is the
    same for every tracker and for a target that is an agent. It returns a number.

    Args:
        unit: Unit of the term.
        target: The term's formula ``(c, w)`` for a target that is an agent; without one, a term of
            ``(c, w, t)`` is for trackers only.
    """
    REWARD_TERMS.check_argument(unit, '@posse.reward_term("1")')
    return lambda function: REWARD_TERMS.declare(RewardTerm, function, unit=unit, target=target)


@reward_term("1")
def slot(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker occupies a slot (within tolerance, touching nothing), else 0."""
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
    v, turn = t.speed * t.per_speed, t.turn_rate * t.per_turn_rate
    return np.float32(v * v + turn * turn)


@reward_term("1")
def team(c: Record, w: Record) -> np.float32:
    """The team's score of this step: occupied slots per working tracker, at most 1."""
    return np.float32(w.score)


def terms_for(scenario: Scenario) -> tuple[RewardTerm, ...]:
    """Return the terms of a scenario: the built-in ones, then others with a weight."""
    return REWARD_TERMS.with_added(*dict(scenario.reward_weights), *dict(scenario.target_reward_weights))


def weights_for(scenario: Scenario, weights: Mapping[str, float]) -> FloatArray:
    """Return weights in the order of a scenario's terms, (K,) float32; those not given are 0."""
    return np.array([weights.get(term.name, 0.0) for term in terms_for(scenario)], np.float32)


def check_terms(terms: Sequence[RewardTerm], rewards: FloatArray, values: FloatArray) -> None:
    """Raise DeclarationError if a reward is not finite, for the term whose value (..., K) is not."""
    if np.isfinite(rewards).all():
        return
    for k, term in enumerate(terms):
        wrong = values[..., k][~np.isfinite(values[..., k])]
        if wrong.size:
            raise REWARD_TERMS.error(term.function, f"it returned {wrong[0]:g}, and a reward must be finite")
