"""The assignment of least total cost, by shortest augmenting paths."""

from __future__ import annotations

from typing import Any, Final

import numpy.typing as npt

from posse.numeric import compiled

WORK_ROWS: Final = 7
"""Rows of the work array of :func:`assign`."""

_LARGE: Final = 1e30


@compiled
def assign(cost: npt.NDArray[Any], work: npt.NDArray[Any]) -> None:
    """Assign every row to a column of its own so that the sum of the costs is least.

    The Hungarian method in the form of Jonker and Volgenant (1987): one row after the other is
    added along the cheapest augmenting path, O(n³).

    Args:
        cost: (n, n), finite; left as it is. A row of zeros takes a column that is left over.
        work: (WORK_ROWS, n + 1); in the end ``work[0, i]`` is the column of row i.
    """
    n = len(cost)
    # Rows and columns count from 1 here; 0 means none.
    answer, row_price, column_price, row_of = work[0], work[1], work[2], work[3]
    path, slack, done = work[4], work[5], work[6]
    work[1:5] = 0.0
    for i in range(1, n + 1):
        row_of[0] = i
        j0 = 0
        for j in range(n + 1):
            slack[j] = _LARGE
            done[j] = 0.0
        while True:
            done[j0] = 1.0
            i0 = int(row_of[j0])
            delta, j1 = _LARGE, 0
            for j in range(1, n + 1):
                if done[j] == 0.0:
                    reduced = cost[i0 - 1, j - 1] - row_price[i0] - column_price[j]
                    if reduced < slack[j]:
                        slack[j] = reduced
                        path[j] = j0
                    if slack[j] < delta:
                        delta, j1 = slack[j], j
            for j in range(n + 1):
                if done[j] != 0.0:
                    row_price[int(row_of[j])] += delta
                    column_price[j] -= delta
                else:
                    slack[j] -= delta
            j0 = j1
            if row_of[j0] == 0.0:
                break
        while j0 != 0:
            j1 = int(path[j0])
            row_of[j0] = row_of[j1]
            j0 = j1
    for j in range(1, n + 1):
        answer[int(row_of[j]) - 1] = j - 1
