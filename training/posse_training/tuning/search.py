"""CMA-ES that resumes: its state is the list of the generations that it was told."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, TypedDict

import numpy as np
from cmaes import CMA

from posse_training.tuning.space import Point

SIGMA: Final = 0.1
"""Initial standard deviation, as a share of each setting's range."""


class Generation(TypedDict):
    """One generation: its points, (P, n) in the unit cube, and their scores, (P,)."""

    points: list[list[float]]
    scores: list[float]


class Search:
    """Maximises a score over the unit cube.

    The state of the random generator and of the adaptation follows from the seed and the past
    generations, so they are all that a file has to hold: they are asked and told again.

    Args:
        start: Where the search begins, (n,).
        population: Points of a generation.
        seed: Of the random generator.
        past: Generations that were told before.

    Raises:
        ValueError: A past generation has another shape, or numbers that are not finite.
    """

    def __init__(self, start: Point, population: int, seed: int, past: Iterable[Generation] = ()) -> None:
        self._cma = CMA(
            mean=np.array(start, np.float64),
            sigma=SIGMA,
            bounds=np.tile([0.0, 1.0], (len(start), 1)),
            seed=seed,
            population_size=population,
        )
        for generation in past:
            self.ask()  # draws what was drawn then
            self.tell(np.array(generation["points"]), generation["scores"])

    @property
    def mean(self) -> Point:
        """Mean of the distribution, (n,), within the cube."""
        mean: Point = np.clip(self._cma.mean, 0.0, 1.0)
        return mean

    def ask(self) -> Point:
        """Return the points of the next generation, (P, n)."""
        return np.array([self._cma.ask() for _ in range(self._cma.population_size)])

    def tell(self, points: Point, scores: Sequence[float]) -> None:
        """Adapt to the scores (P,) of a generation's points (P, n).

        Raises:
            ValueError: Wrong shapes, or numbers that are not finite.
        """
        shape = (self._cma.population_size, self._cma.dim)
        if points.shape != shape or len(scores) != shape[0]:
            raise ValueError(f"a generation has {points.shape} points, not {shape}")
        if not np.isfinite(points).all() or not np.isfinite(scores).all():
            raise ValueError("a generation has numbers that are not finite")
        self._cma.tell([(p, -float(s)) for p, s in zip(points, scores, strict=True)])
