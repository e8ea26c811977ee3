"""Growth of plots out of detected cells: cells over a lower threshold count where a detected cell is near.

Near is a box: so many azimuth rows before and after the cell, and its word of 64 range cells and the two beside it. So
a row can be looked at only when the rows after it are known, and plots come later by the height of the box. The result
does not depend on how the sweeps were cut into blocks.
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

ARRIVED, PENDING, FILLED, SKIPPED = range(4)
"""Places in `GrowthState.marks`: newest row that came in, first row not yet looked at, row up to which the bucket of
runs was filled, and a count."""


@dataclass(frozen=True, eq=False)
class GrowthWindow:
    """rows: (words) how many rows before and after a detected cell growth is looked at, in each word of 64 range cells.
    max_runs: cap on the runs that grow in a turn; a row that does not fit keeps its detected cells only, counted.
    """

    rows: NDArray[np.int64]
    max_runs: int

    @classmethod
    def of(cls, video: VideoFormat, near_m: float, most_rows: int, max_runs: int) -> GrowthWindow:
        """Rows that cover near_m metres at each word's middle, at least one and no more than most_rows."""
        middle = video.first_range_m + video.range_step_m * (64 * np.arange(video.words) + 32)
        rows = np.ceil(near_m / np.maximum(middle, video.range_step_m) / video.azimuth_step_rad)
        most = max(1, min(most_rows, video.azimuths // 8))
        return cls(np.clip(rows, 1, most).astype(np.int64), max_runs)


@dataclass(eq=False, kw_only=True)
class GrowthState(ComponentState):
    """The open components, and the rows that wait for what comes after them."""

    near: GrowthWindow
    scratch: tuple[NDArray[np.uint64], NDArray[np.uint8], NDArray[np.int64]]
    held_cells: NDArray[np.uint8] = remembered()
    held_bits: NDArray[np.uint64] = remembered()
    held_seeds: NDArray[np.uint64] = remembered()
    held_active: NDArray[np.bool_] = remembered()
    held_sweep: NDArray[np.float64] = remembered()
    held_row: NDArray[np.int64] = remembered()
    until: NDArray[np.int64] = remembered()
    marks: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()

    @classmethod
    def growing(cls, site: RadarSite, rule: LinkRule, near: GrowthWindow, **limits: Any) -> GrowthState:
        """A state in which nothing is open. limits: as in ComponentState.of."""
        video = site.video
        slots = 1 << (int(near.rows.max()) + 1).bit_length()
        made = cls.of(
            site,
            rule,
            near=near,
            scratch=(np.zeros(video.words, np.uint64), np.zeros(video.ranges, np.uint8), np.full(slots, -1, np.int64)),
            held_cells=np.zeros((slots, video.ranges), np.uint8),
            held_bits=np.zeros((slots, video.words), np.uint64),
            held_seeds=np.zeros((slots, video.words), np.uint64),
            held_active=np.zeros((slots, video.words), np.bool_),
            held_sweep=np.zeros((slots, 2)),
            held_row=np.full(slots, -1, np.int64),
            until=np.full(video.words, -1, np.int64),
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
        rows = (self.held_cells, self.held_bits, self.held_seeds, self.held_active, self.held_sweep, self.held_row)
        return (*rows, self.until, self.marks, self.budget, *self.scratch)

    @property
    def box(self) -> tuple[Any, ...]:
        """Height of the box in each word, greatest height, and the bucket."""
        cap = CapSettings.of(self.near.max_runs, self.azimuths)
        return self.near.rows, int(self.near.rows.max()), cap.refill, cap.depth


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
    held_row, marks, waiting = held[5], held[7], held[11]
    numbers = pool[3]
    delay = box[1]
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
            _arrive(row, done, mask[done], growth[done], azimuth[done], times[done], box[0], held)
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
                    _copy_words(amplitude[waiting[slot]], held[3][slot], True, held[0][slot])
                waiting[slot] = -1
            done += 1
    numbers[TAKEN] = done
    return count


@kernel()
def _arrive(row: int, at: int, seeds: Any, growth: Any, azimuth: float, time: float, near: Any, held: Any) -> None:
    _, held_bits, held_seeds, held_active, held_sweep, held_row, until, marks, _, _, _, waiting = held
    places = held_row.size - 1
    slot = row & places
    bits, kept, active = held_bits[slot], held_seeds[slot], held_active[slot]
    for w in range(seeds.size):
        bits[w] = growth[w] | seeds[w]
        kept[w] = seeds[w]
        active[w] = row <= until[w]
    held_row[slot] = row
    held_sweep[slot, 0], held_sweep[slot, 1] = azimuth, time
    waiting[slot] = at
    marks[ARRIVED] = row
    for w in range(seeds.size):
        if not seeds[w]:
            continue
        for v in range(max(w - 1, 0), min(w + 2, seeds.size)):
            for back in range(max(row - near[v], until[v] + 1, 0), row + 1):
                if held_row[back & places] == back:
                    held_active[back & places, v] = True
            until[v] = row + near[v]


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
    held_cells, _, held_seeds, held_active, held_sweep, held_row, _, marks, budget, bits, cells, waiting = held
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
            _copy_words(amplitude[waiting[slot]], held_active[slot], False, cells)
        else:
            _copy_words(held_cells[slot], held_active[slot], False, cells)
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
    held_bits, held_seeds, held_active = held[1], held[2], held[3]
    marks, budget, bits = held[7], held[8], held[9]
    anything = np.uint64(0)
    grown, kept, active = held_bits[slot], held_seeds[slot], held_active[slot]
    for w in range(bits.size):
        bits[w] = grown[w] if active[w] else np.uint64(0)
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
def _copy_words(source: Any, active: Any, all_words: bool, cells: Any) -> None:
    for w in range(active.size):
        if all_words or active[w]:
            for j in range(64 * w, min(64 * w + 64, cells.size)):
                cells[j] = source[j]
