"""Growth of plots out of detected cells: a cell over a lower threshold counts where a detected cell is near.

Near is what links the cells of plots, too: at most so many azimuth rows away, in the same range cell or the next. So
growth reaches no further than that from a detected cell and cannot wander through clutter, of which some percent of the
cells lie over the lower threshold. A row can be looked at only when the rows after it are known, and plots come later
by the height of the window. The result does not depend on how the sweeps were cut into blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.bits import count_runs, trailing_zeros
from pipeline.kernels.compiled import inlined, kernel
from pipeline.kernels.component_state import NEWEST, TAKEN, ComponentState
from pipeline.kernels.components import fetch_row, flush, note_row, open_runs, retire, take_row
from pipeline.kernels.links import LinkRule
from pipeline.kernels.run_cap import CapSettings
from pipeline.kernels.runs import filled_from
from pipeline.sites import RadarSite
from pipeline.state import read_only, remembered
from pipeline.tables import Detections, Plots, Sweeps, VideoFormat

ARRIVED, PENDING, FILLED, SKIPPED = range(4)
"""Places in `GrowthState.marks`: newest row that came in, first row not yet looked at, row up to which the bucket of
runs was filled, and a count."""


@dataclass(frozen=True, eq=False)
class GrowthWindow:
    """masks: (rows + 1, words + 1) the range cells at which a cell that many rows away is near; the last word is empty.
    rows: (words) how far off rows are near at the first cell of each word. max_runs: cap on the runs that grow in a
    turn; a row that does not fit keeps its detected cells only, counted.
    """

    masks: NDArray[np.uint64]
    rows: NDArray[np.int64]
    max_runs: int

    @classmethod
    def of(cls, video: VideoFormat, rule: LinkRule, max_runs: int) -> GrowthWindow:
        """The window that links the cells of plots: for a rule over no more than the next range cell."""
        near = np.zeros((rule.rows + 1, 64 * (video.words + 1)), np.bool_)
        near[:, : video.ranges] = (rule.reach[rule.ring_of_cell] >= 0).T
        masks = np.packbits(near, axis=1, bitorder="little").view(np.uint64)
        rows = near[:, : 64 * video.words : 64].sum(axis=0) - 1
        return cls(masks, rows.astype(np.int64), max_runs)


@dataclass(eq=False, kw_only=True)
class GrowthState(ComponentState):
    """The open components, and the rows that wait for what comes after them: those of the present block stay in it,
    and are held here only from one block to the next.

    held_near: the cells near detected ones of the row that stands at the same place in near_rows, also of rows that
    are still to come.
    """

    near: GrowthWindow
    scratch: NDArray[np.uint64]
    waiting: NDArray[np.int64]
    held_cells: NDArray[np.uint8] = remembered()
    held_growth: NDArray[np.uint64] = remembered()
    held_seeds: NDArray[np.uint64] = remembered()
    held_near: NDArray[np.uint64] = remembered()
    near_rows: NDArray[np.int64] = remembered()
    held_sweep: NDArray[np.float64] = remembered()
    held_rows: NDArray[np.int64] = remembered()
    marks: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()

    @classmethod
    def growing(cls, site: RadarSite, rule: LinkRule, near: GrowthWindow, **limits: Any) -> GrowthState:
        """A state in which nothing is open. limits: as in ComponentState.of."""
        video = site.video
        slots, places = 1 << len(near.masks).bit_length(), 1 << (2 * len(near.masks)).bit_length()
        made = cls.of(
            site,
            rule,
            near=near,
            scratch=np.zeros(video.words, np.uint64),
            waiting=np.full(slots, -1, np.int64),
            held_cells=np.zeros((slots, video.ranges), np.uint8),
            held_growth=np.zeros((slots, video.words), np.uint64),
            held_seeds=np.zeros((slots, video.words), np.uint64),
            held_near=np.zeros((places, video.words), np.uint64),
            near_rows=np.full(places, -1, np.int64),
            held_sweep=np.zeros((slots, 2)),
            held_rows=np.full(slots, -1, np.int64),
            marks=np.array([-1, 0, 0, 0], np.int64),
            budget=np.array([CapSettings.of(near.max_runs, video.azimuths).depth]),
            **limits,
        )
        assert isinstance(made, GrowthState)
        return made

    @property
    def counters(self) -> dict[str, int]:
        """As in ComponentState, and the rows in which nothing could grow for the cap."""
        return {**super().counters, "growth_rows_skipped": int(self.marks[SKIPPED])}

    @property
    def held(self) -> tuple[Any, ...]:
        """What the kernels change."""
        return (
            self.held_rows, self.held_sweep, self.held_near, self.marks, self.budget, self.scratch, self.waiting,
            self.held_seeds, self.held_growth, self.held_cells, self.near_rows,
        )  # fmt: skip

    @property
    def box(self) -> tuple[Any, ...]:
        """The window, and the bucket."""
        cap = CapSettings.of(self.near.max_runs, self.azimuths)
        return self.near.masks, self.near.rows, cap.refill, cap.depth


def take_grown_block(sweeps: Sweeps, detections: Detections, state: GrowthState) -> Plots:
    """Take in a block and give the plots that became complete; they are made of the cells of `Detections.growth` near
    detected ones (of the detected ones alone where the detector gives no growth)."""
    growth = detections.mask if detections.growth is None else detections.growth
    block = (
        read_only(detections.mask),
        read_only(growth),
        read_only(sweeps.amplitude),
        read_only(sweeps.row, np.int64),
        read_only(sweeps.azimuth),
        read_only(sweeps.time),
    )
    state.radar[0] = sweeps.radar
    return _run(block, sweeps.scan * state.azimuths, state)


def flush_grown(state: GrowthState) -> Plots:
    """Complete all open components, with the rows that still wait."""
    words, ranges = state.held_seeds.shape[1], state.held_cells.shape[1]
    bits, nothing = read_only(np.zeros((0, words), np.uint64)), read_only(np.zeros(0))
    block = (
        bits,
        bits,
        read_only(np.zeros((0, ranges), np.uint8)),
        read_only(np.zeros(0, np.int64)),
        nothing,
        nothing,
    )
    return Plots.concatenate([_run(block, 0, state), flush(state)])


def _run(block: tuple[NDArray[Any], ...], first_row: int, state: GrowthState) -> Plots:
    state.numbers[TAKEN] = 0
    made = []
    while state.numbers[TAKEN] <= len(block[0]):
        columns = state.columns()
        count = _take_rows(
            block,
            first_row,
            state.azimuths,
            state.rule.arrays,
            state.limits,
            state.pool,
            state.scale,
            columns.arrays,
            state.box,
            state.held,
            (read_only(state.held_seeds), read_only(state.held_growth), read_only(state.held_cells)),
        )
        made.append(columns.table(int(state.radar[0]), count))
    state.room[0] = sum(len(one) for one in made)
    return Plots.concatenate(made)


@kernel
def _take_rows(
    block: Any,
    first_row: int,
    azimuths: int,
    rule: Any,
    limits: Any,
    pool: Any,
    scale: Any,
    out: Any,
    box: Any,
    held: Any,
    kept: Any,
) -> int:
    mask, growth, amplitude, rows, azimuth, times = block
    marks, numbers = held[3], pool[3]
    video = (mask, growth, amplitude)
    delay = box[0].shape[0] - 1
    count = 0
    done = numbers[TAKEN]
    while done <= rows.size:
        at_end = done == rows.size
        row = marks[ARRIVED] + 1 if at_end else first_row + rows[done]
        if row > marks[ARRIVED]:
            last = row - 1 - (delay if rows.size else 0)
            count, whole = _look_to(last, video, azimuths, rule, limits, pool, scale, out, box, held, kept, count)
            if not whole:
                break
            if not at_end:
                fetch_row(mask[done], amplitude, done)
                _arrive(row, done, mask, azimuth[done], times[done], box, held)
            elif count + open_runs(numbers) <= out[0].shape[1]:
                numbers[NEWEST] = max(last, numbers[NEWEST])
                geometry = (scale[0], scale[1], scale[2])
                count = retire(numbers[NEWEST], azimuths, rule[2].shape[1] - 1, limits, pool, geometry, out, count)
                _keep_waiting(mask, growth, amplitude, held)
            else:
                break
        done += 1
    numbers[TAKEN] = done
    return count


@inlined
def _keep_waiting(mask: Any, growth: Any, amplitude: Any, held: Any) -> None:
    """Copy the rows that are still to be looked at out of the block."""
    held_rows, marks, waiting = held[0], held[3], held[6]
    for slot in range(waiting.size):
        at = waiting[slot]
        if at >= 0 and held_rows[slot] >= marks[PENDING]:
            _keep(mask[at], held[7][slot])
            _keep(growth[at], held[8][slot])
            _keep(amplitude[at], held[9][slot])
        waiting[slot] = -1


@inlined
def _keep(source: Any, into: Any) -> None:
    for k in range(into.size):
        into[k] = source[k]


@inlined
def _arrive(row: int, at: int, mask: Any, azimuth: float, time: float, box: Any, held: Any) -> None:
    """Note a row, and mark what is near its detected cells in the rows about it."""
    held_rows, held_sweep, marks, waiting = held[0], held[1], held[3], held[6]
    slot = row & (waiting.size - 1)
    held_rows[slot] = row
    held_sweep[slot, 0], held_sweep[slot, 1] = azimuth, time
    waiting[slot] = at
    marks[ARRIVED] = row
    seeds = mask[at]
    for block in range(0, seeds.size, 8):
        filled = np.uint64(filled_from(seeds, block))
        while filled:
            w = np.uintp(block) + np.uintp(trailing_zeros(filled))
            filled &= filled - np.uint64(1)
            _spread(row, w, seeds[w], box, held[2], held[10])


@inlined
def _spread(row: int, w: int, seeds: Any, box: Any, near: Any, near_rows: Any) -> None:
    """Mark the detected cells of a word, and the cells next to them, in all rows that they are near."""
    one, top = np.uint64(1), np.uint64(63)
    masks, rows = box[0], box[1]
    for back in range(rows[w] + 1):
        mask = masks[np.uintp(back), w]
        here = seeds & mask
        if not here:
            break
        wide = (here | here << one | here >> one) & mask
        # the cell before is near wherever this one is, the cell after need not be
        below, above = (here & one) << top, (here >> top) & masks[np.uintp(back), w + one]
        for other in (row - back, row + back):
            if other < 0:
                continue
            place = np.uintp(other & (near_rows.size - 1))
            if near_rows[place] != other:
                near_rows[place] = other
                for k in range(near.shape[1]):
                    near[place, k] = np.uint64(0)
            near[place, w] |= wide
            if below and w:
                near[place, w - one] |= below
            if above:
                near[place, w + one] |= above


@inlined
def _look_to(
    last: int,
    video: Any,
    azimuths: int,
    rule: Any,
    limits: Any,
    pool: Any,
    scale: Any,
    out: Any,
    box: Any,
    held: Any,
    kept: Any,
    count: int,
) -> tuple[int, bool]:
    """Look at the waiting rows up to `last`. Gives the count of plots, and False where there was no room for more."""
    held_rows, marks, waiting, near_rows = held[0], held[3], held[6], held[10]
    for row in range(marks[PENDING], min(last, marks[ARRIVED]) + 1):
        slot = row & (waiting.size - 1)
        if held_rows[slot] != row or near_rows[row & (near_rows.size - 1)] != row:
            continue
        if count + open_runs(pool[3]) > out[0].shape[1]:
            marks[PENDING] = row
            return count, False
        count = _look_at(row, slot, video, azimuths, rule, limits, pool, scale, out, box, held, kept, count)
    marks[PENDING] = max(marks[PENDING], last + 1)
    return count, True


@inlined
def _look_at(
    row: int,
    slot: int,
    video: Any,
    azimuths: int,
    rule: Any,
    limits: Any,
    pool: Any,
    scale: Any,
    out: Any,
    box: Any,
    held: Any,
    kept: Any,
    count: int,
) -> Any:
    """Take a row of which all that is near is known. Gives the new count of plots."""
    _, held_sweep, held_near, marks, budget, bits, waiting, _, _, _, near_rows = held
    at = waiting[slot]
    seeds = video[0][at] if at >= 0 else kept[0][slot]
    growth = video[1][at] if at >= 0 else kept[1][slot]
    cells = video[2][at] if at >= 0 else kept[2][slot]
    if _choose(row, seeds, growth, held_near[row & (near_rows.size - 1)], bits, box, marks, budget):
        grid_row = row % azimuths
        geometry = (scale[0], scale[1], scale[2])
        count = retire(row, azimuths, rule[2].shape[1] - 1, limits, pool, geometry, out, count)
        note_row(row, grid_row, held_sweep[slot, 0], held_sweep[slot, 1], scale[0], pool[4])
        take_row(row, grid_row, azimuths, bits, seeds, True, cells, rule, limits, pool, scale)
    return count


@inlined
def _choose(row: int, seeds: Any, growth: Any, near: Any, bits: Any, box: Any, marks: Any, budget: Any) -> bool:
    """Write the cells of the row that count; False when there are none."""
    anything = np.uint64(0)
    for w in range(bits.size):
        word = seeds[w] | (growth[w] & near[w])
        bits[w] = word
        anything |= word
    if not anything:
        return False
    budget[0] = min(budget[0] + box[2] * (row - marks[FILLED]), box[3])
    marks[FILLED] = row
    runs = count_runs(bits)
    if runs > budget[0]:
        marks[SKIPPED] += 1
        anything = np.uint64(0)
        for w in range(bits.size):
            bits[w] = seeds[w]
            anything |= seeds[w]
        runs = count_runs(bits)
    budget[0] = max(budget[0] - runs, 0.0)
    return bool(anything)
