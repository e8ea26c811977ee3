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

from pipeline.kernels.bits import count_runs
from pipeline.kernels.compiled import kernel
from pipeline.kernels.components import NEWEST, TAKEN, ComponentState, flush, note_row, open_runs, retire, take_row
from pipeline.kernels.links import LinkRule
from pipeline.kernels.run_cap import CapSettings
from pipeline.sites import RadarSite
from pipeline.state import read_only, remembered
from pipeline.tables import Detections, Plots, Sweeps, VideoFormat

ARRIVED, PENDING, FILLED, SEEDED, SKIPPED = range(5)
"""Places in `GrowthState.marks`: newest row that came in, first row not yet looked at, row up to which the bucket of
runs was filled, newest row with detected cells, and a count."""


@dataclass(frozen=True, eq=False)
class GrowthWindow:
    """masks: (rows + 1, words) the range cells at which a cell that many rows away is near. words: (rows + 1) of them
    with such cells. max_runs: cap on the runs that grow in a turn; a row that does not fit keeps its detected cells
    only, counted.
    """

    masks: NDArray[np.uint64]
    words: NDArray[np.int64]
    max_runs: int

    @classmethod
    def of(cls, video: VideoFormat, rule: LinkRule, max_runs: int) -> GrowthWindow:
        """The window that links the cells of plots: for a rule over no more than the next range cell."""
        near = np.zeros((rule.rows + 1, 64 * video.words), np.bool_)
        near[:, : video.ranges] = (rule.reach[rule.ring_of_cell] >= 0).T
        masks = np.packbits(near, axis=1, bitorder="little").view(np.uint64)
        words = np.array([np.flatnonzero(one)[-1] + 1 if one.any() else 0 for one in masks], np.int64)
        return cls(masks, words, max_runs)


@dataclass(eq=False, kw_only=True)
class GrowthState(ComponentState):
    """The open components, and the rows that wait for what comes after them."""

    near: GrowthWindow
    scratch: tuple[NDArray[np.uint64], NDArray[np.uint8], NDArray[np.int64]]
    held_cells: NDArray[np.uint8] = remembered()
    held_bits: NDArray[np.uint64] = remembered()
    held_seeds: NDArray[np.uint64] = remembered()
    held_near: NDArray[np.uint64] = remembered()
    held_sweep: NDArray[np.float64] = remembered()
    held_row: NDArray[np.int64] = remembered()
    marks: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()

    @classmethod
    def growing(cls, site: RadarSite, rule: LinkRule, near: GrowthWindow, **limits: Any) -> GrowthState:
        """A state in which nothing is open. limits: as in ComponentState.of."""
        video = site.video
        slots = 1 << len(near.words).bit_length()
        made = cls.of(
            site,
            rule,
            near=near,
            scratch=(np.zeros(video.words, np.uint64), np.zeros(video.ranges, np.uint8), np.full(slots, -1, np.int64)),
            held_cells=np.zeros((slots, video.ranges), np.uint8),
            held_bits=np.zeros((slots, video.words), np.uint64),
            held_seeds=np.zeros((slots, video.words), np.uint64),
            held_near=np.zeros((slots, video.words), np.uint64),
            held_sweep=np.zeros((slots, 2)),
            held_row=np.full(slots, -1, np.int64),
            marks=np.array([-1, 0, 0, -1, 0], np.int64),
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
        rows = (self.held_cells, self.held_bits, self.held_seeds, self.held_near, self.held_sweep, self.held_row)
        return (*rows, self.marks, self.budget, *self.scratch)

    @property
    def box(self) -> tuple[Any, ...]:
        """The window, and the bucket."""
        cap = CapSettings.of(self.near.max_runs, self.azimuths)
        return self.near.masks, self.near.words, cap.refill, cap.depth


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
    words, ranges = state.held_bits.shape[1], state.held_cells.shape[1]
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
        )
        made.append(columns.table(int(state.radar[0]), count))
    state.room[0] = sum(len(one) for one in made)
    return Plots.concatenate(made)


@kernel()
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
) -> int:
    mask, growth, amplitude, rows, azimuth, times = block
    held_row, marks, waiting = held[5], held[6], held[10]
    numbers = pool[3]
    delay = box[1].size - 1
    count = 0
    done = numbers[TAKEN]
    while done < rows.size:
        row = first_row + rows[done]
        if marks[ARRIVED] < row:
            count, whole = _look_to(
                row - delay - 1, amplitude, azimuths, rule, limits, pool, scale, out, box, held, count
            )
            if not whole:
                break
            _arrive(row, done, mask[done], growth[done], azimuth[done], times[done], box, held)
        count, whole = _look_to(row - delay, amplitude, azimuths, rule, limits, pool, scale, out, box, held, count)
        if not whole:
            break
        done += 1
    if done == rows.size:
        newest = marks[ARRIVED] - (delay if rows.size else 0)
        count, whole = _look_to(newest, amplitude, azimuths, rule, limits, pool, scale, out, box, held, count)
        if whole and count + open_runs(numbers) <= out[0].shape[1]:
            numbers[NEWEST] = max(newest, numbers[NEWEST])
            geometry = (scale[0], scale[1], scale[2])
            count = retire(numbers[NEWEST], azimuths, rule[2].shape[1] - 1, limits, pool, geometry, out, count)
            for slot in range(held_row.size):
                if waiting[slot] >= 0 and held_row[slot] >= marks[PENDING]:
                    _copy_words(amplitude[waiting[slot]], held[1][slot], True, held[0][slot])
                waiting[slot] = -1
            done += 1
    numbers[TAKEN] = done
    return count


@kernel()
def _arrive(row: int, at: int, seeds: Any, growth: Any, azimuth: float, time: float, box: Any, held: Any) -> None:
    """Keep a row, and mark what is near between it and the rows that came before."""
    _, held_bits, held_seeds, held_near, held_sweep, held_row, marks, _, _, _, waiting = held
    masks, words = box[0], box[1]
    places = held_row.size - 1
    slot = row & places
    bits, kept, near = held_bits[slot], held_seeds[slot], held_near[slot]
    anything = np.uint64(0)
    for w in range(seeds.size):
        bits[w] = growth[w] | seeds[w]
        kept[w] = seeds[w]
        near[w] = np.uint64(0)
        anything |= seeds[w]
    held_row[slot] = row
    held_sweep[slot, 0], held_sweep[slot, 1] = azimuth, time
    waiting[slot] = at
    marks[ARRIVED] = row
    if anything:
        _spread(kept, masks[0], words[0], near)
    elif row - marks[SEEDED] >= words.size:
        return
    for back in range(1, min(words.size, row + 1)):
        other = (row - back) & places
        if held_row[other] == row - back:
            _spread(held_seeds[other], masks[back], words[back], near)
            if anything:
                _spread(kept, masks[back], words[back], held_near[other])
    if anything:
        marks[SEEDED] = row


@kernel()
def _spread(seeds: Any, mask: Any, words: int, near: Any) -> None:
    """Mark the detected cells of a row, and the cells next to them, within the mask."""
    one, top = np.uint64(1), np.uint64(63)
    before, here = np.uint64(0), seeds[0] & mask[0]
    for w in range(words):
        after = seeds[w + 1] & mask[w + 1] if w + 1 < words else np.uint64(0)
        near[w] |= (here | here << one | here >> one | before >> top | after << top) & mask[w]
        before, here = here, after


@kernel()
def _look_to(
    last: int,
    amplitude: Any,
    azimuths: int,
    rule: Any,
    limits: Any,
    pool: Any,
    scale: Any,
    out: Any,
    box: Any,
    held: Any,
    count: int,
) -> tuple[int, bool]:
    """Look at the waiting rows up to `last`. Gives the count of plots, and False where there was no room for more."""
    held_cells, _, held_seeds, _, held_sweep, held_row, marks, budget, bits, cells, waiting = held
    numbers, turn = pool[3], pool[4]
    geometry = (scale[0], scale[1], scale[2])
    for row in range(marks[PENDING], min(last, marks[ARRIVED]) + 1):
        slot = row & (held_row.size - 1)
        if held_row[slot] != row:
            continue
        if count + open_runs(numbers) > out[0].shape[1]:
            marks[PENDING] = row
            return count, False
        if not _choose(row, slot, box, held):
            continue
        if waiting[slot] >= 0:
            _copy_words(amplitude[waiting[slot]], bits, False, cells)
        else:
            _copy_words(held_cells[slot], bits, False, cells)
        grid_row = row % azimuths
        budget[0] = max(budget[0] - count_runs(bits), 0.0)
        count = retire(row, azimuths, rule[2].shape[1] - 1, limits, pool, geometry, out, count)
        note_row(row, grid_row, held_sweep[slot, 0], held_sweep[slot, 1], scale[0], turn)
        take_row(row, grid_row, azimuths, bits, held_seeds[slot], True, cells, rule, limits, pool, scale)
    marks[PENDING] = max(marks[PENDING], last + 1)
    return count, True


@kernel()
def _choose(row: int, slot: int, box: Any, held: Any) -> bool:
    """Write the cells of the row that count to the scratch row; False when there are none."""
    held_bits, held_seeds, held_near = held[1], held[2], held[3]
    marks, budget, bits = held[6], held[7], held[8]
    anything = np.uint64(0)
    grown, kept, near = held_bits[slot], held_seeds[slot], held_near[slot]
    for w in range(bits.size):
        bits[w] = kept[w] | (grown[w] & near[w])
        anything |= bits[w]
    if not anything:
        return False
    budget[0] = min(budget[0] + box[2] * (row - marks[FILLED]), box[3])
    marks[FILLED] = row
    if count_runs(bits) > budget[0]:
        marks[SKIPPED] += 1
        anything = np.uint64(0)
        for w in range(bits.size):
            bits[w] = kept[w]
            anything |= bits[w]
    return bool(anything)


@kernel()
def _copy_words(source: Any, bits: Any, whole: bool, cells: Any) -> None:
    for w in range(bits.size):
        if whole or bits[w]:
            for j in range(64 * w, min(64 * w + 64, cells.size)):
                cells[j] = source[j]
