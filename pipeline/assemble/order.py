"""First step of the assembly: put each message at its absolute row and time, or count why not."""

from __future__ import annotations

import numpy as np

from pipeline.assemble.fit import fits
from pipeline.assemble.sequence import in_sequence, wanted
from pipeline.assemble.spacing import end_fits, rows_of
from pipeline.assemble.state import (
    AZIMUTH_BACKWARDS,
    AZIMUTH_RUN,
    BELIEVED,
    CLOCK_STEP,
    GAP,
    HAVE,
    JUMP,
    LAST_ARRIVAL,
    LAST_COUNT,
    LAST_TIME,
    LATE,
    NEWEST,
    NO_TIME,
    PREVIOUS_END,
    PREVIOUS_START,
    SOURCE,
    STEPPED,
    TIME_BACKWARDS,
    TIME_JUMP,
    TIME_RUN,
    TIME_TOLERANCE,
)
from pipeline.kernels.compiled import allocating


@allocating
def order(fields, arrival, rules, state, clock, seen, counts, placed, times, refused):  # type: ignore[no-untyped-def]
    """Fill `placed` (n, 4) and `times` (n, 2: UTC s, azimuth rad or nan for the grid's own) for messages `fields`.

    Changes state, clock, seen, counts and refused.
    """
    for i in range(fields.shape[0]):
        placed[i, 0] = -1
        one = fields[i]
        if not wanted(one, arrival[i], rules, state, clock, seen, counts, refused):
            continue
        # a message of another geometry must not begin the numbering
        if state[HAVE] == 0 and not fits(one, rules, refused, counts):
            continue
        verdict = in_sequence(one, arrival[i], rules, state, seen, counts)
        if verdict < 0:
            continue
        late = verdict == 1
        if not (fits(one, rules, refused, counts) and end_fits(one, state, counts)):
            state[PREVIOUS_END] = -1
            continue
        time = _time(one[6], one[1], arrival[i], late, rules, state, clock, counts)
        if np.isnan(time):
            state[GAP] = 1
            continue
        first, rows, azimuth = rows_of(one, rules, state, late)
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
            state[SOURCE] = one[7]
            state[NEWEST] = absolute
            state[GAP] = 0
            state[LAST_COUNT] = one[6]
            clock[LAST_TIME] = time
            clock[LAST_ARRIVAL] = arrival[i]


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
