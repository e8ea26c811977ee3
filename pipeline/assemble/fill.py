"""Second step of the assembly: copy cells into the open block until it is full or left behind."""

from __future__ import annotations

import numpy as np

from pipeline.assemble.fit import same_cells
from pipeline.assemble.order import order
from pipeline.assemble.resample import resampled
from pipeline.assemble.state import LATE, MERGED, REORDERED, TAKEN
from pipeline.kernels.compiled import allocating

DONE, FILLED = 0, 1
"""`fill` has used all messages; the open block is to be closed before it can go on."""

START, END, CLOSED, BLOCK_GAP, BLOCK_MERGED, WHOLE = range(6)
"""Block state: absolute rows of the open block or -1; rows before CLOSED are handed on; a loss was near; rows have been
merged; complete rows."""


@allocating
def order_and_fill(  # type: ignore[no-untyped-def]
    fields, octets, arrival, rules, state, clock, seen, placed, times, refused, at, row, edges, block, amplitude, cover,
    converted, key, time, azimuth, counts,
):  # fmt: skip
    """`order` first when `at` is -1, then `fill`; one call, because each return waits for the interpreter's lock."""
    if at < 0:
        order(fields, arrival, rules, state, clock, seen, counts, placed, times, refused)
        at = 0
    return fill(
        fields, octets, placed, times, at, row, rules, edges, block, amplitude, cover, converted, key, time, azimuth,
        counts,
    )  # fmt: skip


@allocating
def fill(  # type: ignore[no-untyped-def]
    fields, octets, placed, times, at, row, rules, edges, block, amplitude, cover, converted, key, time, azimuth,
    counts,
):  # fmt: skip
    """Go on with message `at` at absolute row `row` (-1: its first).

    Gives the message and row to go on with, and DONE or FILLED.
    """
    n = fields.shape[0]
    while at < n:
        if placed[at, 0] < 0:
            at, row = at + 1, -1
            continue
        first = placed[at, 0]
        end = first + placed[at, 1]
        if row < 0:
            row = first
        late = placed[at, 2] == 1
        while row < end:
            if row < block[CLOSED] or (block[START] >= 0 and row < block[START]):
                # nobody may change what was handed on; a message that is in order came again for its row
                if row == first:
                    counts[LATE if late else MERGED] += 1
                row += 1
                continue
            if block[START] < 0:
                _open(row, rules.azimuths, edges, block)
            if row >= block[END]:
                if placed[at, 3] == 1:
                    block[BLOCK_GAP] = 1
                return at, row, FILLED
            if placed[at, 3] == 1:
                block[BLOCK_GAP] = 1
            if row == first:
                counts[TAKEN] += 1
                if late:
                    counts[REORDERED] += 1
            _place(fields[at], octets, times[at], row, rules, block, amplitude, cover, converted, key, time, azimuth,
                   counts)  # fmt: skip
            row += 1
            if block[WHOLE] == block[END] - block[START] and block[BLOCK_MERGED] == 0:
                if row >= end:
                    return at + 1, -1, FILLED
                return at, row, FILLED
        at, row = at + 1, -1
    return at, -1, DONE


@allocating
def _open(row, azimuths, edges, block):  # type: ignore[no-untyped-def]
    turn = row // azimuths * azimuths
    index = np.searchsorted(edges, row - turn, side="right") - 1
    block[START] = turn + edges[index]
    block[END] = turn + edges[index + 1]
    block[BLOCK_GAP] = 0
    block[BLOCK_MERGED] = 0
    block[WHOLE] = 0


@allocating
def _place(  # type: ignore[no-untyped-def]
    one, octets, moment, row, rules, block, amplitude, cover, converted, key, time, azimuth, counts
):
    at = row - block[START]
    azimuths = rules.azimuths
    low = one[3] - rules.first_cell
    source = octets[one[8]][one[9] : one[9] + one[5]]
    if rules.resample == 1 and not same_cells(one, rules.cell_fs):
        low, source = resampled(one, source, rules)
        converted[at] = True
    cells = len(source)
    out = amplitude[at][low : low + cells]
    ranges = amplitude.shape[1]
    if cover[at] == 0:
        key[at] = one[1]
        time[at] = moment[0]
        centre = (row % azimuths + 0.5) * (2 * np.pi / azimuths)
        if np.isnan(moment[1]):
            azimuth[at] = centre
        else:
            # unwrapped to the row's own turn, so that azimuths ascend through a block that begins at north
            azimuth[at] = centre + (moment[1] - centre + np.pi) % (2 * np.pi) - np.pi
        out[:] = source
        cover[at] = cells
    else:
        for i in range(cells):
            out[i] = max(out[i], source[i])
        if one[1] == key[at]:
            cover[at] += cells
        else:
            counts[MERGED] += 1
            block[BLOCK_MERGED] = 1
            return
    if cover[at] >= ranges and cover[at] - cells < ranges:
        block[WHOLE] += 1
