"""Runs of detected cells in one sweep, kept in the order in which they were swept and linked by union-find.

A run is a record of 64 octets, one cache line. A run's index is its age, so the root of a component is its first run,
and the oldest run that is still open tells from which row on the plots are not yet known.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.kernels.bits import filled_words, set_bits, trailing_zeros
from pipeline.kernels.compiled import inlined

RUN = np.dtype(
    [
        ("weight", "f8"),
        ("moment", "f8"),
        ("start", "i4"),
        ("end", "i4"),
        ("ring", "i4"),
        ("row", "i4"),
        ("parent", "i4"),
        ("next", "i4"),
        ("last", "i4"),
        ("seeds", "i4"),
        ("total", "i4"),
        ("peak", "i4"),
        ("low", "i4"),
        ("cells", "i4"),
    ]
)
"""weight, moment: sum over the cells of linear amplitude, and of it times ground range. start, end: range cells
[start, end). ring: ring of the link rule. row: in the azimuth grid. parent: union-find (FREE: delivered). next: the
next run of the component, which is a ring of runs. last: in a root, the component's last row in the grid. seeds, cells:
how many cells the detector found and how many there are, in a root those of the component. total, peak, low: sum,
greatest and least of the log amplitudes."""

FREE = -1


@inlined
def find(runs: Any, run: Any) -> Any:
    """The root of a run's component: its oldest run."""
    at = np.uintp(run)  # unsigned, here and below: numba would ask of a signed index whether it counts from the end
    while True:
        parent = np.uintp(runs[at].parent)
        if parent == at:
            return np.int64(at)
        above = runs[parent].parent
        runs[at].parent = above
        at = np.uintp(above)


@inlined
def unite(runs: Any, a: Any, b: Any, row: Any) -> Any:
    """Make one component of those of two different roots; row: the newest row, to which one of them belongs.

    Gives the root of both.
    """
    if b < a:
        a, b = b, a
    root, other = runs[np.uintp(a)], runs[np.uintp(b)]
    other.parent = a
    after = root.next
    root.next = other.next
    other.next = after
    root.last = row
    root.seeds += other.seeds
    root.cells += other.cells
    return a


@inlined
def count_set(bits: Any, start: int, end: int) -> Any:
    """How many of the bits start .. end - 1 of a row of words are set."""
    everything = np.uint64(0xFFFFFFFFFFFFFFFF)
    w, stop = start >> 6, (end - 1) >> 6
    low, high = everything << np.uint64(start & 63), everything >> np.uint64(63 - ((end - 1) & 63))
    if w == stop:
        return np.int64(set_bits(bits[w] & low & high))
    found = np.int64(set_bits(bits[w] & low)) + np.int64(set_bits(bits[stop] & high))
    for between in range(w + 1, stop):
        found += np.int64(set_bits(bits[between]))
    return found


@inlined
def filled_from(bits: Any, block: int) -> Any:
    """Bit w is set when word block + w of a row of words is not empty, for the next eight or what is left."""
    if block + 8 <= bits.size:
        return filled_words(bits.ctypes.data + np.uintp(8 * block))
    filled = np.uint64(0)
    for rest in range(bits.size - block):
        filled |= np.uint64(bits[block + rest] != 0) << np.uint64(rest)
    return filled


@inlined
def edges_of(bits: Any, edges: Any) -> Any:
    """Write where the runs of one row of words begin and end (first, one past the last, and so on); gives how many
    numbers."""
    one, top = np.uint64(1), np.uint64(63)
    many, after = np.int64(0), np.int64(0)
    carry = np.uint64(0)
    for block in range(0, bits.size, 8):
        filled = np.uint64(filled_from(bits, block))
        while filled:
            w: Any = block + np.int64(trailing_zeros(filled))
            filled &= filled - one
            if many & 1 and w != after:  # a run to the end of a word, and nothing in the next
                edges[many] = 64 * after
                many += 1
                carry = np.uint64(0)
            word = bits[w]
            turns = word ^ ((word << one) | carry)
            carry = word >> top
            after = w + 1
            if not turns:
                continue
            # most words hold one run: its two ends are written without asking whether there are two
            edges[many] = 64 * w + np.int64(trailing_zeros(turns))
            turns &= turns - one
            edges[many + 1] = 64 * w + np.int64(trailing_zeros(turns))
            many += 2 if turns else 1
            turns &= turns - one
            while turns:
                edges[many] = 64 * w + np.int64(trailing_zeros(turns))
                many += 1
                turns &= turns - one
    if many & 1:
        edges[many] = 64 * after
        many += 1
    return many


@inlined
def find_runs(
    bits: Any, seeds: Any, grown: bool, cells: Any, row: int, rule: Any, scale: Any, runs: Any, head: int, room: int
) -> tuple[int, int]:
    """Append the runs of one row to the pool, those linked within the row united. Gives the new head and how many runs
    there was no room for.

    bits, seeds: (words) cells of plots, and those of them that the detector found (the same unless `grown`). row: in
    the azimuth grid. rule: `arrays` of a LinkRule. scale: (constants, ground, sums,
    loudness) of a Geometry.
    """
    ring_of_cell, ring_stop, reach, _, edges = rule
    ground, loudness = scale[1], scale[3]
    first, stop = head, head + room
    dropped = 0
    for k in range(0, edges_of(bits, edges), 2):
        begin, until = edges[k], min(edges[k + 1], cells.size)
        while begin < until:
            at = np.uintp(begin)
            ring = ring_of_cell[at]
            end = min(until, ring_stop[ring])
            if head == stop:
                dropped += 1
                begin = end
                continue
            total = peak = low = np.int64(cells[at])
            weight = loudness[np.uintp(cells[at])]
            moment = weight * ground[at]
            for j in range(at + np.uintp(1), np.uintp(end)):
                value = np.int64(cells[j])
                total += value
                peak = max(peak, value)
                low = min(low, value)
                loud = loudness[np.uintp(cells[j])]
                weight += loud
                moment += loud * ground[j]
            run = runs[np.uintp(head)]
            run.weight, run.moment = weight, moment
            run.start, run.end, run.ring, run.row = begin, end, ring, row
            run.parent, run.next, run.last = head, head, row
            run.seeds = count_set(seeds, begin, end) if grown else end - begin
            run.cells = end - begin
            run.total, run.peak, run.low = total, peak, low
            # the neighbour in the row is enough: the reach falls with range, so what links over a run links to it
            if head > first and begin - (np.int64(runs[head - 1].end) - 1) <= reach[ring, 0]:
                unite(runs, find(runs, head - 1), head, row)
            head += 1
            begin = end
    return head, dropped
