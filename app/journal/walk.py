"""Reads the records of an MCAP file and checks each: what is whole, what is cut off and what is damaged."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from app.journal.names import JournalError

T = TypeVar("T")
MAGIC = MCAP0_MAGIC
MOST_CHUNK_BYTES = 2**30
"""Octets, the most that a chunk may unpack to: those of Airside hold some MB, and more could fill the memory."""

PRIVATE_OPCODES = range(0x80, 0x100)
"""Records that others may add; they are passed over."""

IN_DATA = frozenset(
    (
        Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX,
        Opcode.ATTACHMENT, Opcode.METADATA, Opcode.DATA_END,
    )
)  # fmt: skip
"""Records that may stand in the data section of a file."""

_RECORD = struct.Struct("<BQ")
"""Head of a record: opcode, length of its content in octets."""

_CHUNK = struct.Struct("<QQQII")
"""Head of a chunk: first and last log time (ns), uncompressed octets, CRC-32, length of the compression's name."""

_LONG = struct.Struct("<Q")


@dataclass(frozen=True, slots=True)
class Mark:
    """Where a record lies: its opcode, the place of its first octet in the file, and the octets of its content."""

    opcode: int
    at: int
    length: int

    @property
    def end(self) -> int:
        """Place of the first octet behind it."""
        return self.at + _RECORD.size + self.length


class Walk:
    """The records of a file in order. `finished`: the file was closed as it should be. `left`: octets after `marks`.

    Raises JournalError when the file is no MCAP file, and naming the place when it is damaged; a file that was not
    finished is walked up to its last complete record.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb") as file:
            self.size = file.seek(0, io.SEEK_END)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise JournalError(f"{path}: no journal: it does not begin like an MCAP file")
            file.seek(max(len(MAGIC), self.size - len(MAGIC)))
            self.finished = file.read() == MAGIC
            self.marks = list(self._marks(file))
        self.left = 0 if self.finished else self.size - (self.marks[-1].end if self.marks else len(MAGIC))

    def _marks(self, file: BinaryIO) -> Iterator[Mark]:
        at = len(MAGIC)
        while True:
            file.seek(at)
            head = file.read(_RECORD.size)
            if len(head) < _RECORD.size:
                if self.finished:
                    raise self.damaged(at, "the data ends without its end mark")
                return
            mark = Mark(head[0], at, _LONG.unpack_from(head, 1)[0])
            known = mark.opcode in IN_DATA or mark.opcode in PRIVATE_OPCODES
            if not known or mark.end > self.size:
                if self.finished:
                    what = f"a record of {mark.length} octets" if known else f"a record of unknown kind {mark.opcode}"
                    raise self.damaged(at, what)
                return
            yield mark
            if mark.opcode == Opcode.DATA_END:
                return
            at = mark.end

    def damaged(self, at: int, what: str) -> JournalError:
        """The error for damage at a place of this file."""
        return JournalError(f"{self.path}: damaged at octet {at}: {what}")

    def content(self, file: BinaryIO, mark: Mark) -> bytes:
        """The octets of a record."""
        file.seek(mark.at + _RECORD.size)
        data = file.read(mark.length)
        if len(data) != mark.length:
            raise self.damaged(mark.at, "the file has become shorter")
        return data

    def parsed(self, mark: Mark, data: bytes, read: Callable[[ReadDataStream], T]) -> T:
        """A record as the MCAP library reads it."""
        try:
            return read(ReadDataStream(io.BytesIO(data)))
        except (struct.error, UnicodeDecodeError, McapError, MemoryError, OverflowError) as error:
            raise self.damaged(mark.at, f"a record that cannot be read ({error or type(error).__name__})") from None

    def chunk(self, mark: Mark, data: bytes) -> bytes:
        """The uncompressed octets of a chunk, checked against its checksum."""
        try:
            _, _, size, crc, length = _CHUNK.unpack_from(data)
            name_end = _CHUNK.size + length
            compression = data[_CHUNK.size : name_end].decode()
            (packed_size,) = _LONG.unpack_from(data, name_end)
            packed = data[name_end + 8 :]
            if packed_size != len(packed) or size > MOST_CHUNK_BYTES:
                raise ValueError(f"{packed_size} octets that make {size}, {len(packed)} there")
            records = _unpacked(compression, packed, size)
        except (struct.error, ValueError, RuntimeError, MemoryError, zstandard.ZstdError) as error:
            raise self.damaged(mark.at, f"a chunk that cannot be unpacked ({error})") from None
        if crc and zlib.crc32(records) != crc:
            raise self.damaged(mark.at, "a chunk whose checksum (CRC) is wrong")
        return records

    def check(self) -> None:
        """Read every octet of the data and compare with the checksum at its end. Raises JournalError.

        Only a finished file has one; in others each chunk has its own.
        """
        end = self.marks[-1] if self.marks else None
        if not self.finished or end is None or end.opcode != Opcode.DATA_END:
            return
        crc = 0
        with self.path.open("rb") as file:
            (wanted,) = struct.unpack("<I", self.content(file, end)[:4].ljust(4, b"\0"))
            file.seek(0)
            at = 0
            while at < end.at:
                block = file.read(min(1 << 20, end.at - at))
                if not block:
                    raise self.damaged(at, "the file has become shorter")
                crc = zlib.crc32(block, crc)
                at += len(block)
        if wanted and crc != wanted:
            raise JournalError(f"{self.path}: damaged before octet {end.at}: the checksum (CRC) of the data is wrong")


def _unpacked(compression: str, packed: bytes, size: int) -> bytes:
    if compression == "zstd":
        if zstandard.frame_content_size(packed) != size:
            raise ValueError("its head and its content differ in size")
        records = zstandard.ZstdDecompressor().decompress(packed)
    elif compression == "lz4":
        records = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    elif compression == "":
        records = packed
    else:
        raise ValueError(f"compressed by {compression!r}")
    if len(records) != size:
        raise ValueError(f"{len(records)} octets instead of {size}")
    return records


def inner_records(records: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, begin and end of the content) of each record of an uncompressed chunk. Raises ValueError."""
    at = 0
    while at < len(records):
        if at + _RECORD.size > len(records):
            raise ValueError("a record cut off")
        opcode, length = _RECORD.unpack_from(records, at)
        begin = at + _RECORD.size
        at = begin + length
        if at > len(records):
            raise ValueError("a record longer than its chunk")
        yield opcode, begin, at
