"""The assignment against SciPy's, over drawn costs."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from posse_baselines.laws.assignment import WORK_ROWS, assign


@settings(derandomize=True, database=None, deadline=None, max_examples=60)
@given(st.integers(1, 12), st.integers(0, 12), st.integers(0, 2**31), st.booleans())
def test_the_sum_of_the_costs_is_the_least(rows: int, more: int, seed: int, ties: bool) -> None:
    columns = rows + more
    cost = np.random.default_rng(seed).uniform(-5, 20, (rows, columns))
    if ties:
        cost = np.round(cost / 5)
    # Other contents of the work space and of unused rows and columns have no effect.
    wide = np.full((rows + 2, columns + 3), -1e6)
    wide[:rows, :columns] = cost
    work = np.full((WORK_ROWS, columns + 4), 7.0)
    before = wide.copy()
    assign(wide, rows, columns, work)
    found = work[0, :rows].astype(int)
    assert len(set(found)) == rows
    assert 0 <= found.min() <= found.max() < columns
    best = cost[linear_sum_assignment(cost)].sum()
    assert abs(cost[np.arange(rows), found].sum() - best) < 1e-9
    np.testing.assert_array_equal(wide, before)
