"""What a stream of video messages says about the radars that it comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.assemble.state import GREATEST_STEP
from pipeline.asterix.cat240_batch import CELLS, DURATION, END, FIRST_CELL, MESSAGE, SOURCE, START, TIME

DAY_S = 86400.0

OUTLIER = 3.0
"""A step of this many usual ones is a sector that was not sent, not the spacing of the azimuths."""

MOST_SPACINGS = 64
"""A step over more is not counted in spacings: their number is not sure."""

PARTS = 8
"""Parts of a turn whose durations are compared."""

STEP_TOLERANCE = 0.25
"""A part of a turn that takes so much more or less than most has a step of the clock in it."""

TIME_COUNT_S = 1 / 128
"""One count of the time of day."""


@dataclass(frozen=True, slots=True)
class SourceSurvey:
    """One source in a stream.

    source: SAC << 8 | SIC. messages: how many. azimuths: a turn, from the spacing of successive start azimuths, 0 when
    it cannot be told. period_s: of a turn, nan when it cannot be told. durations: (fs, messages) of each cell duration,
    the most frequent first. first_cell, ranges: cells before the first and from there on, of messages of the most
    frequent duration.
    """

    source: int
    messages: int
    azimuths: int
    period_s: float
    durations: tuple[tuple[int, int], ...]
    first_cell: int
    ranges: int


def survey(fields: NDArray[np.int64], arrival: NDArray[np.float64]) -> list[SourceSurvey]:
    """The sources in messages `fields` (see `pipeline.asterix.cat240_batch`), the one of most messages first.

    arrival: (n,) UTC s, for messages that tell no time.
    """
    found = [_one(int(one), fields[fields[:, SOURCE] == one], arrival[fields[:, SOURCE] == one])
             for one in np.unique(fields[:, SOURCE])]  # fmt: skip
    return sorted(found, key=lambda one: -one.messages)


def _one(source: int, fields: NDArray[np.int64], arrival: NDArray[np.float64]) -> SourceSurvey:
    values, counts = np.unique(fields[:, DURATION], return_counts=True)
    ranked = sorted(zip(values.tolist(), counts.tolist(), strict=True), key=lambda one: (-one[1], one[0]))
    usual = fields[fields[:, DURATION] == ranked[0][0]]
    first = int(usual[:, FIRST_CELL].min())
    return SourceSurvey(
        source=source,
        messages=len(fields),
        azimuths=_azimuths(fields),
        period_s=_period(fields, arrival),
        durations=tuple(ranked),
        first_cell=first,
        ranges=int((usual[:, FIRST_CELL] + usual[:, CELLS]).max()) - first,
    )


def _azimuths(fields: NDArray[np.int64]) -> int:
    """Azimuths a turn; what END_AZ says only where nothing else can."""
    step = np.diff(fields[:, START]) & 0xFFFF
    number = np.diff(fields[:, MESSAGE]) & 0xFFFFFFFF
    turning = (step > 0) & (step < GREATEST_STEP)
    step, number = step[turning], number[turning]
    if len(step):
        usual = step[number == 1] if (number == 1).any() else step
        usual = usual[usual <= OUTLIER * np.median(usual)].mean()
        # a step over lost messages is of several spacings; over a sector that is not sent, of too many to be told
        near = step <= MOST_SPACINGS * usual
        spacings = np.where(number == 1, 1, np.maximum(np.round(step / usual), 1))
        near &= (number != 1) | (step <= OUTLIER * usual)
        return round(65536 * float(spacings[near].sum()) / float(step[near].sum()))
    width = (fields[:, END] - fields[:, START]) & 0xFFFF
    width = width[(width > 0) & (width < GREATEST_STEP)]
    return round(65536 / float(np.median(width))) if len(width) else 0


def _period(fields: NDArray[np.int64], arrival: NDArray[np.float64]) -> float:
    """Seconds a turn, by the time of day of the messages, or by their arrival; nan for less than half a turn."""
    timed = fields[:, TIME] >= 0
    if np.count_nonzero(timed) > 1:
        start, time = fields[timed, START], fields[timed, TIME] * TIME_COUNT_S
        # midnight, and not the whole day, lies between a late time and an early one
        time = time - DAY_S * np.round((time - time[0]) / DAY_S)
    else:
        start, time = fields[:, START], arrival
    step = np.diff(start) & 0xFFFF
    turned = np.cumsum(np.where(step < 0x8000, step, 0)) / 65536
    if not len(turned) or turned[-1] <= 0.5:
        return float("nan")
    parts = np.interp(np.arange(0, turned[-1], 1 / PARTS), np.append(0.0, turned), time)
    periods = np.diff(parts) * PARTS
    usual = float(np.median(periods))
    # without the parts in which the clock steps
    best = float(periods[np.abs(periods - usual) <= STEP_TOLERANCE * usual + PARTS * TIME_COUNT_S].mean())
    return best if best > 0 else float("nan")
