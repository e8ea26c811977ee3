"""Journals for tests: written with clocks that a test turns by hand."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from pathlib import Path

from app.journal.output import JournalOutput
from app.journal.writer import JournalLimits, JournalWriter

START = 1_766_400_000.25
ATTACHMENTS = {
    "settings.json": b'{"port": 8000}',
    "versions.json": b'{"airside": "0.1.0"}',
    "airport.geojson": b"{}" * 50,
}
LIMITS = JournalLimits(max_file_bytes=10**9, max_total_bytes=10**10, chunk_age_s=0.0)
NOISE = bytes(itertools.islice(itertools.cycle(range(251)), 4096))


class Hand:
    """A monotonic clock that goes on when told."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.01)


def body(topic: str, number: int) -> bytes:
    return f"{topic} {number} ".encode() + NOISE[number % 200 : number % 200 + 500]


def put(writer: JournalWriter, topic: str, number: int) -> None:
    writer.put(topic, START + number, lambda: body(topic, number))


def put_written(writer: JournalWriter, topic: str, number: int) -> None:
    """Hand over, and wait until it is in a chunk on the disk."""
    before = writer.state().counters
    put(writer, topic, number)
    until(lambda: writer.state().counters.records > before.records and writer.state().counters.octets > before.octets)


def chunked(path: Path, records: int = 30, snapshot_every: int = 10, first: int = 0, run: str = "0a0b0c0d") -> Path:
    """A finished file with a chunk for every three records."""
    output = JournalOutput(path)
    output.begin_run(run, 1, ATTACHMENTS, START)
    for number in range(first, first + records):
        topic = "snapshot" if (number - first) % snapshot_every == 0 else "event"
        output.add(topic, number, START + number, body(topic, number))
        if number % 3 == 2:
            output.close_chunk()
    output.finish()
    return path
