"""Reads journals: one file or all of a folder, in order, whole or cut off."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata

from app.journal.names import RUN_METADATA, SNAPSHOT, JournalError, journal_files
from app.journal.output import nanoseconds, seconds
from app.journal.times import utc_text
from app.journal.walk import Mark, Walk, inner_records

_MESSAGE = struct.Struct("<HIQQ")
"""Head of a message: channel, sequence, log time and publish time (ns)."""

_INDEX = struct.Struct("<HI")
"""Head of the index of a chunk: channel, octets of its entries."""

_ENTRY = struct.Struct("<QQ")
"""Entry of the index: log time (ns), place of the message in the uncompressed chunk."""

_SIZE = struct.Struct("<Q")
_INNER_HEAD = 9
"""Octets of opcode and length in front of a record in a chunk."""


@dataclass(frozen=True, slots=True)
class Record:
    """One record. time: UTC s of its arrival. order: s, its place in the file's time, which never runs back.

    sequence: counts the records of a run, modulo 2^32; a gap in it is a record that was dropped. data: as it was put.
    """

    topic: str
    sequence: int
    time: float
    data: bytes
    run: str
    order: float


@dataclass(slots=True)
class ChunkIndex:
    """What a chunk holds. messages: (channel, log time ns, octets of data) in order."""

    mark: Mark
    run: str
    messages: list[tuple[int, int, int]] = field(default_factory=list)


class JournalFile:
    """One file of a journal. Raises JournalError when it is none, or naming the place where it is damaged.

    A file that was cut off (the service was killed, the machine lost its power) is read up to its last complete chunk;
    `cut_off` then says how many octets behind that are left out, and is None for a whole file.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._walk = Walk(path)
        except OSError as error:
            raise JournalError(f"{path}: cannot be read ({error})") from error
        self.path = path
        self.size = self._walk.size
        self.cut_off = None if self._walk.finished else self._walk.left
        self._channels: dict[int, str] = {}
        self._runs: list[dict[str, str]] = []
        self._metadata: list[tuple[str, dict[str, str]]] = []
        self._attached: dict[str, dict[str, bytes]] = {}

    @cached_property
    def chunks(self) -> list[ChunkIndex]:
        """All complete chunks, with what they hold: from the index behind each, or from the chunk if there is none."""
        with self._open() as file:
            return self._scan(file)

    @property
    def runs(self) -> list[dict[str, str]]:
        """The metadata of each run in it (run, file, format), in order; more than one only in an exported file."""
        _ = self.chunks
        return self._runs

    @property
    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """All metadata records by name, in order."""
        _ = self.chunks
        return self._metadata

    def attachments(self, run: str | None = None) -> dict[str, bytes]:
        """The attachments of a run by name; of the first run when none is named."""
        _ = self.chunks
        if run is None:
            run = self._runs[0]["run"] if self._runs else ""
        return dict(self._attached.get(run, {}))

    def snapshots(self) -> list[tuple[float, int]]:
        """(time in the file, index of the chunk) of each snapshot."""
        return [
            (seconds(at), number)
            for number, chunk in enumerate(self.chunks)
            for channel, at, _ in chunk.messages
            if self.topic(channel) == SNAPSHOT
        ]

    def topic(self, channel: int) -> str:
        """The topic of a channel."""
        return self._channels[channel]

    def records(self, first_chunk: int = 0, end_chunk: int | None = None) -> Iterator[Record]:
        """All records from a chunk on, in order, before `end_chunk`. Raises JournalError at a damaged chunk."""
        with self._open() as file:
            for chunk in self.chunks[first_chunk:end_chunk]:
                yield from self._chunk_records(file, chunk)

    def check(self) -> None:
        """Read every octet and compare with the checksums in the file. Raises JournalError naming the place."""
        self._walk.check()
        for _ in self.records():
            pass

    def _open(self) -> BinaryIO:
        try:
            return self.path.open("rb")
        except OSError as error:
            raise JournalError(f"{self.path}: cannot be read ({error})") from error

    def _scan(self, file: BinaryIO) -> list[ChunkIndex]:
        found: list[ChunkIndex] = []
        indexes: list[tuple[Mark, bytes]] = []
        run = ""
        for mark in (*self._walk.marks, Mark(Opcode.FOOTER, self._walk.size, 0)):
            if mark.opcode == Opcode.MESSAGE_INDEX:
                indexes.append((mark, self._walk.content(file, mark)))
                continue
            if found and not found[-1].messages:
                whole = self._walk.finished or mark.opcode != Opcode.FOOTER
                self._index(file, found[-1], indexes if whole else [])
            indexes = []
            if mark.opcode == Opcode.CHUNK:
                found.append(ChunkIndex(mark, run))
            elif mark.opcode == Opcode.METADATA:
                run = self._take_metadata(file, mark, run)
            elif mark.opcode == Opcode.ATTACHMENT:
                self._take_attachment(file, mark, run)
        return found

    def _take_metadata(self, file: BinaryIO, mark: Mark, run: str) -> str:
        one = self._walk.parsed(mark, self._walk.content(file, mark), Metadata.read)
        self._metadata.append((one.name, one.metadata))
        if one.name != RUN_METADATA:
            return run
        if not {"run", "file", "format"} <= set(one.metadata):
            raise self._walk.damaged(mark.at, "the description of a run is not whole")
        self._runs.append(one.metadata)
        return str(one.metadata["run"])

    def _take_attachment(self, file: BinaryIO, mark: Mark, run: str) -> None:
        data = self._walk.content(file, mark)
        one = self._walk.parsed(mark, data, Attachment.read)
        (crc,) = struct.unpack("<I", data[-4:])
        if crc and zlib.crc32(data[:-4]) != crc:
            raise self._walk.damaged(mark.at, f"the attachment {one.name!r}: its checksum (CRC) is wrong")
        self._attached.setdefault(run, {})[one.name] = one.data

    def _index(self, file: BinaryIO, chunk: ChunkIndex, indexes: list[tuple[Mark, bytes]]) -> None:
        entries = sorted(entry for mark, data in indexes for entry in self._entries(mark, data))
        if not entries or any(channel not in self._channels for _, channel, _ in entries):
            chunk.messages = [(m[0], m[2], m[5] - m[4]) for m in self._messages(file, chunk)]
            return
        file.seek(chunk.mark.at + _INNER_HEAD + 16)
        (size,) = _SIZE.unpack(file.read(8))
        ends = [offset for offset, _, _ in entries[1:]] + [size]
        head = _INNER_HEAD + _MESSAGE.size
        if any(end - offset < head for end, (offset, _, _) in zip(ends, entries, strict=True)):
            raise self._walk.damaged(chunk.mark.end, "an index that does not belong to its chunk")
        chunk.messages = [
            (channel, at, end - offset - head) for end, (offset, channel, at) in zip(ends, entries, strict=True)
        ]

    def _entries(self, mark: Mark, data: bytes) -> Iterator[tuple[int, int, int]]:
        if len(data) < _INDEX.size or (len(data) - _INDEX.size) % _ENTRY.size:
            raise self._walk.damaged(mark.at, "an index that is not whole")
        channel, _ = _INDEX.unpack_from(data)
        for at, offset in _ENTRY.iter_unpack(data[_INDEX.size :]):
            yield offset, channel, at

    def _messages(self, file: BinaryIO, chunk: ChunkIndex) -> Iterator[tuple[int, int, int, int, int, int, bytes]]:
        """(channel, sequence, log time, publish time, begin, end, octets of the chunk) of each message."""
        octets = self._walk.chunk(chunk.mark, self._walk.content(file, chunk.mark))
        try:
            for opcode, begin, end in inner_records(octets):
                if opcode == Opcode.CHANNEL:
                    one = self._walk.parsed(chunk.mark, octets[begin:end], Channel.read)
                    self._channels[one.id] = one.topic
                elif opcode == Opcode.MESSAGE:
                    channel, sequence, at, arrived = _MESSAGE.unpack_from(octets[begin : begin + _MESSAGE.size])
                    if channel not in self._channels:
                        raise ValueError(f"a message of a channel {channel} that was not declared")
                    yield channel, sequence, at, arrived, begin + _MESSAGE.size, end, octets
        except (ValueError, struct.error) as error:
            if isinstance(error, JournalError):
                raise
            raise self._walk.damaged(chunk.mark.at, f"a chunk that is not well formed ({error})") from None

    def _chunk_records(self, file: BinaryIO, chunk: ChunkIndex) -> Iterator[Record]:
        for channel, sequence, at, arrived, begin, end, octets in self._messages(file, chunk):
            yield Record(self._channels[channel], sequence, seconds(arrived), octets[begin:end], chunk.run, seconds(at))


class Journal:
    """The files of a journal in order. One file, or all of a folder; restarts between them show as other runs."""

    def __init__(self, files: list[JournalFile]) -> None:
        self.files = files

    def records(self, since: float | None = None) -> Iterator[Record]:
        """All records in order; with `since` (UTC s) from the last snapshot at or before it.

        Raises JournalError when there is no such snapshot, and at damage.
        """
        number, first_chunk, at = self._place(since) if since is not None else (0, 0, None)
        for file in self.files[number:]:
            waiting = at
            for record in file.records(first_chunk):
                if waiting is not None and not (record.topic == SNAPSHOT and nanoseconds(record.order) == waiting):
                    continue
                waiting = None
                yield record
            first_chunk, at = 0, None

    def first_time(self) -> float | None:
        """UTC s of the first record; None when there is none."""
        for file in self.files:
            for chunk in file.chunks:
                for _, at, _ in chunk.messages:
                    return seconds(at)
        return None

    def first_snapshot(self, run: str | None = None) -> float:
        """UTC s of the first snapshot (of a run), before which nothing can be replayed.

        Raises JournalError when there is none.
        """
        for file in self.files:
            for at, chunk in file.snapshots():
                if run is None or file.chunks[chunk].run == run:
                    return at
        raise JournalError(f"{self.name}: no snapshot in it, so that nothing can be replayed")

    def topics(self) -> frozenset[str]:
        """The topics of which there are records."""
        used = {(file, channel) for file in self.files for chunk in file.chunks for channel, _, _ in chunk.messages}
        return frozenset(file.topic(channel) for file, channel in used)

    def last_time(self) -> float | None:
        """UTC s of the last record; None when there is none."""
        for file in reversed(self.files):
            for chunk in reversed(file.chunks):
                if chunk.messages:
                    return max(seconds(at) for _, at, _ in chunk.messages)
        return None

    def _place(self, since: float) -> tuple[int, int, int | None]:
        wanted = nanoseconds(since)
        for number in reversed(range(len(self.files))):
            for at, chunk in reversed(self.files[number].snapshots()):
                if nanoseconds(at) <= wanted:
                    return number, chunk, nanoseconds(at)
        raise JournalError(f"{self.name}: no snapshot at or before {utc_text(since)}")

    @property
    def name(self) -> str:
        """The file or the folder."""
        paths = [file.path for file in self.files]
        return str(paths[0] if len(paths) == 1 else paths[0].parent)


def open_journal(path: Path) -> Journal:
    """The journal in a file, or in all journal files of a folder. Raises JournalError."""
    if not path.is_dir():
        return Journal([JournalFile(path)])
    try:
        paths = journal_files(path)
    except OSError as error:
        raise JournalError(f"{path}: cannot be read ({error})") from error
    if not paths:
        raise JournalError(f"{path}: no journal files (airside-*.mcap) in this folder")
    return Journal([JournalFile(one) for one in paths])
