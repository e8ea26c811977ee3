"""What the steps of the assembly share: the counters, the grid, and the state between two messages."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

COUNTERS = (
    "taken",  # messages that found their row
    "sweeps",  # grid rows handed on
    "lost",  # gaps of the message identification
    "duplicate",  # the same message again: identification, azimuth and time
    "reordered",  # after its successor, still in time for its block
    "late",  # after its block was handed on
    "azimuth_backwards",  # azimuth behind the one before
    "wrong_azimuth",  # a sweep wider than a quarter turn, of a radar whose ends are right otherwise
    "wrong_cell_count",  # cells beyond the grid, or rows left short without a loss
    "wrong_geometry",  # cell duration does not fit the grid
    "time_backwards",  # time of day before the one before: the time was counted on by the rotation
    "time_jump",  # time of day ahead of what the arrival allows: counted on, too
    "clock_step",  # the radar's clock was accepted at a new time
    "no_time",  # no time of day: the arrival was taken
    "wrong_source",  # another SAC or SIC than wanted, or, when none is wanted, than that of the stream
    "out_of_sequence",  # identification far from the one before, not yet believed
    "restart",  # the identification began anew
    "merged",  # a further message for a row that has one (finer than the grid)
    "incomplete",  # rows left short by a loss
)
"""What is counted, in the order of the kernel's counts."""

(
    TAKEN, SWEEPS, LOST, DUPLICATE, REORDERED, LATE, AZIMUTH_BACKWARDS, WRONG_AZIMUTH, WRONG_CELL_COUNT,
    WRONG_GEOMETRY, TIME_BACKWARDS, TIME_JUMP, CLOCK_STEP, NO_TIME, WRONG_SOURCE, OUT_OF_SEQUENCE, RESTART, MERGED,
    INCOMPLETE,
) = range(len(COUNTERS))  # fmt: skip

SEEN = 4096
"""Messages remembered to tell a duplicate from a late one."""

PLACED_FIELDS = 4
"""Columns of `placed`: absolute row or -1, rows covered, late (0, 1), after a gap (0, 1)."""

(
    HAVE, LAST_ID, NEWEST, PREVIOUS_START, PREVIOUS_END, CLAIMED, EXTENSION, SPACING, ODD_RUN, END_TRUST, CANDIDATE,
    DUPLICATE_RUN, LATE_RUN, LATE_ID, TIME_RUN, AZIMUTH_RUN, STEPPED, GAP, SOURCE, LAST_COUNT,
    BEFORE,
) = range(21)  # fmt: skip
LAST_TIME, LAST_ARRIVAL = 0, 1
SEEN_KEY, SEEN_TIME, SEEN_ARRIVAL = range(3)
"""Columns of `seen` (SEEN, 3): what a message is told by, its time of day, and its arrival in microseconds."""

REFUSED_WHY, REFUSED_REACH, REFUSED_FIRST, REFUSED_DURATION, REFUSED_SOURCE = range(5)
"""Of the newest message that does not fit: its counter, or -1; the greatest number of cells from the radar on, the
first cell, the cell duration (fs) and the source of such messages."""

BELIEVED = 32
"""So many messages in a row that agree with each other against what went before are believed."""

REORDER = 1024
"""A message at most this far behind the newest is late; further behind the radar may have restarted."""

GREATEST_STEP = 0x4000
"""Counts of azimuth, a quarter turn: no sweep is wider, and what lies further ahead does not follow."""

MOST_TRUST = 8
"""The end azimuths are believed, or not, until so many messages more speak against it than for it."""

SOURCE_SILENT_TURNS = 3.0
"""Nominal turns after which another source may take the place of one that is not heard any more."""

DAY_COUNTS = 86400 * 128
"""Counts of the time of day."""

GREATEST_GAP = 1 << 20
"""A greater step of the identification is a restart, not a loss."""

TIME_TOLERANCE = 2 / 128
"""Seconds that the time of day may step back: two of its counts."""

JUMP = 1.0
"""Seconds that the time of day may run ahead of the arrival."""

FINE = 1 << 26
"""Azimuth units a turn inside the kernel: 1/1024 of the 16-bit count, so that the offset of north is exact."""


class GridRules(NamedTuple):
    """The grid that messages are put on.

    cell_fs: femtoseconds of a grid cell. offset: of north in FINE units. source_mask, source: SAC << 8 | SIC wanted.
    resample: 1 when cells of another length are brought to the grid's, 0 when they are refused.
    """

    azimuths: int
    ranges: int
    first_cell: int
    cell_fs: float
    offset: int
    period: float
    source_mask: int
    source: int
    resample: int = 0


def new_state() -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """State, clock and messages seen before the first message."""
    state = np.zeros(21, np.int64)
    state[[LAST_ID, PREVIOUS_START, PREVIOUS_END, CLAIMED, CANDIDATE, LAST_COUNT, BEFORE]] = -1
    state[GAP] = 1
    return state, np.zeros(2), np.full((SEEN, 3), -1, np.int64)
