"""A pool of runs of detected cells: one row of int64 a run, linked into components by union-find."""

from __future__ import annotations

from typing import Any

from numba import njit

ROW, START, END, SUM, PEAK, REACH = 0, 1, 2, 3, 4, 5
"""Absolute row (scan * azimuths + row); range cells [START, END); sum and peak of amplitude; greatest link distance."""

PARENT, NEXT, TAIL, FIRST, LAST = 6, 7, 8, 9, 10
"""Union-find parent (FREE when unused); next run of the component (-1: none); valid in a root only: its last run, and
the component's first and last absolute row."""

GRID = 11
"""The row in the azimuth grid, 0 .. azimuths - 1."""

FIELDS = 12
FREE = -1


@njit(nogil=True, cache=True)
def find(runs: Any, run: int) -> int:
    """The root of a run's component, which is also the first of its list."""
    while runs[run, PARENT] != run:
        runs[run, PARENT] = runs[runs[run, PARENT], PARENT]
        run = runs[run, PARENT]
    return run


@njit(nogil=True, cache=True)
def unite(runs: Any, a: int, b: int) -> None:
    """Make one component of two runs' components; the root is the older, so that trees stay flat and lists in order."""
    a, b = find(runs, a), find(runs, b)
    if a == b:
        return
    if runs[b, FIRST] < runs[a, FIRST]:
        a, b = b, a
    runs[b, PARENT] = a
    runs[runs[a, TAIL], NEXT] = b
    runs[a, TAIL] = runs[b, TAIL]
    runs[a, LAST] = max(runs[a, LAST], runs[b, LAST])
