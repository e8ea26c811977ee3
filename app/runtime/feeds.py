"""The ways in of rows: node events and target reports. Judges their times, and tells how each fares."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import TypeVar

from app.contract import Refused, RefusedTime, Submitted
from app.runtime.clocks import FeedTimes
from pipeline.picture import SensorState
from pipeline.tables import NodeEvents, TargetReports

Rows = TypeVar("Rows", NodeEvents, TargetReports)

SENSOR_SILENT_S = 10.0
"""Target reports are called silent after this long without any."""


class Feed:
    """One way in. id: of its sensor state. kind: "node" or "report". simulated: all that comes in is. Any thread may
    call."""

    def __init__(self, id: str, kind: str, times: FeedTimes, simulated: bool = False) -> None:
        self.id, self._kind, self._simulated = id, kind, simulated
        self._times = times
        self._heard: tuple[float, float] | None = None
        self._taken = 0
        self._bad: Counter[str] = Counter()
        self._lock = threading.Lock()

    def submit(self, table: Rows, arrival: float, offer: Callable[[Rows], bool]) -> tuple[Rows, Submitted]:
        """Judge the times, offer what is good, and count; the rows taken with their times, and what became of all.

        arrival: UTC s. offer: takes rows, False when there is no room. Raises RefusedTime, Refused.
        """
        good, refused = self._times.judge(table, arrival)
        if refused and not len(good):
            why = refused[0].message
            raise RefusedTime(why if len(table) == 1 else f"all {len(table)} are refused; {why}", refused)
        if len(good):
            if not offer(good):
                raise Refused(f"the queue for {self.id} is full")
            with self._lock:
                self._heard = (time.monotonic(), float(good.time.max()))
                self._taken += len(good)
        return good, Submitted(len(good), refused)

    def note_bad(self, counts: Mapping[str, int]) -> None:
        """Count rows that could not be read, by reason."""
        with self._lock:
            self._bad.update(counts)

    @property
    def ever_heard(self) -> bool:
        """Rows were taken since the start."""
        return self._heard is not None

    @property
    def ever_tried(self) -> bool:
        """Something came in since the start, good or bad."""
        return self.ever_heard or self._times.has_refused or bool(self._bad)

    @property
    def silent(self) -> bool:
        """Rows were taken, but not lately."""
        heard = self._heard
        return heard is not None and time.monotonic() - heard[0] > SENSOR_SILENT_S

    def state(self) -> SensorState:
        """How it fares. Nodes are never silent: they may not be passed for hours."""
        with self._lock:
            bad = {f"refused_{reason}": count for reason, count in sorted(self._bad.items())}
            heard, taken = self._heard, self._taken
        if heard is None:
            return self._times.shown(SensorState(self.id, self._kind, "waiting", None, self._simulated, counters=bad))
        status = "silent" if self._kind != "node" and self.silent else "ok"
        counters = {"taken": taken, **bad}
        return self._times.shown(SensorState(self.id, self._kind, status, heard[1], self._simulated, counters=counters))
