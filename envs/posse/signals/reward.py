"""The reward: named, unscaled terms. A scenario weighs them; ``info`` reports each by name.

To add a term, write its function here under ``@reward_term``: it is then known to scenarios,
computed by the kernels and reported, with nothing else to touch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posse.numeric import FloatArray, Record, compiled

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)

_Term = Callable[[Record, Record, Record], np.float32]


@dataclass(frozen=True)
class RewardTerm:
    """One term: what it is called, what it is measured in, and what it means."""

    name: str
    unit: str
    meaning: str
    function: _Term


_terms: list[RewardTerm] = []


def reward_term(unit: str) -> Callable[[_Term], _Term]:
    """Declare a function (config, world, tracker) -> float32 as a reward term of its name."""

    def declare(function: _Term) -> _Term:
        meaning = (function.__doc__ or "").strip()
        name = function.__name__
        compiled_function = compiled(function)
        _terms.append(RewardTerm(name, unit, meaning, compiled_function))
        return compiled_function

    return declare


@reward_term("1")
def slot(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker occupies a slot (within tolerance, touching nothing), else 0."""
    return _ONE if t.slot >= 0 else _ZERO


@reward_term("m")
def progress(c: Record, w: Record, t: Record) -> np.float32:
    """By how much the distance to the nearest slot that nobody else occupies shrank."""
    return np.float32(t.slot_progress)


@reward_term("m")
def distance(c: Record, w: Record, t: Record) -> np.float32:
    """Distance to the nearest slot that nobody else occupies."""
    return np.float32(t.slot_distance)


@reward_term("1")
def sight(c: Record, w: Record, t: Record) -> np.float32:
    """1 while the tracker's own sensor has the target, else 0."""
    return _ONE if t.sees else _ZERO


@reward_term("count")
def contact(c: Record, w: Record, t: Record) -> np.float32:
    """Contacts of the tracker that began in this step."""
    return np.float32(t.onsets)


@reward_term("1")
def effort(c: Record, w: Record, t: Record) -> np.float32:
    """(V / V_max)² + (ω / ω_max)² of the motion the tracker made."""
    v, turn = t.speed * t.per_speed, t.turn_rate * t.per_turn_rate
    return np.float32(v * v + turn * turn)


@reward_term("1")
def team(c: Record, w: Record, t: Record) -> np.float32:
    """The team's score of this step: occupied slots per working tracker, at most 1."""
    return np.float32(w.score)


REWARD_TERMS: Final = tuple(_terms)
"""Every term, in the order in which they are reported."""
TERM_NAMES: Final = tuple(term.name for term in REWARD_TERMS)


def _naming() -> Callable[..., dict[str, float]]:
    values = ", ".join(TERM_NAMES)
    literal = ", ".join(f"{name!r}: {name}" for name in TERM_NAMES)
    naming: Callable[..., dict[str, float]] = eval(f"lambda {values}: {{{literal}}}")
    return naming


name_terms = _naming()
"""(a tracker's terms, in order) -> them by name.

Written out as a literal, which is made in half the time of ``dict(zip(...))``: to name the terms is
a third of a step of one world.
"""


class TermsByName(Mapping[str, FloatArray]):
    """The terms (E, rows, K) of a step by name, (E, rows) each.

    A view is made when it is asked for: to make all of them takes a third of a world's step.
    """

    __slots__ = ("_terms",)

    def __init__(self, terms: FloatArray) -> None:
        self._terms = terms

    def __getitem__(self, name: str) -> FloatArray:
        if name not in TERM_NAMES:
            raise KeyError(name)
        term: FloatArray = self._terms[..., TERM_NAMES.index(name)]
        return term

    def __iter__(self) -> Iterator[str]:
        return iter(TERM_NAMES)

    def __len__(self) -> int:
        return len(TERM_NAMES)

    def __repr__(self) -> str:
        return repr(dict(self))


def _chain(position: int) -> Any:
    """Return a compiled function that writes this term and all that follow."""
    if position == len(REWARD_TERMS):

        def stop(
            c: Record, w: Record, t: Record, weights: FloatArray, terms: FloatArray
        ) -> np.float32:
            return _ZERO

        return compiled(stop)
    function, rest = REWARD_TERMS[position].function, _chain(position + 1)

    def write(
        c: Record, w: Record, t: Record, weights: FloatArray, terms: FloatArray
    ) -> np.float32:
        value = function(c, w, t)
        terms[position] = value
        return np.float32(weights[position] * value + rest(c, w, t, weights, terms))

    return compiled(write)


write_reward = _chain(0)
"""(config, world, tracker, weights (K,), terms (K,)) -> reward; fills ``terms``."""
