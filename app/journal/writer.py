"""Writes the journal in a thread of its own: handing over a record never waits and never raises."""

from __future__ import annotations

import logging
import secrets
import threading
import time as clocks
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Self

from app.journal.names import GAP, SNAPSHOT, FileName, journal_files, parsed, size_of, start_text
from app.journal.output import CHUNK_BYTES, JournalOutput
from app.private_files import FOLDER_MODE
from app.settings import JournalSettings
from pipeline.values import ValueCodec

log = logging.getLogger(__name__)

TICK_S = 0.1
"""How often the thread takes what waits. It is not woken for each record: that would cost the surface thread more."""

SNAPSHOT_PAUSE_S = 1.0
"""Snapshots are not asked for more often than this, whatever the reason."""

FIRST_GUESS_BYTES = 4096
"""A record of a topic of which none was encoded yet counts as this much of the queue."""

MIB = 1024 * 1024
_plain = ValueCodec()


@dataclass(frozen=True, slots=True)
class JournalLimits:
    """Bounds in octets and s. chunk_age_s: what is older is on disk. queue_bytes: waiting for the thread at most."""

    max_file_bytes: int = 256 * MIB
    max_file_age_s: float = 3600.0
    max_total_bytes: int = 20480 * MIB
    snapshot_every_s: float = 60.0
    chunk_bytes: int = CHUNK_BYTES
    chunk_age_s: float = 1.5
    queue_bytes: int = 64 * MIB
    queue_records: int = 100_000

    @classmethod
    def of(cls, settings: JournalSettings) -> Self:
        """The bounds that the settings ask for. A file is at most half of all, so that one stays when one goes."""
        total = settings.max_total_mib * MIB
        return cls(
            max_file_bytes=min(settings.max_file_mib * MIB, total // 2),
            max_file_age_s=settings.max_file_age_s,
            max_total_bytes=total,
            snapshot_every_s=settings.snapshot_every_s,
        )


@dataclass(frozen=True, slots=True)
class JournalCounters:
    """What was written, and what was not; they only grow.

    records, octets (compressed, in files), files, snapshots: written. dropped: records that are missing because the
    queue was full, a record could not be encoded, or the journal stopped. before_snapshot: handed over before the first
    snapshot, and so not part of the journal. removed: old files removed to keep the bound on all.
    """

    records: int = 0
    octets: int = 0
    files: int = 0
    snapshots: int = 0
    dropped: int = 0
    before_snapshot: int = 0
    removed: int = 0


@dataclass(frozen=True, slots=True)
class JournalState:
    """How the journal is. degraded: records are missing, and will be up to the next snapshot. detail: why."""

    status: Literal["ok", "degraded", "stopped"]
    detail: str
    counters: JournalCounters


@dataclass(slots=True)
class _Gap:
    """Records that are missing in a row. first, last: UTC s of their arrival."""

    reason: str
    first: float
    last: float
    count: int = 0

    def add(self, first: float, last: float, count: int = 1) -> None:
        self.first, self.last, self.count = min(self.first, first), max(self.last, last), self.count + count


@dataclass(slots=True)
class _Item:
    topic: str
    sequence: int
    time: float
    encode: Callable[[], bytes]
    size: int
    gap: _Gap | None = None
    """What was dropped just before this record."""


class JournalWriter:
    """The journal of one run of the service. Every file of it begins with a snapshot.

    folder: made when it is not there. attachments: by name, at the begin of every file. on_failure: called once, with a
    sentence, when the journal stops because of the disk; state() then says "stopped". clock, utc: s, for tests.
    """

    def __init__(
        self,
        folder: Path,
        attachments: Mapping[str, bytes],
        limits: JournalLimits | JournalSettings,
        on_failure: Callable[[str], None] = lambda _: None,
        *,
        clock: Callable[[], float] = clocks.monotonic,
        utc: Callable[[], float] = clocks.time,
    ) -> None:
        self.run = secrets.token_hex(4)
        self._folder = folder
        self._attachments = dict(attachments)
        self._limits = JournalLimits.of(limits) if isinstance(limits, JournalSettings) else limits
        self._on_failure = on_failure
        self._clock, self._utc = clock, utc
        self._started = start_text(utc())
        self._lock = threading.Condition()
        self._items: deque[_Item] = deque()
        self._waiting_bytes = 0
        self._sizes: dict[str, int] = {}
        self._sequence = 0
        self._dropping: _Gap | None = None
        self._begun = False
        self._snapshots_waiting = self._snapshots_taken = 0
        self._last_snapshot: float | None = None
        self._closed = False
        self._stopped = ""
        self._counters = JournalCounters()
        self._gap: _Gap | None = None
        self._output: JournalOutput | None = None
        self._opened = 0.0
        self._chunk_opened: float | None = None
        self._rotation_due = False
        self._octets_before = 0
        try:
            folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
            journal_files(folder)
        except OSError as error:
            self._stop(error)
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def put(self, topic: str, time: float, encode: Callable[[], bytes], size: int | None = None) -> None:
        """Hand over a record. Never waits for the disk and raises nothing. time: UTC s of arrival.

        encode: called in the writer's thread; what it reads must not change any more. size: octets of what it gives,
        where the caller knows; otherwise the last record of that topic is taken for the measure.
        What is put before the first snapshot is not part of the journal; what does not fit into the queue is dropped
        up to the next snapshot.
        """
        with self._lock:
            if self._stopped or self._closed:
                self._count(dropped=1)
                return
            snapshot = topic == SNAPSHOT
            if not self._begun and not snapshot:
                self._count(before_snapshot=1)
                return
            sequence = self._sequence
            self._sequence += 1
            if snapshot:
                self._last_snapshot = self._clock()
            if size is None:
                size = self._sizes.get(topic, FIRST_GUESS_BYTES)
            room = self._waiting_bytes + size <= self._limits.queue_bytes or not self._items
            if (self._dropping is not None and not snapshot) or not room or self._full_of_records():
                self._drop(time)
                return
            self._items.append(_Item(topic, sequence, time, encode, size, self._dropping))
            self._dropping = None
            self._waiting_bytes += size
            if snapshot:
                self._begun = True
                self._snapshots_waiting += 1
                self._snapshots_taken += 1

    @property
    def snapshots_taken(self) -> int:
        """How many snapshots were handed over; cheap."""
        return self._snapshots_taken

    @property
    def wants_snapshot(self) -> bool:
        """Whether the next record should be a snapshot. To be asked by the thread that makes them; cheap."""
        with self._lock:
            if self._stopped or self._closed or self._snapshots_waiting:
                return False
            if self._last_snapshot is None:
                return True
            age = self._clock() - self._last_snapshot
            if age >= self._limits.snapshot_every_s:
                return True
            if age < min(SNAPSHOT_PAUSE_S, self._limits.snapshot_every_s):
                return False
            drained = self._waiting_bytes * 2 <= self._limits.queue_bytes and not self._full_of_records()
            return self._rotation_due or self._gap is not None or (self._dropping is not None and drained)

    def state(self) -> JournalState:
        """How the journal is at this moment."""
        with self._lock:
            octets = self._octets_before + (self._output.written if self._output else 0)
            counters = replace(self._counters, octets=octets)
            if self._stopped:
                return JournalState("stopped", self._stopped, counters)
            gap = self._dropping or self._gap
            if gap is not None:
                return JournalState("degraded", f"{gap.count} records are missing: {gap.reason}", counters)
            return JournalState("ok", "", counters)

    def close(self, timeout: float = 10.0) -> bool:
        """Write what waits, finish the file and end; False when that took longer than `timeout` s."""
        with self._lock:
            self._closed = True
            self._lock.notify_all()
        self._thread.join(timeout)
        if self._thread.is_alive():
            with self._lock:
                self._stopped = self._stopped or f"the disk did not take the end of the journal within {timeout:g} s"
            return False
        return True

    def _full_of_records(self) -> bool:
        return len(self._items) >= self._limits.queue_records

    def _drop(self, time: float) -> None:
        if self._dropping is None:
            self._dropping = _Gap("the disk was too slow and the queue full", time, time)
        self._dropping.add(time, time)
        self._count(dropped=1)

    def _count(self, **more: int) -> None:
        self._counters = replace(
            self._counters, **{name: getattr(self._counters, name) + count for name, count in more.items()}
        )

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._closed:
                    self._lock.wait(TICK_S)
                taken, closed = list(self._items), self._closed
                self._items.clear()
            left = len(taken)
            try:
                for item in taken:
                    self._take(item)
                    left -= 1
                self._let_time_pass()
                if closed and not self._items:
                    self._finish()
                    return
            except Exception as error:
                if not isinstance(error, OSError):
                    log.exception("the journal failed")
                self._stop(error, left)
            if self._stopped:
                return

    def _take(self, item: _Item) -> None:
        snapshot = item.topic == SNAPSHOT
        try:
            data = None if self._gap is not None and not snapshot else item.encode()
        except Exception as error:
            log.exception("the journal could not encode a record of topic %s", item.topic)
            data = None
            self._miss(f"a record of topic {item.topic} could not be encoded ({error})", item.time, item.time, 0)
        with self._lock:
            self._waiting_bytes -= item.size
            self._snapshots_waiting -= snapshot
            if data is not None:
                self._sizes[item.topic] = len(data)
        if item.gap is not None:
            self._miss(item.gap.reason, item.gap.first, item.gap.last, item.gap.count)
        if data is None:
            self._miss("", item.time, item.time, 1)
            with self._lock:
                self._count(dropped=1)
            return
        self._write(item, data, snapshot)

    def _miss(self, reason: str, first: float, last: float, count: int) -> None:
        with self._lock:
            if self._gap is None:
                self._gap = _Gap(reason, first, last)
            self._gap.add(first, last, count)

    def _write(self, item: _Item, data: bytes, snapshot: bool) -> None:
        if snapshot and self._output is not None and self._gap is not None:
            self._write_gap(item.sequence - 1)
        if snapshot and (self._output is None or self._rotation_due):
            self._open_next()
        if self._output is None:
            return
        with self._lock:
            if snapshot:
                self._gap = None
            self._count(records=1, snapshots=int(snapshot))
        self._output.add(item.topic, item.sequence, item.time, data)
        if self._chunk_opened is None:
            self._chunk_opened = self._clock()

    def _write_gap(self, sequence: int) -> None:
        """Say how many records are missing. sequence: that of the last of them, which nothing else bears."""
        gap, output = self._gap, self._output
        if gap is None or output is None:
            return
        told = {"dropped": gap.count, "reason": gap.reason, "first": gap.first, "last": gap.last}
        output.add(GAP, sequence, gap.last, _plain.encode(told))
        with self._lock:
            self._gap = None
            self._count(records=1)

    def _let_time_pass(self) -> None:
        if self._output is None:
            return
        now = self._clock()
        if self._chunk_opened is not None and now - self._chunk_opened >= self._limits.chunk_age_s:
            self._output.close_chunk()
            self._chunk_opened = None
        old = now - self._opened >= self._limits.max_file_age_s
        if old or self._output.written >= self._limits.max_file_bytes:
            self._rotation_due = True

    def _open_next(self) -> None:
        if self._output is not None:
            self._output.finish()
            with self._lock:
                self._octets_before += self._output.written
                self._output = None
        number = self._counters.files + 1
        self._remove_old()
        output = JournalOutput(self._folder / str(FileName(self._started, self.run, number)), self._limits.chunk_bytes)
        with self._lock:
            self._output = output
            self._rotation_due = False
            self._count(files=1)
        self._opened = self._clock()
        self._chunk_opened = None
        output.begin_run(self.run, number, self._attachments, self._utc())

    def _remove_old(self) -> None:
        """Make room for one more file: the oldest go first, those of this run last, and no other files."""
        files = [(parsed(path.name), path) for path in journal_files(self._folder)]
        oldest = sorted((name.run == self.run, name, path) for name, path in files if name is not None)
        sizes = {path: size_of(path) for _, _, path in oldest}
        room = self._limits.max_total_bytes - self._limits.max_file_bytes
        for _, _, path in oldest:
            if sum(sizes.values()) <= room:
                return
            path.unlink(missing_ok=True)
            del sizes[path]
            with self._lock:
                self._count(removed=1)

    def _finish(self) -> None:
        with self._lock:
            if self._dropping is not None:
                dropping, self._dropping = self._dropping, None
            else:
                dropping = None
            sequence = self._sequence - 1
        if dropping is not None:
            self._miss(dropping.reason, dropping.first, dropping.last, dropping.count)
        if self._output is not None:
            self._write_gap(sequence)
            self._output.finish()

    def _stop(self, error: Exception, left: int = 0) -> None:
        text = f"the journal in {self._folder} has stopped: {error}"
        if self._output is not None:
            self._output.abandon()
        with self._lock:
            self._stopped = text
            self._count(dropped=left + len(self._items))
            self._items.clear()
            self._waiting_bytes = 0
        log.error("%s", text)
        try:
            self._on_failure(text)
        except Exception:
            log.exception("the callback for a journal that has stopped failed")
