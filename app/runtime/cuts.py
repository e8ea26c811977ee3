"""What was cut away lately so that a radar's thread could keep up, in words that a controller understands."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

WINDOW_S = 10.0
"""The status names a cut for this long after it."""

WORDS_EVERY_S = 2.0
"""The figures in the words change at most this often: every new word is stored and sent."""

COUNTERS = {
    "degraded_sweeps": ("detections cut", "sweeps"),
    "runs_dropped": ("echoes left out of plots", "runs"),
    "queue_dropped_sweeps": ("video dropped, the machine does not keep up", "sweeps"),
}
"""The counters that tell of a cut: what was done, and what is counted."""


class Cuts:
    """Watches counters that only grow. `note` is called by the radar's thread, the rest by anybody."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._seen: dict[str, int] = {}
        self._cuts: deque[tuple[float, dict[str, int]]] = deque()
        self._lock = threading.Lock()
        self._words = ""
        self._words_at = float("-inf")

    def note(self, counters: Mapping[str, int]) -> None:
        """Look at the counters, after each block."""
        grown = {}
        for name in COUNTERS:
            count = counters.get(name, 0)
            if count > self._seen.get(name, 0):
                grown[name] = count - self._seen.get(name, 0)
            self._seen[name] = count
        if grown:
            with self._lock:
                self._cuts.append((self._clock(), grown))

    def lately(self) -> dict[str, int]:
        """What was cut within the window, by counter; empty when nothing was."""
        with self._lock:
            return self._lately()

    def words(self) -> str:
        """What was cut within the window, for a person; empty when nothing was."""
        with self._lock:
            cut, now = self._lately(), self._clock()
            if not cut:
                self._words, self._words_at = "", float("-inf")
            elif now - self._words_at >= WORDS_EVERY_S:
                told = [
                    f"{COUNTERS[name][0]}, {count} {COUNTERS[name][1]} in the last {WINDOW_S:g} s"
                    for name, count in cut.items()
                ]
                self._words, self._words_at = "; ".join(told), now
            return self._words

    def _lately(self) -> dict[str, int]:
        since = self._clock() - WINDOW_S
        while self._cuts and self._cuts[0][0] <= since:
            self._cuts.popleft()
        total: dict[str, int] = {}
        for _, grown in self._cuts:
            for name, count in grown.items():
                total[name] = total.get(name, 0) + count
        return total
