"""Detours: along the tangent of what is in the way, on one side, and worth it among obstacles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from posse_baselines.ddcs.actuation import turn_past
from posse_baselines.laws.safeguard import DISC, put_disc

CLEARANCE = 0.2


def turn(discs: list[tuple[float, float, float]], side: float, speed: float = 0.0) -> float:
    """The turn of a robot that heads along the x-axis, past discs (x, y, reach)."""
    records, count = np.zeros(8, DISC), 0
    for x, y, reach in discs:
        count = put_disc(records, count, complex(x, y), complex(speed), reach, 0.1)
    return float(turn_past(records[:count], CLEARANCE, 1 + 0j, side))


@pytest.mark.parametrize("y", [-0.3, 0.0, 0.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_way_past_a_disc_is_its_tangent(y: float, side: float) -> None:
    x, reach = 1.7, 0.6
    angle = turn([(x, y, reach)], side)
    assert angle == pytest.approx(math.atan2(y, x) + side * math.asin((reach + CLEARANCE) / math.hypot(x, y)))
    # The line in that direction passes the centre at the clearance.
    miss = x * math.sin(angle) - y * math.cos(angle)
    assert side * miss == pytest.approx(reach + CLEARANCE)


def test_what_is_not_in_the_way_is_passed_straight() -> None:
    assert turn([(1.0, 0.9, 0.6), (-0.5, 0.0, 0.4)], 1.0) == 0.0  # beside and behind
    assert turn([(1.0, 0.0, 0.6)], 1.0, speed=0.1) == 0.0  # it moves: left to the safeguard
    assert turn([(1001.0, 0.0, 1000.0)], 1.0) == 0.0  # a wall


def test_the_way_past_a_row_is_past_its_end() -> None:
    row = [(1.5, 0.0, 0.6), (1.5, 0.9, 0.6)]
    left, right = turn(row, 1.0), turn(row, -1.0)
    assert left == pytest.approx(math.atan2(0.9, 1.5) + math.asin(0.8 / math.hypot(0.9, 1.5)))
    assert right == pytest.approx(-math.asin(0.8 / 1.5))


def test_enclosed_there_is_no_way() -> None:
    ring = [(math.cos(a), math.sin(a), 0.6) for a in np.arange(8) * math.pi / 4]
    assert abs(turn(ring, 1.0)) > 2.0
    assert abs(turn(ring, -1.0)) > 2.0
