"""Which rows of the grid a message covers, by the spacing of successive azimuths.

The end azimuth of a message says nothing for sure: radars send the next start, the width of the beam, the start again
or nothing there. It is taken while it agrees with the start of the next message.
"""

from __future__ import annotations

import numpy as np

from pipeline.assemble.fit import fits
from pipeline.assemble.state import (
    BELIEVED,
    CLAIMED,
    END_TRUST,
    EXTENSION,
    FINE,
    GREATEST_STEP,
    MOST_TRUST,
    ODD_RUN,
    PREVIOUS_END,
    PREVIOUS_START,
    SPACING,
    WRONG_AZIMUTH,
)
from pipeline.kernels.compiled import allocating


@allocating
def begin(fields, rules, state, refused, counts):  # type: ignore[no-untyped-def]
    """Learn from the first messages whether their end azimuths are to be believed; False: the next azimuth is needed.

    An end that fits the grid needs no other witness. For use before anything was taken; changes neither refused nor
    counts for good.
    """
    first = -1
    kept_refused, kept_counts = refused.copy(), counts.copy()
    ready = True
    for i in range(fields.shape[0]):
        one = fields[i]
        if (one[7] & rules.source_mask) != rules.source or not fits(one, rules, refused, counts):
            continue
        if first < 0:
            width = (one[2] - one[1]) & 0xFFFF
            if _agrees(width * rules.azimuths - 65536, rules.azimuths, 65536):
                state[END_TRUST] = 1
                break
            first, ready = i, False
            continue
        before = fields[first]
        forward = (one[1] - before[1]) & 0xFFFF
        if one[7] == before[7] and 0 < forward < GREATEST_STEP:
            state[SPACING] = forward * 1024
            state[END_TRUST] = 1 if _agrees(one[1] - before[2], 1, forward) else -1
            ready = True
            break
    refused[:] = kept_refused
    counts[:] = kept_counts
    return ready


@allocating
def rows_of(one, rules, state, late):  # type: ignore[no-untyped-def]
    """(first grid row, rows, azimuth of the centre or nan) that the message covers."""
    start = one[1]
    extension = 0
    if not late and start == state[PREVIOUS_START]:
        extension = state[EXTENSION]  # a further part of the same azimuth
    elif not late:
        _learn_spacing(start, state)
        # counts of a sweep that no message claims (rounding, azimuths that do not divide 65,536) go to the next one
        extension = (start * 1024 - state[CLAIMED]) % FINE if state[CLAIMED] >= 0 else 0
        if extension * rules.azimuths >= FINE:
            extension = 0
    width = _width(one, rules, state)
    if not late:
        state[PREVIOUS_START], state[PREVIOUS_END], state[EXTENSION] = start, one[2], extension
        state[CLAIMED] = (start * 1024 + width) % FINE
    low = start * 1024 - extension + rules.offset
    high = start * 1024 + width + rules.offset
    first = -((FINE - 2 * rules.azimuths * low) // (2 * FINE))
    end = -((FINE - 2 * rules.azimuths * high) // (2 * FINE))
    middle = start * 1024 + rules.offset + width // 2
    if end - first > 1:
        return first, end - first, np.nan
    if end <= first:
        first = (rules.azimuths * middle) // FINE
    return first, 1, middle * (2 * np.pi / FINE)


@allocating
def end_fits(one, state, counts):  # type: ignore[no-untyped-def]
    """False for an end azimuth that cannot be, of a radar whose ends have been right."""
    if ((one[2] - one[1]) & 0xFFFF) <= GREATEST_STEP or state[END_TRUST] < 0:
        return True
    counts[WRONG_AZIMUTH] += 1
    state[END_TRUST] -= 1
    return False


@allocating
def _width(one, rules, state):  # type: ignore[no-untyped-def]
    """FINE units that the message covers: up to its end where the ends are right, else the usual spacing."""
    width = (one[2] - one[1]) & 0xFFFF
    if state[END_TRUST] > 0 and width > 0:
        return width * 1024
    if state[SPACING] > 0:
        return state[SPACING]
    return width * 1024 if 0 < width <= GREATEST_STEP else FINE // rules.azimuths


@allocating
def _learn_spacing(start, state):  # type: ignore[no-untyped-def]
    """Spacing of successive azimuths, and whether they begin where the ones before say that they end."""
    forward = (start - state[PREVIOUS_START]) & 0xFFFF
    if state[PREVIOUS_START] < 0 or state[PREVIOUS_END] < 0 or forward >= GREATEST_STEP:
        return
    fine, usual = forward * 1024, state[SPACING]
    if usual == 0:
        state[SPACING] = fine
    elif usual <= 2 * fine <= 4 * usual:
        state[SPACING] += (fine - usual) // 16
        state[ODD_RUN] = 0
    else:
        state[ODD_RUN] += 1
        if state[ODD_RUN] >= BELIEVED:
            state[SPACING], state[ODD_RUN] = fine, 0
    step = 1 if _agrees(start - state[PREVIOUS_END], 1, forward) else -1
    state[END_TRUST] = min(max(state[END_TRUST] + step, -MOST_TRUST), MOST_TRUST)


@allocating
def _agrees(difference, scale, spacing):  # type: ignore[no-untyped-def]
    """An end azimuth and what it should be differ by rounding, or by an eighth of the spacing, at most."""
    off = difference if scale != 1 else ((difference + 0x8000) & 0xFFFF) - 0x8000
    return abs(off) <= 2 * scale or 8 * abs(off) <= spacing
