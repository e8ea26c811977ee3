"""Optimal assignment on sparse costs, where every row may also stay unassigned."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating


@allocating
def assign_sparse(
    first: NDArray[Any], pair: NDArray[Any], cost: NDArray[np.float64], columns: int, chosen: NDArray[Any]
) -> None:
    """Choose for each row one of its pairs or none, each column at most once, so that the sum of costs is least.

    first: (n + 1,) offsets into pair (column) and cost; costs may be negative, no pair at all costs 0.
    chosen: (n,) written with the column of each row, or -1.
    Source: Crouse, On implementing 2D rectangular assignment algorithms (IEEE T-AES 52, 2016): shortest augmenting
    paths with dual variables; each row has a private further column of cost 0 that stands for a miss.
    """
    n = len(first) - 1
    total = columns + n
    u, v = np.zeros(n), np.zeros(total)
    row_of = np.full(total, -1, np.int64)
    column_of = np.full(n, -1, np.int64)
    shortest, path = np.full(total, np.inf), np.full(total, -1, np.int64)
    done = np.zeros(total, np.bool_)
    open_columns, touched = np.empty(total, np.int64), np.empty(total, np.int64)
    rows = np.empty(n, np.int64)
    for current in range(n):
        n_open = n_touched = n_rows = 0
        i, reached, sink = current, 0.0, -1
        while sink < 0:
            rows[n_rows] = i
            n_rows += 1
            for k in range(first[i], first[i + 1] + 1):
                own = k == first[i + 1]
                j = columns + i if own else pair[k]
                if done[j]:
                    continue
                length = reached - u[i] - v[j] + (0.0 if own else cost[k])
                if length < shortest[j]:
                    if shortest[j] == np.inf:
                        open_columns[n_open] = touched[n_touched] = j
                        n_open += 1
                        n_touched += 1
                    shortest[j], path[j] = length, i
            best = 0
            for o in range(1, n_open):
                if shortest[open_columns[o]] < shortest[open_columns[best]]:
                    best = o
            j = open_columns[best]
            n_open -= 1
            open_columns[best] = open_columns[n_open]
            reached = shortest[j]
            done[j] = True
            if row_of[j] < 0:
                sink = j
            else:
                i = row_of[j]
        u[current] += reached
        for o in range(1, n_rows):
            u[rows[o]] += reached - shortest[column_of[rows[o]]]
        for o in range(n_touched):
            j = touched[o]
            if done[j]:
                v[j] -= reached - shortest[j]
            done[j], shortest[j] = False, np.inf
        j = sink
        while True:
            i = path[j]
            row_of[j] = i
            column_of[i], j = j, column_of[i]
            if i == current:
                break
    for i in range(n):
        chosen[i] = column_of[i] if column_of[i] < columns else -1
