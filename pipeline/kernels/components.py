"""Connected components over an endless strip of sweeps: runs come in row by row, components go out when nothing can
join.

The window holds the runs of the newest `reach + 1` rows; a component is complete when its last row leaves the window.
All rows are absolute (scan * azimuths + row), so north is a row like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.kernels.bits import borrowed, trailing_zeros
from pipeline.kernels.plot_shape import COLUMNS, Geometry, measure_plot
from pipeline.kernels.runs import (
    END,
    FIELDS,
    FIRST,
    FREE,
    GRID,
    LAST,
    NEXT,
    PARENT,
    PEAK,
    REACH,
    ROW,
    START,
    SUM,
    TAIL,
    find,
    unite,
)
from pipeline.state import ArrayState, read_only, remembered
from pipeline.tables import Detections, Sweeps

NEWEST, OLDEST, UNUSED, DROPPED, CUT, SMALL, CELLS = range(7)
"""Places in `ComponentState.numbers`: newest row, oldest row with runs in the window, free runs in the pool, and
counts."""

NEVER = np.iinfo(np.int64).max


@dataclass(eq=False, kw_only=True)
class ComponentState(ArrayState):
    """The open components. closed_row: see `pipeline.extract`."""

    out: NDArray[np.float64]
    radar: NDArray[np.int64] = remembered()
    runs: NDArray[np.int64] = remembered()
    unused: NDArray[np.int64] = remembered()
    window: NDArray[np.int64] = remembered()
    window_rows: NDArray[np.int64] = remembered()
    numbers: NDArray[np.int64] = remembered()
    turn: NDArray[np.float64] = remembered()
    azimuth: NDArray[np.float64] = remembered()

    @classmethod
    def empty_arrays(
        cls, azimuths: int, ranges: int, reach: int, rings: int, open_runs: int
    ) -> dict[str, NDArray[Any]]:
        """The arrays of a state in which nothing is open: keyword arguments for a subclass."""
        a_row = (ranges + 1) // 2 + rings
        runs = np.zeros((open_runs, FIELDS), np.int64)
        runs[:, PARENT] = FREE
        return {
            "out": np.zeros((min((reach + 1) * a_row, open_runs) + 256, COLUMNS)),
            "radar": np.zeros(1, np.int64),
            "runs": runs,
            "unused": np.arange(open_runs - 1, -1, -1, dtype=np.int64),
            "window": np.zeros((reach + 1, a_row), np.int64),
            "window_rows": np.tile(np.array([-1, 0], np.int64), (reach + 1, 1)),
            "numbers": np.array([-1, NEVER, open_runs, 0, 0, 0, 0], np.int64),
            "turn": np.zeros((3, azimuths)),
            "azimuth": np.full(azimuths, np.nan),
        }

    @property
    def closed_row(self) -> int:
        """First absolute row that an open plot, or one still to come, may have."""
        return int(_closed_row(self.runs, self.window, self.window_rows, self.numbers))

    @property
    def counters(self) -> dict[str, int]:
        """Cells in plots, and what was left out or cut, by reason."""
        n = self.numbers
        return {
            "cells_detected": int(n[CELLS]),
            "plots_below_min_cells": int(n[SMALL]),
            "plots_cut_at_max_extent": int(n[CUT]),
            "runs_dropped": int(n[DROPPED]),
        }


def extract_block(
    sweeps: Sweeps,
    detections: Detections,
    state: ComponentState,
    first_row: int,
    reach_of_cell: NDArray[np.int64],
    limits: tuple[int, int],
    geometry: Geometry,
) -> NDArray[np.float64]:
    """Take in a block and give the output rows (n, COLUMNS) of the plots that it completed.

    first_row: scan * azimuths. reach_of_cell: (ranges + 1) link distance of each range cell, falling; 0 past the last.
    limits: (fewest cells of a plot, most rows of a plot).
    """
    arguments = (
        read_only(sweeps.amplitude),
        read_only(sweeps.row, np.int64),
        read_only(sweeps.azimuth),
        read_only(sweeps.time),
        read_only(detections.mask),
    )
    done, made, out = 0, [], state.out
    while done < len(sweeps):
        done, count = _take_rows(
            done,
            arguments,
            first_row,
            reach_of_cell,
            limits,
            (state.runs, state.unused, state.window, state.window_rows, state.numbers),
            (state.turn, state.azimuth),
            (geometry.constants, geometry.sums),
            out,
        )
        if count:
            made.append(out[:count].copy())
    return made[0] if len(made) == 1 else np.concatenate(made) if made else out[:0]


def flush_components(state: ComponentState, limits: tuple[int, int], geometry: Geometry) -> NDArray[np.float64]:
    """Complete all open components; the output rows as in extract_block."""
    pool = (state.runs, state.unused, state.window, state.window_rows, state.numbers)
    after = int(state.numbers[NEWEST]) + state.window.shape[0]
    count = _retire(after, pool, limits, state.turn, (geometry.constants, geometry.sums), state.out, 0)
    return state.out[:count].copy()


@njit(nogil=True, cache=True)
def _take_rows(
    done: int,
    block: Any,
    first_row: int,
    reach_of_cell: Any,
    limits: Any,
    pool: Any,
    sweep: Any,
    geometry: Any,
    out: Any,
) -> tuple[int, int]:
    amplitude, mask = borrowed(block[0]), borrowed(block[4])
    rows, azimuths, times = borrowed(block[1]), borrowed(block[2]), borrowed(block[3])
    runs, unused = borrowed(pool[0]), borrowed(pool[1])
    window, window_rows, numbers = borrowed(pool[2]), borrowed(pool[3]), borrowed(pool[4])
    reach_of_cell, out = borrowed(reach_of_cell), borrowed(out)
    turn, azimuth = borrowed(sweep[0]), borrowed(sweep[1])
    pool = (runs, unused, window, window_rows, numbers)
    geometry = (geometry[0], borrowed(geometry[1]))
    count = 0
    words = mask.shape[1]
    cells = amplitude.shape[1]
    depth = window.shape[0]
    while done < rows.size:
        bits = mask[done]
        row = first_row + rows[done]
        if numbers[UNUSED] < runs.shape[0] and numbers[OLDEST] <= row - depth:
            if count + min(runs.shape[0] - numbers[UNUSED], window.size) > out.shape[0]:
                return done, count
            count = _retire(row, pool, limits, turn, geometry, out, count)
        numbers[NEWEST] = row
        anything = np.uint64(0)
        for w in range(words):
            anything |= bits[w]
        if anything:
            i = rows[done]
            if azimuth[i] != azimuths[done]:
                azimuth[i] = azimuths[done]
                turn[0, i], turn[1, i] = np.sin(azimuths[done]), np.cos(azimuths[done])
            turn[2, i] = times[done]
            slot = row % depth
            n = _find_runs(bits, amplitude[done], row, i, reach_of_cell, cells, pool, window[slot])
            if n:
                if numbers[UNUSED] + n == runs.shape[0]:
                    numbers[OLDEST] = row
                window_rows[slot, 0] = row
                window_rows[slot, 1] = n
                _link_rows(row, slot, n, limits[1], pool)
        done += 1
    return done, count


@njit(nogil=True, cache=True)
def _find_runs(
    bits: Any, cells: Any, row: int, grid_row: int, reach_of_cell: Any, ranges: int, pool: Any, slot: Any
) -> int:
    runs, unused, numbers = pool[0], pool[1], pool[4]
    one, top = np.uint64(1), np.uint64(63)
    n = 0
    start: Any = -1
    carry = np.uint64(0)
    for w in range(bits.size + 1):
        word = bits[w] if w < bits.size else np.uint64(0)
        turns = word ^ ((word << one) | carry)
        carry = word >> top
        while turns:
            at = min(64 * w + np.int64(trailing_zeros(turns)), ranges)
            turns &= turns - one
            if start < 0:
                start = at
                continue
            while start < at:
                reach = reach_of_cell[start]
                end = start + 1
                total, peak = np.int64(cells[start]), np.int64(cells[start])
                while end < at and reach_of_cell[end] == reach:
                    value = np.int64(cells[end])
                    total += value
                    peak = max(peak, value)
                    end += 1
                if numbers[UNUSED] == 0:
                    numbers[DROPPED] += 1
                else:
                    numbers[UNUSED] -= 1
                    run = unused[numbers[UNUSED]]
                    runs[run, ROW], runs[run, START], runs[run, END] = row, start, end
                    runs[run, SUM], runs[run, PEAK], runs[run, REACH] = total, peak, reach
                    runs[run, PARENT], runs[run, NEXT], runs[run, TAIL] = run, -1, run
                    runs[run, FIRST], runs[run, LAST], runs[run, GRID] = row, row, grid_row
                    slot[n] = run
                    n += 1
                start = end
            start = -1
    return n


@njit(nogil=True, cache=True)
def _link_rows(row: int, slot_of_row: int, n: int, most_rows: int, pool: Any) -> None:
    runs, window, window_rows = pool[0], pool[2], pool[3]
    depth = window.shape[0]
    slot = window[slot_of_row]
    # a run's two neighbours in its own row are enough: the reach falls with range, so what links over a run links to it
    for k in range(1, n):
        if runs[slot[k], START] - runs[slot[k - 1], END] < runs[slot[k], REACH]:
            unite(runs, slot[k - 1], slot[k])
    other = slot_of_row
    for back in range(1, runs[slot[0], REACH] + 1):
        other = other - 1 if other else depth - 1
        if window_rows[other, 0] != row - back:
            continue
        before, m = window[other], window_rows[other, 1]
        p = 0
        for k in range(n):
            run = slot[k]
            reach = runs[run, REACH] - back
            if reach < 0:
                break
            start, end = runs[run, START], runs[run, END]
            while p < m and start - runs[before[p], END] >= reach:
                p += 1
            q = p
            while q < m:
                old = before[q]
                gap = runs[old, START] - end + 1
                if gap > 0 and gap > runs[old, REACH] - back:
                    break
                if row - runs[find(runs, old), FIRST] < most_rows:
                    unite(runs, old, run)
                q += 1


@njit(nogil=True, cache=True)
def _retire(row: int, pool: Any, limits: Any, turn: Any, geometry: Any, out: Any, count: int) -> Any:
    """Complete the components whose last row can no longer be reached from `row`."""
    runs, unused, window, window_rows, numbers = pool
    fewest, most_rows = limits
    constants, sums = geometry
    depth = window.shape[0]
    while numbers[OLDEST] <= row - depth:
        old = numbers[OLDEST]
        slot = old % depth
        for k in range(window_rows[slot, 1]):
            run = window[slot, k]
            if runs[run, PARENT] == FREE:
                continue
            root = find(runs, run)
            if runs[root, LAST] != old:
                continue
            total = 0
            one = root
            while one >= 0:
                total += runs[one, END] - runs[one, START]
                one = runs[one, NEXT]
            numbers[CELLS] += total
            numbers[CUT] += runs[root, LAST] - runs[root, FIRST] + 1 >= most_rows
            if total >= fewest:
                measure_plot(root, runs, turn, constants, sums, out[count])
                count += 1
            else:
                numbers[SMALL] += 1
            one = root
            while one >= 0:
                runs[one, PARENT] = FREE
                unused[numbers[UNUSED]] = one
                numbers[UNUSED] += 1
                one = runs[one, NEXT]
        window_rows[slot, 0] = -1
        numbers[OLDEST] = NEVER
        for other in range(depth):
            if window_rows[other, 0] >= 0:
                numbers[OLDEST] = min(numbers[OLDEST], window_rows[other, 0])
    return count


@njit(nogil=True, cache=True)
def _closed_row(runs: Any, window: Any, window_rows: Any, numbers: Any) -> Any:
    closed = numbers[NEWEST] + 1
    if numbers[UNUSED] == runs.shape[0]:
        return closed
    for slot in range(window.shape[0]):
        if window_rows[slot, 0] < 0:
            continue
        for k in range(window_rows[slot, 1]):
            closed = min(closed, runs[find(runs, window[slot, k]), FIRST])
    return closed
