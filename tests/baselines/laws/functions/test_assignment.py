"""The assignment of small teams against all permutations."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from tests.support.plain import plain

assignment = plain("laws.assignment")


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 3), (2, 2), (3, 3), (3, 4), (4, 4)])
def test_no_permutation_costs_less(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.uniform(-5, 20, (rows + 1, columns + 1))
    if seed % 3 == 0:
        cost = np.round(cost / 5)  # ties
    work = rng.uniform(-9, 9, (assignment.WORK_ROWS, columns + 2))
    assignment.assign(cost, rows, columns, work)
    found = [int(column) for column in work[0, :rows]]
    assert set(found) <= set(range(columns))
    sums = {
        order: sum(cost[row, column] for row, column in enumerate(order))
        for order in permutations(range(columns), rows)
    }
    assert sums[tuple(found)] == pytest.approx(min(sums.values()))
