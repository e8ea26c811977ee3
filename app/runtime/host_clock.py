"""The time of arrival: UTC of this host, steady while the system's clock is being corrected."""

from __future__ import annotations

import threading
import time as system
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

STEP_S = 60.0
"""The system's clock is followed at once when it is further away than this (s): it was wrong, or the host slept."""

SLEW = 0.02
"""A smaller difference is made good at this rate (s/s): a second takes 50 s, and arrival time never runs back."""

Moments = TypeVar("Moments", float, NDArray[np.float64])


class HostClock:
    """UTC in seconds, counted by the steady clock and led towards the system's. Any thread may ask.

    time: UTC s of the system, which an administrator, NTP or a leap second may set. monotonic: s of a clock that nobody
    sets. Both are given by tests.
    """

    def __init__(
        self, time: Callable[[], float] = system.time, monotonic: Callable[[], float] = system.monotonic
    ) -> None:
        self._time, self._monotonic = time, monotonic
        self._lock = threading.Lock()
        self._checked = monotonic()
        self._anchor = time() - self._checked
        self._stepped = 0.0

    def now(self) -> float:
        """UTC, s. Never less than before, but for a step (see `now_and_step`)."""
        with self._lock:
            return self._follow()

    def at(self, moment: Moments) -> Moments:
        """UTC, s, of moments of the steady clock (s, a number or an array) that have just been."""
        with self._lock:
            self._follow()
            return moment + self._anchor

    def now_and_step(self) -> tuple[float, float]:
        """UTC, s, and the seconds by which this clock has jumped since this was last asked; 0 when it has not."""
        with self._lock:
            now = self._follow()
            stepped, self._stepped = self._stepped, 0.0
            return now, stepped

    def _follow(self) -> float:
        steady = self._monotonic()
        off = self._time() - (self._anchor + steady)
        if abs(off) >= STEP_S:
            self._anchor += off
            self._stepped += off
        else:
            most = SLEW * max(steady - self._checked, 0.0)
            self._anchor += min(max(off, -most), most)
        self._checked = max(steady, self._checked)
        return self._anchor + steady
