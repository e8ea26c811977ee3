"""Whose messages are taken, and in which order they were sent."""

from __future__ import annotations

import numpy as np

from pipeline.assemble.fit import fits, refuse
from pipeline.assemble.state import (
    BEFORE,
    BELIEVED,
    CANDIDATE,
    CLAIMED,
    DAY_COUNTS,
    DUPLICATE,
    DUPLICATE_RUN,
    END_TRUST,
    GAP,
    GREATEST_GAP,
    GREATEST_STEP,
    HAVE,
    LAST_ARRIVAL,
    LAST_COUNT,
    LAST_ID,
    LATE_ID,
    LATE_RUN,
    LOST,
    OUT_OF_SEQUENCE,
    PREVIOUS_END,
    PREVIOUS_START,
    REFUSED_WHY,
    REORDER,
    RESTART,
    SEEN,
    SEEN_ARRIVAL,
    SEEN_KEY,
    SEEN_TIME,
    SOURCE,
    SOURCE_SILENT_TURNS,
    SPACING,
    WRONG_CELL_COUNT,
    WRONG_GEOMETRY,
    WRONG_SOURCE,
)
from pipeline.kernels.compiled import allocating


@allocating
def wanted(one, arrival, rules, state, clock, seen, counts, refused):  # type: ignore[no-untyped-def]
    """The message is of the source that is set or, where several may be, of the one that the stream began with."""
    source = one[7]
    if (source & rules.source_mask) != rules.source:
        counts[WRONG_SOURCE] += 1
        if refused[REFUSED_WHY] not in (WRONG_GEOMETRY, WRONG_CELL_COUNT):  # those are of the wanted source
            refuse(one, WRONG_SOURCE, refused)
        return False
    if state[HAVE] == 0 or source == state[SOURCE]:
        return True
    if arrival - clock[LAST_ARRIVAL] <= SOURCE_SILENT_TURNS * rules.period:
        counts[WRONG_SOURCE] += 1
        return False
    if not fits(one, rules, refused, counts):
        return False
    _restart(one[0], state, seen, counts)
    state[LAST_ID] = -1
    state[SOURCE] = source
    state[PREVIOUS_START] = -1
    state[SPACING] = state[END_TRUST] = 0
    return True


@allocating
def in_sequence(one, arrival, rules, state, seen, counts):  # type: ignore[no-untyped-def]
    """0 in order, 1 late, -1 not to be taken."""
    message = one[0]
    key = message << 32 | one[1] << 16 | (one[3] & 0xFFFF)
    slot = message % SEEN
    micros = np.int64(arrival * 1e6)
    # a radar whose numbers begin anew each turn, and that tells no time, is told from itself by the arrival
    apart = abs(micros - seen[slot, SEEN_ARRIVAL]) >= 0.5e6 * rules.period
    if seen[slot, SEEN_KEY] == key and seen[slot, SEEN_TIME] == one[6] and not apart:
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
    if _of_the_end(one, state):
        late = True
    elif gap <= GREATEST_GAP:
        if gap > 1:
            counts[LOST] += gap - 1
            lose_touch(state)
        state[LATE_RUN] = 0
        state[CANDIDATE] = -1
        state[LAST_ID] = message
    elif message < state[LAST_ID] and _goes_on(one, state):
        # numbers that begin anew each turn, or wrap before 32 bits
        state[BEFORE] = state[LAST_ID]
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
    seen[slot, SEEN_KEY] = key
    seen[slot, SEEN_TIME] = one[6]
    seen[slot, SEEN_ARRIVAL] = micros
    return 1 if late else 0


@allocating
def _of_the_end(one, state):  # type: ignore[no-untyped-def]
    """The message was overtaken by the first ones of numbers that have begun anew."""
    behind = (state[PREVIOUS_START] - one[1]) & 0xFFFF
    begun = state[BEFORE] >= 0 and state[LAST_ID] < state[BEFORE] and state[PREVIOUS_START] >= 0
    return begun and one[0] > state[LAST_ID] and abs(one[0] - state[BEFORE]) <= BELIEVED and 0 < behind < GREATEST_STEP


@allocating
def _goes_on(one, state):  # type: ignore[no-untyped-def]
    """Azimuth and time of the message follow those of the newest."""
    forward = (one[1] - state[PREVIOUS_START]) & 0xFFFF
    if state[PREVIOUS_START] < 0 or forward == 0 or forward >= GREATEST_STEP:
        return False
    timed = one[6] >= 0 and state[LAST_COUNT] >= 0
    if timed and (one[6] - state[LAST_COUNT]) % DAY_COUNTS > DAY_COUNTS // 2:
        return False
    if state[SPACING] > 0 and 2 * forward * 1024 > 3 * state[SPACING]:
        lose_touch(state)
    return True


@allocating
def _restart(message, state, seen, counts):  # type: ignore[no-untyped-def]
    counts[RESTART] += 1
    seen[:] = -1
    state[LAST_ID] = message
    state[CANDIDATE] = -1
    state[LATE_RUN] = 0
    lose_touch(state)


@allocating
def lose_touch(state):  # type: ignore[no-untyped-def]
    """Something is missing before the next message."""
    state[GAP] = 1
    state[PREVIOUS_END] = state[CLAIMED] = -1
