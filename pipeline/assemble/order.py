"""First step of the assembly: put each message at its absolute row and time, or count why not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

COUNTERS = (
    "taken",  # messages that found their row
    "sweeps",  # grid rows handed on
    "lost",  # gaps of the message identification
    "duplicate",  # the same message again
    "reordered",  # after its successor, still in time for its block
    "late",  # after its block was handed on
    "azimuth_backwards",  # azimuth behind the one before
    "wrong_azimuth",  # a sweep wider than a quarter turn
    "wrong_cell_count",  # cells beyond the grid, or rows left short without a loss
    "wrong_geometry",  # cell duration does not fit the grid
    "time_backwards",  # time of day before the one before: the time was counted on by the rotation
    "time_jump",  # time of day ahead of what the arrival allows: counted on, too
    "clock_step",  # the radar's clock was accepted at a new time
    "no_time",  # no time of day: the arrival was taken
    "wrong_source",  # another SAC or SIC
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
    HAVE, LAST_ID, NEWEST, PREVIOUS_START, PREVIOUS_END, EXTENSION, CANDIDATE, DUPLICATE_RUN, LATE_RUN, LATE_ID,
    TIME_RUN, AZIMUTH_RUN, STEPPED, GAP,
) = range(14)  # fmt: skip
LAST_TIME, LAST_ARRIVAL = 0, 1

BELIEVED = 32
"""So many messages in a row that agree with each other against what went before are believed."""

REORDER = 1024
"""A message at most this far behind the newest is late; further behind the radar may have restarted."""

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
    """

    azimuths: int
    ranges: int
    first_cell: int
    cell_fs: float
    offset: int
    period: float
    source_mask: int
    source: int


def new_state() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """State before the first message."""
    state = np.zeros(14, np.int64)
    state[[LAST_ID, PREVIOUS_START, PREVIOUS_END, CANDIDATE]] = -1
    state[GAP] = 1
    return state, np.zeros(2)


@allocating
def order(fields, arrival, rules, state, clock, seen, counts, placed, times):  # type: ignore[no-untyped-def]
    """Fill `placed` (n, 4) and `times` (n, 2: UTC s, azimuth rad or nan for the grid's own) for messages `fields`.

    Changes state, clock, seen and counts.
    """
    for i in range(fields.shape[0]):
        placed[i, 0] = -1
        one = fields[i]
        if (one[7] & rules.source_mask) != rules.source:
            counts[WRONG_SOURCE] += 1
            continue
        verdict = _sequence(one, state, seen, counts)
        if verdict < 0:
            continue
        late = verdict == 1
        if not _fits(one, rules, counts):
            continue
        time = _time(one[6], one[1], arrival[i], late, rules, state, clock, counts)
        if np.isnan(time):
            state[GAP] = 1
            continue
        first, rows, azimuth = _rows(one, rules, state, late)
        elapsed = (arrival[i] if state[STEPPED] == 1 else time) - clock[
            LAST_ARRIVAL if state[STEPPED] == 1 else LAST_TIME
        ]
        absolute = _turn(first % rules.azimuths, elapsed, late, rules, state, counts)
        if absolute < 0:
            state[GAP] = 1
            continue
        placed[i, 0] = absolute
        placed[i, 1] = rows
        placed[i, 2] = late
        placed[i, 3] = state[GAP]
        times[i, 0] = time
        times[i, 1] = azimuth
        if not late:
            state[HAVE] = 1
            state[NEWEST] = absolute
            state[GAP] = 0
            clock[LAST_TIME] = time
            clock[LAST_ARRIVAL] = arrival[i]


@allocating
def _sequence(one, state, seen, counts):  # type: ignore[no-untyped-def]
    """0 in order, 1 late, -1 not to be taken."""
    message = one[0]
    key = message << 32 | one[1] << 16 | (one[3] & 0xFFFF)
    slot = message % SEEN
    if seen[slot] == key:
        state[DUPLICATE_RUN] += 1
        if state[DUPLICATE_RUN] <= BELIEVED:
            counts[DUPLICATE] += 1
            return -1
        # a recording that is played again repeats everything, a network only a little
        _restart(message, state, seen, counts)
    state[DUPLICATE_RUN] = 0
    gap = (message - state[LAST_ID]) & 0xFFFFFFFF
    late = False
    if state[LAST_ID] < 0:
        gap = 1
    if gap <= GREATEST_GAP:
        if gap > 1:
            counts[LOST] += gap - 1
            state[GAP] = 1
            state[PREVIOUS_END] = -1
        state[LATE_RUN] = 0
        state[CANDIDATE] = -1
        state[LAST_ID] = message
    elif gap >= 0x100000000 - REORDER:
        state[LATE_RUN] = state[LATE_RUN] + 1 if message == state[LATE_ID] + 1 else 1
        state[LATE_ID] = message
        late = state[LATE_RUN] < BELIEVED
        if late:
            counts[LOST] -= 1 if counts[LOST] > 0 else 0
        else:
            _restart(message, state, seen, counts)
    else:
        step = message - state[CANDIDATE]
        if state[CANDIDATE] >= 0 and 0 < step <= BELIEVED:
            _restart(message, state, seen, counts)
        else:
            state[CANDIDATE] = message
            counts[OUT_OF_SEQUENCE] += 1
            return -1
    seen[slot] = key
    return 1 if late else 0


@allocating
def _restart(message, state, seen, counts):  # type: ignore[no-untyped-def]
    counts[RESTART] += 1
    seen[:] = -1
    state[LAST_ID] = message
    state[CANDIDATE] = -1
    state[LATE_RUN] = 0
    state[PREVIOUS_END] = -1
    state[GAP] = 1


@allocating
def _fits(one, rules, counts):  # type: ignore[no-untyped-def]
    """Cells, cell duration and azimuths are such as the grid can take."""
    reach = one[3] + one[5]
    if abs(one[4] - rules.cell_fs) * reach > 0.5 * rules.cell_fs:
        counts[WRONG_GEOMETRY] += 1
        return False
    column = one[3] - rules.first_cell
    if column < 0 or column + one[5] > rules.ranges:
        counts[WRONG_CELL_COUNT] += 1
        return False
    if ((one[2] - one[1]) & 0xFFFF) > 0x4000:
        counts[WRONG_AZIMUTH] += 1
        return False
    return True


@allocating
def _time(count, start, arrival, late, rules, state, clock, counts):  # type: ignore[no-untyped-def]
    """UTC of the message; nan when it is not to be taken."""
    if count < 0:
        counts[NO_TIME] += 1
    if state[HAVE] == 0:
        return _of_day(count, arrival, arrival)
    last = clock[LAST_TIME]
    elapsed = max(0.0, arrival - clock[LAST_ARRIVAL])
    # the day goes on from the message before, so that a recording may be replayed faster than time
    time = _of_day(count, arrival, last + elapsed)
    if late:
        if abs(time - last) > JUMP:
            counts[LATE] += 1
            return np.nan
        return min(time, last)
    back = time < last - TIME_TOLERANCE
    ahead = time > last + elapsed + JUMP
    if not (back or ahead):
        state[TIME_RUN] = 0
        return max(time, last)
    state[TIME_RUN] += 1
    if state[TIME_RUN] < BELIEVED:
        counts[TIME_BACKWARDS if back else TIME_JUMP] += 1
        # the echoes are good though their time is not
        forward = (start - state[PREVIOUS_START]) & 0xFFFF
        turned = forward / 65536 * rules.period if state[PREVIOUS_START] >= 0 and forward < 0x8000 else 0.0
        return last + min(elapsed, turned)
    counts[CLOCK_STEP] += 1
    state[TIME_RUN] = 0
    state[STEPPED] = 1
    return _of_day(count, arrival, arrival)


@allocating
def _of_day(count, arrival, near):  # type: ignore[no-untyped-def]
    """UTC of a time of day: on the day that brings it next to `near`; the arrival when there is none."""
    if count < 0:
        return arrival
    time = np.floor(near / 86400) * 86400 + count / 128
    if time - near > 43200:
        time -= 86400
    elif time - near < -43200:
        time += 86400
    return time


@allocating
def _rows(one, rules, state, late):  # type: ignore[no-untyped-def]
    """(first grid row, rows, azimuth of the centre or nan) that the message covers."""
    start, width = one[1], (one[2] - one[1]) & 0xFFFF
    if not late:
        if start == state[PREVIOUS_START] and state[PREVIOUS_END] == one[2]:
            extension = state[EXTENSION]
        else:
            # counts of a sweep that no message claims (rounding, azimuths that do not divide 65,536) go to the next one
            extension = (start - state[PREVIOUS_END]) & 0xFFFF if state[PREVIOUS_END] >= 0 else 0
            if extension * rules.azimuths >= 65536 or width == 0:
                extension = 0
        state[PREVIOUS_START], state[PREVIOUS_END], state[EXTENSION] = start, one[2], extension
    else:
        extension = 0
    low = (start - extension) * 1024 + rules.offset
    high = low + (width + extension) * 1024
    first = -((FINE - 2 * rules.azimuths * low) // (2 * FINE))
    end = -((FINE - 2 * rules.azimuths * high) // (2 * FINE))
    middle = start * 1024 + rules.offset + width * 512
    if end - first > 1:
        return first, end - first, np.nan
    if end <= first:
        first = (rules.azimuths * middle) // FINE
    return first, 1, middle * (2 * np.pi / FINE)


@allocating
def _turn(row, elapsed, late, rules, state, counts):  # type: ignore[no-untyped-def]
    """Absolute row (turn * azimuths + row) of a row of the grid; -1 when it is not to be taken.

    elapsed: seconds since the newest message.
    """
    azimuths = rules.azimuths
    if state[HAVE] == 0:
        return row
    newest = state[NEWEST]
    forward = (row - newest) % azimuths
    step = forward if forward <= azimuths // 2 else forward - azimuths
    if late:
        if step > 0 or newest + step < 0:
            counts[LATE] += 1
            return -1
        return newest + step
    next_turn = (newest // azimuths + 1) * azimuths + row
    stepped = state[STEPPED] == 1
    state[STEPPED] = 0
    if elapsed > 0.4 * rules.period:
        # after an outage the time says whether north was passed; however many turns were missed, one is counted
        turns = np.rint(elapsed / rules.period - forward / azimuths)
        state[AZIMUTH_RUN] = 0
        absolute = newest + forward
        if turns >= 1 and absolute < next_turn:
            absolute = next_turn
        return absolute
    if step >= 0:
        state[AZIMUTH_RUN] = 0
        return newest + step
    state[AZIMUTH_RUN] += 1
    if state[AZIMUTH_RUN] < BELIEVED and not stepped:  # with a new time the radar, or a recording, has begun anew
        counts[AZIMUTH_BACKWARDS] += 1
        return -1
    state[AZIMUTH_RUN] = 0
    return next_turn
