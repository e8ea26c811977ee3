"""Global nearest neighbour: gating on a grid, then the one best assignment of all tracks together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.contracts.associate import Association, Expected
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.assignment import assign_sparse
from pipeline.kernels.cells import sort_into_cells, span
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

    @property
    def branching(self) -> bool:
        """It keeps one hypothesis of a target."""
        return False

    def __call__(self, expected: Expected, measured: Measured, tracks: Array, plots: Array) -> Association:
        """One hypothesis a track, a measurement serves one track at most. O(pairs) memory. See `AssociatePart`."""
        n = len(tracks)
        first, plot_first, plot = np.zeros(n + 1, np.int32), np.zeros(n + 1, np.int32), np.empty(n, np.int32)
        room = PAIRS_PER_TRACK * n
        while True:
            pair, squared, cost = np.empty(room, np.int32), np.empty(room), np.empty(room)
            pairs, taken = _associate(
                expected.time, expected.mean, expected.covariance, expected.window, expected.extent, expected.penalty,
                tracks, measured.time, measured.position, measured.noise, plots, self.gate, self.max_gate_m,
                self.extent_sd, self.log_likelihood_ratio, first, pair, squared, cost, plot_first, plot,
            )  # fmt: skip
            if pairs <= room:
                break
            room = pairs
        hypotheses = Hypotheses(np.arange(n + 1, dtype=np.int32), plot_first, plot[:taken], np.zeros(n))
        return Association(hypotheses, first, pair[:pairs], cost[:pairs], squared[:pairs], NONE_ENDED)

    def reach(self, expected: Expected, measured: Measured) -> Floats:
        """(n,) m that the gate of each track reaches at most. See `AssociatePart`."""
        made = np.empty(len(expected.time))
        _reach(expected.covariance, expected.extent, measured.noise, self.gate, self.max_gate_m, self.extent_sd, made)
        return made


PART = GlobalNearestNeighbour

NONE_ENDED = np.zeros(0, np.int32)

CELLS_PER_GATE = 3
"""Cells of the search grid across half a gate: fewer compare pairs that are too far apart, more visit empty cells."""

PAIRS_PER_TRACK = 4
"""Room for pairs at first; where more lie in the gates, it is asked for again."""


@allocating
def _associate(
    time: Floats, mean: Floats, cov: Floats, window: Floats, extent: Floats, penalty: Floats, tracks: Array,
    m_time: Floats, m_position: Floats, m_noise: Floats, plots: Array, gate: float, max_gate: float,
    extent_sd: float, log_likelihood_ratio: float, first: Array, pair: Array, squared: Floats, cost: Floats,
    plot_first: Array, taken: Array,
) -> tuple[int, int]:  # fmt: skip
    """Write the pairs and what is taken; how many of both. With more pairs than there is room for: only how many."""
    n = len(tracks)
    if n == 0 or len(plots) == 0:
        return 0, 0
    start, order, grid = sort_into_cells(m_position, plots, max_gate / CELLS_PER_GATE)
    widest = 0.0
    for j in plots:
        widest = max(widest, m_noise[j, 0, 0] + m_noise[j, 1, 1])
    k = 0
    for a in range(n):
        made = _gate_track(
            tracks[a], time, mean, cov, window, extent, m_time, m_position, m_noise, gate, max_gate, extent_sd,
            widest, start, order, grid, pair[k:], squared[k:], cost[k:],
        )  # fmt: skip
        for o in range(k, min(k + made, len(pair))):
            cost[o] += penalty[tracks[a]] - log_likelihood_ratio
        k += made
        first[a + 1] = k
    if k > len(pair):
        return k, 0
    where, column = np.empty(len(m_time), np.int32), np.empty(k, np.int32)
    for o in range(len(plots)):
        where[plots[o]] = o
    for o in range(k):
        column[o] = where[pair[o]]
    chosen = np.empty(n, np.int32)
    assign_sparse(first, column, cost[:k], len(plots), chosen)
    count = 0
    for a in range(n):
        if chosen[a] >= 0:
            taken[count] = plots[chosen[a]]
            count += 1
        plot_first[a + 1] = count
    return k, count


@allocating
def _reach(
    cov: Floats, extent: Floats, m_noise: Floats, gate: float, max_gate: float, extent_sd: float, out: Floats
) -> None:
    widest = 0.0
    for j in range(len(m_noise)):
        widest = max(widest, m_noise[j, 0, 0] + m_noise[j, 1, 1])
    for i in range(len(out)):
        spread = extent_sd * extent_sd * (extent[i, 0] * extent[i, 0] + extent[i, 1] * extent[i, 1])
        out[i] = min(math.sqrt(gate * (cov[i, 0, 0] + cov[i, 1, 1] + spread + widest)), max_gate)


@allocating
def _gate_track(
    i: int, time: Floats, mean: Floats, cov: Floats, window: Floats, extent: Floats, m_time: Floats,
    m_position: Floats, m_noise: Floats, gate: float, max_gate: float, extent_sd: float, widest: float,
    start: Array, order: Array, grid: Floats, pair: Array, squared: Floats, cost: Floats,
) -> int:  # fmt: skip
    """The measurements in the gate of track i, with d^2 and d^2 + ln|S|, as far as there is room; how many."""
    west, south, cell, nx, ny = grid[0], grid[1], grid[2], int(grid[3]), int(grid[4])
    x, p = mean[i], cov[i]
    along, across = (extent_sd * extent[i, 0]) ** 2, (extent_sd * extent[i, 1]) ** 2
    se, ce = math.sin(extent[i, 2]), math.cos(extent[i, 2])
    a00 = p[0, 0] + along * se * se + across * ce * ce
    a01 = p[0, 1] + (along - across) * se * ce
    a11 = p[1, 1] + along * ce * ce + across * se * se
    reach = min(math.sqrt(gate * (a00 + a11 + widest)), max_gate)
    reach += window[i] * math.sqrt(x[2] * x[2] + x[3] * x[3])
    x_from, x_to = span(x[0] - reach - west, x[0] + reach - west, cell, nx)
    y_from, y_to = span(x[1] - reach - south, x[1] + reach - south, cell, ny)
    k = 0
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
                if k < len(pair):
                    pair[k], squared[k], cost[k] = j, d2, d2 + math.log(det)
                k += 1
    return k
