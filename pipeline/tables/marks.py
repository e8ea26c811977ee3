"""Azimuth marks: fixed directions of the antenna at which later stages decide, however a turn is cut into blocks."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from pipeline.tables.arrays import Array

Numbers = TypeVar("Numbers", int, Array)
"""One whole number or an int64 array of them."""

MARKS_A_TURN = 16
"""Marks in one turn of the antenna. What waits for the next mark waits for a 16th of a turn at most: 62 ms at one turn
a second, on average half of that, little beside the time the extractor needs to complete a plot. Each mark is a
decision of its own: with 32 of them a turn costs half as much again."""

FORMER_MARKS_A_TURN = 32
"""Those of sectors that were recorded before they stated how many marks a turn has."""

PLACES, PLACE = 16, 15
"""A mark stands at the last of so many places of its 16th of a turn, counted from 0: just before the end of the block
where a radar delivers 32 a turn, so that it is decided with that block and not with the next."""


def mark_row(mark: Numbers, azimuths: int) -> Numbers:
    """The absolute row (scan * azimuths + row) at which a mark stands.

    mark: absolute mark number (scan * MARKS_A_TURN + mark of the turn), or an int64 array of them. azimuths: rows a
    turn; with few rows several marks stand at the same row.
    """
    return (PLACES * mark + PLACE) * azimuths // (PLACES * MARKS_A_TURN)


def present_marks(mark: Array, time: Array, marks_a_turn: int) -> tuple[Array, Array]:
    """Numbers (k,) and times of those marks, of a turn with `marks_a_turn`, that stand where one of MARKS_A_TURN does.

    None where a turn has no multiple of MARKS_A_TURN.
    """
    every, rest = divmod(marks_a_turn, MARKS_A_TURN)
    kept = (mark + 1) % max(every, 1) == 0 if every > 0 and rest == 0 else np.zeros(len(mark), np.bool_)
    return (mark[kept] + 1) // max(every, 1) - 1, time[kept]


def first_mark(row: int, azimuths: int) -> int:
    """The first mark that stands at or after an absolute row."""
    places = -(-row * PLACES * MARKS_A_TURN // azimuths)
    return -(-(places - PLACE) // PLACES)


def marks_between(low: int, high: int, azimuths: int) -> Array:
    """(k,) int64 the marks whose absolute row is `low` or later and before `high`, ascending."""
    return np.arange(first_mark(low, azimuths), first_mark(high, azimuths), dtype=np.int64)


def passed_marks(first: int, row: Array, time: Array, expected: int, azimuths: int) -> tuple[Array, Array]:
    """The marks that the antenna passed with a block of sweeps, and the times of passing.

    first: absolute row of row 0 of the block's turn. row: (n,) ascending rows of the sweeps in the turn, at least one.
    time: (n,) float64 UTC s of each. expected: the absolute row after the newest one received before, at most
    first + row[0]. azimuths: rows a turn.

    Returns (k,) int64 absolute mark numbers, ascending, and (k,) float64 UTC s. The time of a mark is that of the first
    sweep received at its row or after it: no value depends on how the sweeps were cut into blocks. Marks in a gap
    longer than a turn are left out: the first sweep after it says nothing of when the antenna passed them.
    """
    start = first + int(row[0])
    low = expected if start - expected <= azimuths else start
    mark = marks_between(low, first + int(row[-1]) + 1, azimuths)
    if not len(mark):
        return mark, np.empty(0, np.float64)
    return mark, time[np.searchsorted(row, mark_row(mark, azimuths) - first)]
