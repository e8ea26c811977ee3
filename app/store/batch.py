"""What waits to be written: track points may be dropped (counted) when the writer is too far behind, alerts never."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection

from pipeline.picture import AlertChange, SensorState
from pipeline.tables import NodeEvents, Tracks

Call = tuple[Callable[[Connection], Any], "Future[Any]"]


@dataclass
class Batch:
    """One transaction's worth. calls: work that a caller waits for."""

    changes: list[AlertChange] = field(default_factory=list)
    tracks: list[Tracks] = field(default_factory=list)
    events: list[NodeEvents] = field(default_factory=list)
    sensors: list[tuple[float, SensorState]] = field(default_factory=list)
    calls: list[Call] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.changes or self.tracks or self.events or self.sensors or self.calls)


class Queue:
    """Filled from any thread without waiting, emptied by the writer. limit: batches of points (and of events)."""

    BATCH = 256

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.counters: Counter[str] = Counter(points_dropped=0, node_events_dropped=0, sensor_states_dropped=0)
        self._changes: deque[AlertChange] = deque()
        self._taken: list[AlertChange] = []
        self._tracks: deque[Tracks] = deque()
        self._events: deque[NodeEvents] = deque()
        self._sensors: deque[tuple[float, SensorState]] = deque()
        self._calls: deque[Call] = deque()
        self._condition = threading.Condition()
        self._closed = False

    def put(
        self,
        *,
        changes: tuple[AlertChange, ...] = (),
        tracks: Tracks | None = None,
        events: NodeEvents | None = None,
        sensors: tuple[tuple[float, SensorState], ...] = (),
    ) -> None:
        """Add what is to be written; never waits. Alert changes wake the writer at once."""
        with self._condition:
            self._changes.extend(changes)
            if tracks is not None and len(tracks):
                self._tracks.append(tracks)
                if len(self._tracks) > self.limit:
                    self.counters["points_dropped"] += len(self._tracks.popleft())
            if events is not None and len(events):
                self._events.append(events)
                if len(self._events) > self.limit:
                    self.counters["node_events_dropped"] += len(self._events.popleft())
            for one in sensors:
                self._sensors.append(one)
                if len(self._sensors) > self.limit:
                    self._sensors.popleft()
                    self.counters["sensor_states_dropped"] += 1
            if changes:
                self._condition.notify()

    def call(self, work: Callable[[Connection], Any]) -> Future[Any]:
        """Have `work` done in the writer's transaction. Raises RuntimeError when the writer has ended."""
        future: Future[Any] = Future()
        with self._condition:
            if self._closed:
                raise RuntimeError("the database writer has ended")
            self._calls.append((work, future))
            self._condition.notify()
        return future

    def take(self, wait_s: float) -> Batch:
        """Everything that waits (bounded), after at most `wait_s` or at once when somebody is waiting for it."""
        with self._condition:
            if not (self._changes or self._calls or self._closed):
                self._condition.wait(wait_s)
            self._taken = _drain(self._changes, self.BATCH * 4)
            return Batch(
                self._taken,
                _drain(self._tracks, self.BATCH),
                _drain(self._events, self.BATCH),
                _drain(self._sensors, self.BATCH),
                _drain(self._calls, self.BATCH),
            )

    def changes(self) -> list[AlertChange]:
        """The alert changes that wait, after those that were taken last (and may be written by now), in order."""
        with self._condition:
            return [*self._taken, *self._changes]

    def written(self) -> None:
        """What was taken last is committed (or given up)."""
        with self._condition:
            self._taken = []

    def pause(self, seconds: float) -> bool:
        """Wait, but not beyond the end; True when it has come."""
        with self._condition:
            return self._condition.wait_for(lambda: self._closed, seconds)

    def close(self) -> None:
        """Take no more calls; what waits is still handed out."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    @property
    def closed(self) -> bool:
        """The end has come."""
        return self._closed

    def __len__(self) -> int:
        waiting = len(self._changes) + len(self._tracks) + len(self._events)
        return waiting + len(self._sensors) + len(self._calls)


def _drain(queue: deque[Any], limit: int) -> list[Any]:
    return [queue.popleft() for _ in range(min(limit, len(queue)))]
