"""The bounded queues between the threads: radar blocks lose their oldest scan, everything else is refused aloud."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

from pipeline.tables import Sweeps

Item = TypeVar("Item")


class Closed(Exception):
    """The queue was closed and is empty."""


class BlockQueue:
    """Blocks of one radar's sweeps; when more than `limit` wait, the oldest scan's are dropped and counted."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.dropped_blocks = 0
        self.dropped_sweeps = 0
        self._blocks: deque[Sweeps] = deque()
        self._ready = threading.Condition()
        self._closed = False
        self._woken = False

    def put(self, block: Sweeps) -> None:
        """Append a block; never waits."""
        with self._ready:
            if self._closed:
                return
            self._blocks.append(block)
            if len(self._blocks) > self.limit:
                self._drop_oldest_scan()
            self._ready.notify()

    def wake(self) -> None:
        """Let `get` return even without a block."""
        with self._ready:
            self._woken = True
            self._ready.notify()

    def get(self) -> Sweeps | None:
        """The oldest block; waits for one. None when woken without one. Raises Closed."""
        with self._ready:
            while not self._blocks:
                if self._closed:
                    raise Closed
                if self._woken:
                    self._woken = False
                    return None
                self._ready.wait()
            return self._blocks.popleft()

    def close(self) -> None:
        """Take no more; what waits is dropped, so that the thread that serves the queue ends soon."""
        with self._ready:
            self._closed = True
            self._blocks.clear()
            self._ready.notify_all()

    def __len__(self) -> int:
        return len(self._blocks)

    def _drop_oldest_scan(self) -> None:
        oldest = self._blocks[0].scan
        while self._blocks and self._blocks[0].scan == oldest:
            gone = self._blocks.popleft()
            self.dropped_blocks += 1
            self.dropped_sweeps += len(gone)


class Inbox(Generic[Item]):
    """What waits for the surface thread. `offer` refuses when full, so that whoever sent it hears of it."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.refused = 0
        self._items: deque[Item] = deque()
        self._ready = threading.Condition()
        self._closed = False

    def offer(self, item: Item) -> bool:
        """Append; False (counted) when full or closed."""
        with self._ready:
            if self._closed or len(self._items) >= self.limit:
                self.refused += 1
                return False
            self._items.append(item)
            self._ready.notify()
            return True

    def take_all(self, timeout: float) -> list[Item]:
        """Everything that waits, after at most `timeout` seconds. Raises Closed when closed and empty."""
        with self._ready:
            if not self._items and not self._closed:
                self._ready.wait(timeout)
            taken = list(self._items)
            self._items.clear()
            if not taken and self._closed:
                raise Closed
            return taken

    def close(self) -> None:
        """Take no more; what waits is still handed out."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()

    def __len__(self) -> int:
        return len(self._items)
