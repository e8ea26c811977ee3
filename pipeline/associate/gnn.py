"""Global nearest neighbour: gating on a grid, then the one best assignment of all tracks together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.contracts.associate import Assignment, Expected, Measured
from pipeline.kernels.assignment import assign_sparse
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats


@dataclass(frozen=True)
class GlobalNearestNeighbour:
    """Pairs inside the gate cost d^2 + ln|S| (+ penalty) less `log_likelihood_ratio`; a miss costs 0.

    gate: bound of the squared Mahalanobis distance (13.8 holds 99.9 % of two dimensions). max_gate_m: no pair is
    farther apart. extent_sd: the centroid of an extended target wanders; this part of its length and width is added
    to the innovation as a standard deviation. detection: probability that a look finds the target.
    new_density: measurements a m^2 and look that belong to no track.
    Source: Blackman and Popoli, Design and Analysis of Modern Tracking Systems, 6.4 and 7.2 (likelihood-ratio score).
    """

    gate: float = 13.8
    max_gate_m: float = 150.0
    extent_sd: float = 0.2
    detection: float = 0.9
    new_density: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("gate", "max_gate_m", "new_density"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be positive")
        if not 0 < self.detection < 1:
            raise ValueError("detection must lie between 0 and 1")
        if not 0 <= self.extent_sd <= 1:
            raise ValueError("extent_sd must lie between 0 and 1")

    @property
    def log_likelihood_ratio(self) -> float:
        """Twice the logarithm of how much likelier a perfect pair is than a missed track and a new measurement.

        The terms that do not depend on the pair; costs are -2 log likelihoods, hence twice.
        """
        return -2.0 * math.log(2 * math.pi * self.new_density * (1 - self.detection) / self.detection)

    def __call__(self, tracks: Expected, measured: Measured) -> Assignment:
        """Assign (n tracks, m measurements), all pairs within gate and time window considered. O(pairs) memory."""
        n, m = len(tracks.time), len(measured.time)
        first = np.zeros(n + 1, dtype=np.int32)
        chosen = np.full(n, -1, dtype=np.int32)
        distance = np.full(n, np.nan)
        if n == 0 or m == 0:
            return Assignment(chosen, distance, first, np.empty(0, np.int32), np.empty(0))
        arguments = (
            tracks.time, tracks.state, tracks.covariance, tracks.window, tracks.extent,
            measured.time, measured.position, measured.noise, self.gate, self.max_gate_m, self.extent_sd,
        )  # fmt: skip
        start, order, grid = _grid(measured.position, self.max_gate_m / CELLS_PER_GATE)
        pairs = _gate(*arguments, start, order, grid, first, np.empty(0, np.int32), np.empty(0), np.empty(0), False)
        pair, squared, log_det = np.empty(pairs, np.int32), np.empty(pairs), np.empty(pairs)
        _gate(*arguments, start, order, grid, first, pair, squared, log_det, True)
        cost = squared + log_det - self.log_likelihood_ratio + np.repeat(tracks.penalty, np.diff(first))
        assign_sparse(first, pair, cost, m, chosen)
        _taken(first, pair, squared, chosen, distance)
        return Assignment(chosen, distance, first, pair, cost)


PART = GlobalNearestNeighbour

CELLS_PER_GATE = 3
"""Cells of the search grid across half a gate: fewer compare pairs that are too far apart, more visit empty cells."""

MOST_CELLS, MOST_CELLS_A_SIDE = 16384, 4096
"""Of the search grid, so that one stray measurement does not make it large; 64 kB."""


def _grid(position: Floats, cell: float) -> tuple[Array, Array, Floats]:
    """Measurements sorted into square cells: first row of each cell (CSR), the rows, (west, south, cell, nx, ny)."""
    west, south = position.min(axis=0)
    wide, high = position.max(axis=0) - (west, south)
    cell = max(
        cell,
        math.sqrt(max(wide, 1.0) * max(high, 1.0) / MOST_CELLS),
        wide / MOST_CELLS_A_SIDE,
        high / MOST_CELLS_A_SIDE,
    )
    nx, ny = int(wide / cell) + 1, int(high / cell) + 1
    start, order = np.zeros(nx * ny + 1, np.int32), np.empty(len(position), np.int32)
    _sort_cells(position, west, south, cell, nx, start, order)
    return start, order, np.array([west, south, cell, nx, ny], dtype=np.float64)


@allocating
def _sort_cells(position: Floats, west: float, south: float, cell: float, nx: int, start: Array, order: Array) -> None:
    m = len(position)
    where = np.empty(m, np.int32)
    for j in range(m):
        where[j] = int((position[j, 1] - south) / cell) * nx + int((position[j, 0] - west) / cell)
        start[where[j] + 1] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    filled = start.copy()
    for j in range(m):
        order[filled[where[j]]] = j
        filled[where[j]] += 1


@allocating
def _gate(
    time: Floats, state: Floats, cov: Floats, window: Floats, extent: Floats, m_time: Floats, m_position: Floats,
    m_noise: Floats, gate: float, max_gate: float, extent_sd: float, start: Array, order: Array, grid: Floats,
    first: Array, pair: Array, squared: Floats, log_det: Floats, fill: bool,
) -> int:  # fmt: skip
    west, south, cell, nx, ny = grid[0], grid[1], grid[2], int(grid[3]), int(grid[4])
    widest = 0.0
    for j in range(len(m_time)):
        widest = max(widest, m_noise[j, 0, 0] + m_noise[j, 1, 1])
    k = 0
    for i in range(len(time)):
        x, p = state[i], cov[i]
        along, across = (extent_sd * extent[i, 0]) ** 2, (extent_sd * extent[i, 1]) ** 2
        se, ce = math.sin(extent[i, 2]), math.cos(extent[i, 2])
        a00 = p[0, 0] + along * se * se + across * ce * ce
        a01 = p[0, 1] + (along - across) * se * ce
        a11 = p[1, 1] + along * ce * ce + across * se * se
        reach = min(math.sqrt(gate * (a00 + a11 + widest)), max_gate)
        reach += window[i] * math.sqrt(x[2] * x[2] + x[3] * x[3])
        x_from, x_to = _span(x[0] - reach - west, x[0] + reach - west, cell, nx)
        y_from, y_to = _span(x[1] - reach - south, x[1] + reach - south, cell, ny)
        for cy in range(y_from, y_to):
            for o in range(start[cy * nx + x_from], start[cy * nx + x_to] if x_to > x_from else 0):
                j = order[o]
                dt = m_time[j] - time[i]
                if abs(dt) > window[i]:
                    continue
                v0 = m_position[j, 0] - x[0] - dt * x[2]
                v1 = m_position[j, 1] - x[1] - dt * x[3]
                if v0 * v0 + v1 * v1 > max_gate * max_gate:
                    continue
                s00, s01, s11 = a00 + m_noise[j, 0, 0], a01 + m_noise[j, 0, 1], a11 + m_noise[j, 1, 1]
                det = s00 * s11 - s01 * s01
                d2 = (v0 * v0 * s11 - 2.0 * v0 * v1 * s01 + v1 * v1 * s00) / det
                if d2 <= gate:
                    if fill:
                        pair[k], squared[k], log_det[k] = j, d2, math.log(det)
                    k += 1
        first[i + 1] = k
    return k


@allocating
def _span(low: float, high: float, cell: float, cells: int) -> tuple[int, int]:
    """Cells [from, to) that an interval touches."""
    if high < 0.0 or low > cells * cell:
        return 0, 0
    return max(int(low / cell), 0) if low > 0.0 else 0, min(int(high / cell) + 1, cells)


@allocating
def _taken(first: Array, pair: Array, squared: Floats, chosen: NDArray[np.int32], distance: Floats) -> None:
    for i in range(len(chosen)):
        for k in range(first[i], first[i + 1]):
            if pair[k] == chosen[i]:
                distance[i] = squared[k]
