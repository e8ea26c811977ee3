"""Looks and plots that may touch: what touches nothing of another cluster is decided apart from it.

At the marks of a group each cluster is decided as often as it has something to decide, and many clusters at once: the
k-th decisions of all of them are one question to the association. The answers are the same as one mark after the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.contracts.associate import AssociatePart, Expected
from pipeline.contracts.measured import Measured
from pipeline.group.enclosing import farthest_within
from pipeline.kernels.cells import sort_into_cells, span
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats

ROUNDING_M = 1e-3
"""By which distances are taken to be larger, so that rounding never parts what touches."""

CELL_M = 50.0
"""m, side of the cells in which plots are searched: about the reach of a gate."""


class Clusters(NamedTuple):
    """of_look: (n,) int32 cluster of each look. of_plot: (m,) int32 cluster of each plot, or `alone`.

    pending: (clusters,) int64, bit k set: it has something to decide at the k-th mark. alone: the cluster of all plots
    that no look reaches, the last one; each of its plots is decided at a mark of its own.
    """

    of_look: Array
    of_plot: Array
    pending: Array
    alone: int


class Asked(NamedTuple):
    """One question to the association: tracks (k,) rows of what is expected, plots (p,) rows of the pool.

    due: (n,) mask by row of expected, of those that are decided. mark_of_track (k,), mark_of_plot (p,): int32 place of
    the mark, among those of the group, at which each is asked about.
    """

    tracks: Array
    due: Array
    plots: Array
    mark_of_track: Array
    mark_of_plot: Array


def find_clusters(
    associate: AssociatePart, expected: Expected, established: Array, measured: Measured, plot_row: Array,
    due: Array, number: Array, mark_row: Array, margin: float,
) -> Clusters:  # fmt: skip
    """The clusters of n looks and m plots at the marks of a group: k of them, at most 63, which are bits of a number.

    established: (n,) mask of looks within whose extent, `margin` m larger, plots may lie. plot_row: (m,) absolute row
    of each plot. due: (n,) number of the mark at which each look is decided. number, mark_row: (k,) of the marks.
    """
    n, m = len(expected.time), len(plot_row)
    of_look, of_plot, pending = np.empty(n, np.int32), np.empty(m, np.int32), np.empty(n + 1, np.int64)
    reach = associate.reach(expected, measured)
    alone = _find(
        expected.time, expected.mean, reach, expected.extent, established, expected.target, associate.branching,
        measured.time, measured.position, plot_row, due, number, mark_row, margin, of_look, of_plot, pending,
    )  # fmt: skip
    return Clusters(of_look, of_plot, pending[: alone + 1], alone)


def one_cluster(looks: int, plots: int) -> Clusters:
    """All of them, at a single mark."""
    return Clusters(np.zeros(looks, np.int32), np.zeros(plots, np.int32), np.array([1, 0]), 1)


def next_question(
    clusters: Clusters, near: Array, due: Array, open_looks: Array, plot_row: Array, spent: Array, number: Array,
    mark_row: Array,
) -> Asked | None:  # fmt: skip
    """What each cluster has to decide next, taken off what is pending; None when nothing is.

    near, due: (n,) numbers of the marks at which plots may lie in the gate of a look, and at which it is decided.
    open_looks: (n,) mask of looks not decided yet. plot_row: (m,) absolute rows. spent: (m,) mask of plots taken.
    """
    if not clusters.pending.any():
        return None
    n, m = len(near), len(plot_row)
    tracks, mask, plots = np.empty(n, np.int64), np.empty(n, np.bool_), np.empty(m, np.int32)
    mark_of_track, mark_of_plot = np.empty(n, np.int32), np.empty(m, np.int32)
    k, j = _next(
        clusters.of_look, clusters.of_plot, clusters.pending, clusters.alone, near, due, open_looks, plot_row, spent,
        number, mark_row, tracks, mask, plots, mark_of_track, mark_of_plot,
    )  # fmt: skip
    return Asked(tracks[:k], mask, plots[:j], mark_of_track[:k], mark_of_plot[:j])


@allocating
def _find(
    time: Floats, mean: Floats, reach: Floats, extent: Floats, established: Array, target: Array, by_target: bool,
    m_time: Floats, position: Floats, plot_row: Array, due: Array, number: Array, mark_row: Array, margin: float,
    of_look: Array, of_plot: Array, pending: Array,
) -> int:  # fmt: skip
    """Write the clusters; how many have looks."""
    n, m = len(time), len(m_time)
    parent = np.arange(n)
    of_plot[:] = -1
    if m:
        _link_plots(time, mean, reach, extent, established, m_time, position, margin, parent, of_plot)
    if by_target:
        order = np.argsort(target)
        for k in range(1, n):
            if target[order[k]] == target[order[k - 1]]:
                _join(parent, order[k], order[k - 1])
    clusters = 0
    pending[:] = 0
    for i in range(n):
        root = _root(parent, i)
        if root == i:
            of_look[i] = clusters
            clusters += 1
        else:
            of_look[i] = of_look[root]  # the root is the smallest of its cluster
        mark = np.searchsorted(number, due[i])
        if mark < len(number):
            pending[of_look[i]] |= np.int64(1) << np.int64(mark)
    for j in range(m):
        of_plot[j] = of_look[_root(parent, of_plot[j])] if of_plot[j] >= 0 else clusters
        mark = np.searchsorted(mark_row, plot_row[j], side="right")
        if mark < len(mark_row):
            pending[of_plot[j]] |= np.int64(1) << np.int64(mark)
    return clusters


@allocating
def _link_plots(
    time: Floats, mean: Floats, reach: Floats, extent: Floats, established: Array, m_time: Floats, position: Floats,
    margin: float, parent: Array, of_plot: Array,
) -> None:  # fmt: skip
    """Join the looks that reach the same plot, and write a look that reaches it to each plot, -1 where none does."""
    start, order, grid = sort_into_cells(position, np.arange(len(m_time)), CELL_M)
    west, south, cell, nx, ny = grid[0], grid[1], grid[2], int(grid[3]), int(grid[4])
    earliest, latest = m_time.min(), m_time.max()
    for i in range(len(time)):
        x, far = mean[i], reach[i]
        if established[i]:
            far = max(far, farthest_within(extent[i], margin))
        far += ROUNDING_M
        passed = max(abs(latest - time[i]), abs(time[i] - earliest))
        e, n = passed * abs(x[2]) + far, passed * abs(x[3]) + far
        x_from, x_to = span(x[0] - e - west, x[0] + e - west, cell, nx)
        y_from, y_to = span(x[1] - n - south, x[1] + n - south, cell, ny)
        for cy in range(y_from, y_to):
            for o in range(start[cy * nx + x_from], start[cy * nx + x_to] if x_to > x_from else 0):
                j = order[o]
                dt = m_time[j] - time[i]
                off_east, off_north = position[j, 0] - x[0] - dt * x[2], position[j, 1] - x[1] - dt * x[3]
                if off_east * off_east + off_north * off_north > far * far:
                    continue
                if of_plot[j] < 0:
                    of_plot[j] = i
                else:
                    _join(parent, of_plot[j], i)


@allocating
def _root(parent: Array, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@allocating
def _join(parent: Array, i: int, j: int) -> None:
    a, b = _root(parent, i), _root(parent, j)
    parent[max(a, b)] = min(a, b)


@allocating
def _next(
    of_look: Array, of_plot: Array, pending: Array, alone: int, near: Array, due: Array, open_looks: Array,
    plot_row: Array, spent: Array, number: Array, mark_row: Array, tracks: Array, mask: Array, plots: Array,
    mark_of_track: Array, mark_of_plot: Array,
) -> tuple[int, int]:  # fmt: skip
    """Write what is asked next; how many tracks and plots."""
    mark = np.full(len(pending), -1, np.int32)
    for c in range(alone):
        if pending[c] != 0:
            lowest = pending[c] & -pending[c]
            pending[c] ^= lowest
            while lowest > 1:
                lowest >>= 1
                mark[c] += 1
            mark[c] += 1
    last = len(number) - 1 if pending[alone] != 0 else -1  # those alone are decided all at once
    pending[alone] = 0
    k = j = 0
    for i in range(len(of_look)):
        b = mark[of_look[i]]
        mask[i] = False
        if b >= 0 and open_looks[i] and near[i] <= number[b]:
            tracks[k], mark_of_track[k], mask[i] = i, b, due[i] <= number[b]
            k += 1
    for i in range(len(of_plot)):
        b = mark[of_plot[i]]
        if of_plot[i] == alone:
            b = np.searchsorted(mark_row, plot_row[i], side="right") if last >= 0 else -1
        if 0 <= b <= len(number) - 1 and not spent[i] and plot_row[i] < mark_row[b]:
            plots[j], mark_of_plot[j] = i, b
            j += 1
    return k, j
