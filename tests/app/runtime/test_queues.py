"""The queues between threads drop the oldest scan, refuse aloud, and end when closed."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from app.runtime.queues import BlockQueue, Closed, Inbox
from pipeline.tables import Sweeps


def block(scan: int, row: int) -> Sweeps:
    rows = np.array([row], np.int32)
    return Sweeps(0, scan, rows, np.zeros(1), np.zeros(1), np.zeros((1, 8), np.uint8))


def test_the_oldest_scan_goes_as_a_whole() -> None:
    queue = BlockQueue(limit=4)
    for scan in (0, 1):
        for row in (0, 1):
            queue.put(block(scan, row))
    queue.put(block(2, 0))
    assert [queue.get().scan for _ in range(3)] == [1, 1, 2]
    assert (queue.dropped_blocks, queue.dropped_sweeps) == (2, 2)


def test_a_closed_block_queue_lets_its_thread_go() -> None:
    queue = BlockQueue(limit=4)
    ended = threading.Event()

    def serve() -> None:
        with pytest.raises(Closed):
            queue.get()
        ended.set()

    thread = threading.Thread(target=serve)
    thread.start()
    queue.close()
    thread.join(5)
    assert ended.is_set()
    queue.put(block(0, 0))
    assert len(queue) == 0


def test_an_inbox_refuses_when_full_and_hands_out_everything_when_closed() -> None:
    inbox: Inbox[int] = Inbox(limit=2)
    assert [inbox.offer(i) for i in range(3)] == [True, True, False]
    assert inbox.refused == 1
    inbox.close()
    assert not inbox.offer(9)
    assert inbox.take_all(0) == [0, 1]
    with pytest.raises(Closed):
        inbox.take_all(0)
