"""The offset of a source's clock to the time of arrival, estimated from what arrives with the least latency."""

from __future__ import annotations

import math
from collections import deque

WINDOW_S = 30.0
"""Length of data that the estimate rests on: long enough to meet a datum with little latency, short enough to follow a
clock that drifts by 50 ppm within 2 ms."""

QUANTILE = 0.75
"""Of the greatest offset in each second: high, because latency only makes offsets smaller; not the highest, so that one
datum with a wrong time changes nothing."""

STEP_S = 0.5
"""A smaller change of the offset is jitter of the network, not a step of the clock."""

THREADS_S = 1
"""s. Data taken by several threads at the same time may come here this much out of order."""

AHEAD_SECONDS, BEHIND_SECONDS = 3, 10
"""Whole seconds in a row that must show a step. Latency never makes a clock seem ahead, but for some seconds behind."""


class OffsetEstimate:
    """Fed with `stated - arrival`. value: s, nan before the first. spread: s, between the quartiles of the seconds.
    steps: how often the offset has changed for good."""

    def __init__(self) -> None:
        self.value = math.nan
        self.spread = 0.0
        self.steps = 0
        self._seconds: deque[tuple[int, float]] = deque()

    def push(self, offset: float, arrival: float) -> None:
        """Take the greatest offset (s) of what arrived together. arrival: UTC s."""
        second = math.floor(arrival)
        newest = self._seconds[-1][0] if self._seconds else second - 1
        if second < newest - THREADS_S:
            self.clear()  # the host's clock was set back: what was learned is of another clock
        if self._seconds and second <= newest:
            self._seconds[-1] = (newest, max(self._seconds[-1][1], offset))
        else:
            self._find_step()
            self._seconds.append((second, offset))
        while self._seconds[0][0] < second - WINDOW_S:
            self._seconds.popleft()
        self._estimate()

    def shift(self, seconds: float) -> None:
        """The source's clock has stepped by so much: what was learned holds for the clock as it is now."""
        self._seconds = deque((second, offset + seconds) for second, offset in self._seconds)
        self.value += seconds

    def clear(self) -> None:
        """Forget what was learned."""
        self._seconds.clear()
        self.value, self.spread = math.nan, 0.0

    def _find_step(self) -> None:
        """Forget the seconds before a step. All seconds are complete when this is called."""
        offsets = [offset for _, offset in self._seconds]
        for count, sign in ((AHEAD_SECONDS, 1.0), (BEHIND_SECONDS, -1.0)):
            before, since = offsets[:-count], offsets[-count:]
            if before and all(sign * (one - _quantile(before, QUANTILE)) > STEP_S for one in since):
                self.steps += 1
                for _ in before:
                    self._seconds.popleft()
                return

    def _estimate(self) -> None:
        offsets = [offset for _, offset in self._seconds]
        self.value = _quantile(offsets, QUANTILE)
        self.spread = self.value - _quantile(offsets, 1 - QUANTILE)


def _quantile(values: list[float], part: float) -> float:
    """The lower of the two values between which the quantile lies: of two, the lesser."""
    return sorted(values)[int(part * (len(values) - 1))]
