"""The reward: named, unscaled terms, weighted by the scenario; ``info`` reports each by name.

A term is declared on its formula, here or in a module of your own. Those declared here are computed
and reported in every scenario, others in scenarios that give them a weight.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posse.numeric import FloatArray, Record, compiled, written
from posse.registry import REWARD_TERMS as TERMS
from posse.registry import Function
from posse.scenarios import Scenario

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


@dataclass(frozen=True)
class RewardTerm:
    """One term: name, unit, meaning and formula."""

    name: str
    unit: str
    meaning: str
    function: Function

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """The compiled functions of the term, and what each returns."""
        return ((self.function, "number"),)


def reward_term(unit: str) -> Callable[[Function], Function]:
    """Declare a function as a reward term with its name; its docstring is the meaning.

    The function takes ``(c, w, t)``: the records of the scenario, the world and a tracker
    (:mod:`posse.rules.state`) after the step. It returns a number.

    Raises:
        DeclarationError: The name is taken, the docstring is missing, or the parameters differ.
    """

    def declare(function: Function) -> Function:
        TERMS.check_parameters(function, ("c", "w", "t"))
        name, working = function.__name__, compiled(function)
        TERMS.add(name, RewardTerm(name, unit, inspect.getdoc(function) or "", working), working)
        return working

    return declare


@reward_term("1")
def slot(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker occupies a slot (within tolerance, touching nothing), else 0."""
    return _ONE if t.slot >= 0 else _ZERO


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
    return _ONE if t.sees else _ZERO


@reward_term("count")
def contact(c: Record, w: Record, t: Record) -> np.float32:
    """Contacts of the tracker that began in this step."""
    return np.float32(t.onsets)


@reward_term("1")
def effort(c: Record, w: Record, t: Record) -> np.float32:
    """(V / V_max)² + (ω / ω_max)² of the tracker's actual motion."""
    v, turn = t.speed * t.per_speed, t.turn_rate * t.per_turn_rate
    return np.float32(v * v + turn * turn)


@reward_term("1")
def team(c: Record, w: Record, t: Record) -> np.float32:
    """The team's score of this step: occupied slots per working tracker, at most 1."""
    return np.float32(w.score)


REWARD_TERMS: Final[tuple[RewardTerm, ...]] = TERMS.built_in()
"""The built-in terms, in the order in which they are reported."""


def terms_for(scenario: Scenario) -> tuple[RewardTerm, ...]:
    """Return the terms of a scenario: the built-in ones, then others with a weight."""
    return TERMS.with_added(*dict(scenario.reward_weights))


def weights_for(scenario: Scenario) -> FloatArray:
    """Return the weights of a scenario's terms, (K,) float32."""
    weights = dict(scenario.reward_weights)
    return np.array([weights.get(term.name, 0.0) for term in terms_for(scenario)], np.float32)


def reward_writer(terms: Sequence[RewardTerm]) -> Any:
    """Return (c, w, t, weights (K,), values (K,)) -> reward, compiled; it fills ``values``."""
    lines = [f"values[{k}] = term_{k}(c, w, t)" for k in range(len(terms))]
    lines.append("reward = ZERO")
    # From last to first: another order would round differently and change results.
    lines.extend(
        f"reward = float32(weights[{k}] * values[{k}] + reward)"
        for k in range(len(terms) - 1, -1, -1)
    )
    functions = {f"term_{k}": term.function for k, term in enumerate(terms)}
    names = {"ZERO": _ZERO, "float32": np.float32, **functions}
    return written("reward", ("c", "w", "t", "weights", "values"), [*lines, "return reward"], names)


@functools.cache
def namer(names: tuple[str, ...]) -> Callable[..., dict[str, float]]:
    """Return a function from a tracker's terms, in order, to a dictionary by name.

    The dictionary is a literal, created in half the time of ``dict(zip(...))``; this is a third of
    the time of a step of one world.
    """
    literal = ", ".join(f"{name!r}: {name}" for name in names)
    naming: Callable[..., dict[str, float]] = eval(f"lambda {', '.join(names)}: {{{literal}}}")
    return naming


class TermsByName(Mapping[str, FloatArray]):
    """The terms (E, rows, K) of a step by name, (E, rows) each.

    Views are created on access: creating all of them takes a third of the time of a world's step.
    """

    __slots__ = ("_names", "_terms")

    def __init__(self, names: tuple[str, ...], terms: FloatArray) -> None:
        self._names, self._terms = names, terms

    def __getitem__(self, name: str) -> FloatArray:
        if name not in self._names:
            raise KeyError(name)
        term: FloatArray = self._terms[..., self._names.index(name)]
        return term

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return repr(dict(self))
