"""Connected components over an endless strip of sweeps: runs come in row by row, components go out when nothing can
join.

All rows are absolute (scan * azimuths + row), so north is a row like any other. The newest `rule.rows` rows are the
window that a new run may link to; a component is complete when its last row leaves it.

How to use it: make a `LinkRule` (a table of how far apart two cells of a plot may lie) and
`ComponentState.of(site, rule, ...)`; then `take_block(sweeps, detections, state)` and `flush(state)` give plots.
To grow plots out of detected cells make a `GrowthWindow` and a `GrowthState.growing(site, rule, window, ...)`; then
`take_grown_block` and `flush_grown` (all in `pipeline.kernels.growth`) use the cells of `Detections.growth` near
detected ones, and what holds no detected cell is left out and counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.kernels.bits import fetch_ahead, trailing_zeros
from pipeline.kernels.compiled import inlined, kernel
from pipeline.kernels.component_state import (
    CELLS,
    CUT,
    DROPPED,
    HEAD,
    LATEST,
    MOVE,
    NEVER,
    NEWEST,
    RETIRED,
    SEEDLESS,
    SMALL,
    TAIL,
    TAKEN,
    ComponentState,
)
from pipeline.kernels.plot_shape import (
    AZIMUTH,
    BEARING_CELLS,
    BEFORE,
    COSINE,
    GIVEN,
    SCAN,
    SINE,
    TIME,
    measure_plot,
    measure_run,
)
from pipeline.kernels.runs import FREE, filled_from, find, find_runs, unite
from pipeline.state import read_only
from pipeline.tables import Detections, Plots, Sweeps

AHEAD = 8
"""Rows between asking for cells and reading them."""


def take_block(sweeps: Sweeps, detections: Detections, state: ComponentState) -> Plots:
    """Take in a block and give the plots that it completed; they are made of the detected cells."""
    block = (
        read_only(detections.mask),
        read_only(sweeps.amplitude),
        read_only(sweeps.row, np.int64),
        read_only(sweeps.azimuth),
        read_only(sweeps.time),
    )
    if not len(sweeps):
        return Plots.empty()
    state.radar[0] = sweeps.radar
    state.numbers[TAKEN] = 0
    first_row = sweeps.scan * state.azimuths
    made = []
    while state.numbers[TAKEN] <= len(sweeps):
        columns = state.columns()
        count = _take_rows(
            block, first_row, state.azimuths, state.rule.arrays, state.limits, state.pool, state.scale, columns.arrays
        )
        made.append(columns.table(sweeps.radar, count))
    state.room[0] = sum(len(one) for one in made)
    return Plots.concatenate(made)


def flush(state: ComponentState) -> Plots:
    """Complete all open components."""
    columns = state.columns()
    state.latest[0] = NEVER
    after = int(state.numbers[NEWEST]) + len(state.window) + 1
    geometry = state.scale[:3]
    count = retire(after, state.azimuths, state.rule.rows, state.limits, state.pool, geometry, columns.arrays, 0)
    return columns.table(int(state.radar[0]), int(count))


@kernel
def _take_rows(
    block: Any, first_row: int, azimuths: int, rule: Any, limits: Any, pool: Any, scale: Any, out: Any
) -> Any:
    mask, amplitude, rows, azimuth, times = block
    numbers = pool[3]
    reach_rows = rule[2].shape[1] - 1
    geometry = (scale[0], scale[1], scale[2])
    count = 0
    done = numbers[TAKEN]
    filled = np.uint64(0)  # bit k: whether the row after the next k has runs
    for soon in range(done, min(done + AHEAD, rows.size)):
        filled |= np.uint64(fetch_row(mask[soon], amplitude, soon)) << np.uint64(soon - done)
    while done <= rows.size:
        at_end = done == rows.size
        bits = mask[done - at_end]
        if not at_end:
            if done + AHEAD < rows.size:
                filled |= np.uint64(fetch_row(mask[done + AHEAD], amplitude, done + AHEAD)) << np.uint64(AHEAD)
            here = filled & np.uint64(1)
            filled >>= np.uint64(1)
            if not here:
                done += 1
                continue
        if count + open_runs(numbers) > out[0].shape[1]:
            break
        grid_row = rows[done - at_end]
        row = first_row + grid_row
        count = retire(row, azimuths, reach_rows, limits, pool, geometry, out, count)
        if at_end:
            numbers[NEWEST] = row
        else:
            note_row(row, grid_row, azimuth[done], times[done], scale[0], pool[4])
            take_row(row, grid_row, azimuths, bits, bits, False, amplitude[done], rule, limits, pool, scale)
        done += 1
    numbers[TAKEN] = done
    return count


@inlined
def fetch_row(bits: Any, amplitude: Any, at: int) -> bool:
    """Ask for the cells under a row's bits: waiting for them costs more than all the rest. Tells whether there are
    any."""
    cells = amplitude.ctypes.data + np.uintp(at) * np.uintp(amplitude.shape[1])
    anything = False
    for block in range(0, bits.size, 8):
        filled = np.uint64(filled_from(bits, block))
        anything |= filled != np.uint64(0)
        while filled:
            fetch_ahead(cells + np.uintp(64 * block) + np.uintp(64) * np.uintp(trailing_zeros(filled)))
            filled &= filled - np.uint64(1)
    return anything


@inlined
def open_runs(numbers: Any) -> Any:
    """Runs in the rows of open plots: no more plots than these can become complete before the next row is taken."""
    return numbers[HEAD] - numbers[TAIL]


@inlined
def note_row(row: int, grid_row: int, azimuth: float, time: float, constants: Any, turn: Any) -> None:
    """Remember when and where a row with runs was swept."""
    here = turn[grid_row]
    if here[GIVEN] != azimuth:
        here[GIVEN] = azimuth
        here[SINE], here[COSINE] = np.sin(azimuth), np.cos(azimuth)
        here[AZIMUTH] = azimuth % (2 * np.pi)
        here[BEFORE] = 0.5 - here[AZIMUTH] / constants[4]
    here[TIME] = time
    here[SCAN] = np.rint((row + here[BEFORE]) * (1.0 / constants[6]))


@inlined
def take_row(
    row: int,
    grid_row: int,
    azimuths: int,
    bits: Any,
    seeds: Any,
    grown: bool,
    cells: Any,
    rule: Any,
    limits: Any,
    pool: Any,
    scale: Any,
) -> None:
    """Add the runs of a row to the pool and link them to those of the rows before; retire() comes first."""
    runs, window, latest, numbers, _ = pool
    if numbers[TAIL] >= MOVE and 2 * numbers[TAIL] >= numbers[HEAD]:
        _move_down(runs, window, latest, numbers)
    first = numbers[HEAD]
    room = limits[2] - (first - numbers[TAIL])
    head, dropped = find_runs(bits, seeds, grown, cells, grid_row, rule, scale, runs, first, room)
    numbers[DROPPED] += dropped
    if head == first:
        return
    numbers[HEAD] = head
    numbers[LATEST] = row
    slot = row & (window.shape[0] - 1)
    window[slot, 0], window[slot, 1], window[slot, 2] = row, first, head
    latest_row, latest_run = latest[0], latest[1]
    _link_runs(row, grid_row, azimuths, first, head, limits[1], rule, runs, latest_row, latest_run)
    for run in range(first, head):
        one = runs[np.uintp(run)]
        for cell in range(np.uintp(one.start), np.uintp(one.end)):
            latest_row[cell] = row
            latest_run[cell] = run


@inlined
def _link_runs(
    row: int,
    grid_row: int,
    azimuths: int,
    first: int,
    head: int,
    most_rows: int,
    rule: Any,
    runs: Any,
    latest_row: Any,
    latest_run: Any,
) -> None:
    # The newest cell at each range is enough: an older one at that range that links to a run links to the newest, too
    # (or was refused, as its plot is too long already).
    ring_of_cell, _, reach, depth, _ = rule
    for run in range(first, head):
        one = runs[np.uintp(run)]
        start, end, ring = np.int64(one.start), np.int64(one.end), np.int64(one.ring)
        most, oldest = reach[ring, 1], row - depth[ring]
        linked, mine = np.int64(-1), np.int64(run)
        after, stop = max(start - most, 0), min(end + most, latest_row.size)
        while after < stop:
            cell = np.uintp(after)
            after += 1
            if latest_row[cell] < oldest or latest_run[cell] == linked:
                continue
            back = row - latest_row[cell]
            at = np.int64(cell)
            gap = start - at if at < start else max(at - end + 1, 0)
            if gap > reach[ring if at < end else ring_of_cell[cell], back]:
                continue
            linked = latest_run[cell]
            if back == 1:  # no newer cell before the end of that run
                after = np.int64(runs[np.uintp(linked)].end)
            mine = find(runs, mine)
            other = find(runs, linked)
            if other != mine:
                rows = grid_row - np.int64(runs[other].row)
                rows += 0 if rows >= 0 else azimuths
                if rows < most_rows:
                    mine = unite(runs, mine, other, grid_row)


@kernel
def _move_down(runs: Any, window: Any, latest: Any, numbers: Any) -> None:
    by, head = numbers[TAIL], numbers[HEAD]
    for k in range(by, head):
        runs[k - by] = runs[k]
        if runs[k].parent != FREE:
            runs[k - by].parent = runs[k].parent - by
            runs[k - by].next = runs[k].next - by
    for slot in range(window.shape[0]):
        window[slot, 1] -= by
        window[slot, 2] -= by
    for cell in range(latest.shape[1]):
        latest[1, cell] -= by
    numbers[TAIL] = 0
    numbers[HEAD] = head - by


@inlined
def retire(
    row: int, azimuths: int, reach_rows: int, limits: Any, pool: Any, geometry: Any, out: Any, count: int
) -> Any:
    """Complete the components whose last row can no longer be reached from `row`: those that have cells enough, a
    detected one among them, are written from output row `count` on. Gives the new count."""
    runs, window, _, numbers, turn = pool
    constants, ground, sums = geometry[0], geometry[1], geometry[2]
    axis_cells = np.int64(np.ceil(BEARING_CELLS * constants[5] / constants[4]))
    until = row - reach_rows - 1
    if numbers[HEAD] == numbers[TAIL]:
        numbers[HEAD] = numbers[TAIL] = 0
        numbers[RETIRED] = until
        return count
    for old in range(numbers[RETIRED] + 1, min(until, numbers[LATEST]) + 1):
        slot = old & (window.shape[0] - 1)
        if window[slot, 0] != old:
            continue
        window[slot, 0] = -1
        for run in range(window[slot, 1], window[slot, 2]):
            one = runs[np.uintp(run)]
            if one.parent == FREE:
                continue
            alone = one.next == run
            root = np.int64(run) if alone else find(runs, np.int64(run))
            if runs[root].last != one.row:
                continue
            total, seeds = np.int64(runs[root].cells), np.int64(runs[root].seeds)
            numbers[CELLS] += total
            if total < limits[0] or seeds == 0:
                numbers[SMALL if seeds else SEEDLESS] += 1
                _free(root, runs)
                continue
            if alone and total < axis_cells:
                measure_run(one, turn, (constants, ground, sums), out, count)
                one.parent = FREE
            else:
                rows = np.int64(one.row) - np.int64(runs[root].row)
                rows += 1 if rows >= 0 else azimuths + 1
                numbers[CUT] += rows >= limits[1]
                measure_plot(root, old, runs, turn, (constants, ground, sums), out, count)
            count += 1
    numbers[RETIRED] = until
    tail = numbers[TAIL]
    while tail < numbers[HEAD] and runs[tail].parent == FREE:
        tail += 1
    numbers[TAIL] = tail
    return count


@kernel
def _free(root: int, runs: Any) -> None:
    run = np.int64(root)
    while True:
        runs[run].parent = FREE
        run = np.int64(runs[run].next)
        if run == root:
            return
