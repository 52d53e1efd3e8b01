"""The learning curve of a run: results on the validation worlds, one point for each evaluation."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import Final

Point = dict[str, float]
POINT: Final = ("steps", "seconds", "safe_score", "low", "high", "score", "contact_free")
"""Agent steps, s, mean safe score and its 95 % interval, mean score, share of episodes."""


def best_of(curve: Iterable[Point]) -> float | None:
    """Return the highest safe score of a curve; ``None``: it has no points."""
    return max((point["safe_score"] for point in curve), default=None)


def as_csv(curve: Iterable[Point]) -> bytes:
    """Return a curve as the contents of ``curve.csv``."""
    text = io.StringIO()
    writer = csv.DictWriter(text, POINT)
    writer.writeheader()
    writer.writerows(curve)
    return text.getvalue().encode()
