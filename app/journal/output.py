"""One journal file while it is written: an MCAP file that is readable up to its last complete chunk at any moment."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from app.journal.names import FORMAT_VERSION, PROFILE, RUN_METADATA
from app.journal.schemas import MESSAGE_ENCODING, SCHEMA_ENCODING, ChannelSchema, schema_of
from app.private_files import FILE_MODE

CHUNK_BYTES = 4 * 1024 * 1024
"""Uncompressed octets after which a chunk is closed: two seconds of a busy airport, long enough to compress well."""

NS = 1_000_000_000
"""Nanoseconds in a second."""

MOST_NS = 2**63 - 1
"""ns, the greatest time that is written, so that readers may hold it in a signed integer (the year 2262)."""

SEQUENCES = 2**32
"""Sequence numbers of MCAP are of 32 bits and begin again at 0."""

MEDIA_TYPES = {".json": "application/json", ".geojson": "application/geo+json"}
"""Of attachments, by the suffix of their names."""


def nanoseconds(time: float) -> int:
    """UTC s as whole ns, so exact that `seconds` gives the same number back. What is no time is 0."""
    if not math.isfinite(time) or time < 0:
        return 0
    whole = math.floor(time)
    return min(whole * NS + round((time - whole) * NS), MOST_NS)


def seconds(ns: int) -> float:
    """The inverse of `nanoseconds`."""
    return ns // NS + (ns % NS) / NS


class _Stream:
    """A file without a buffer of its own, so that nothing of a failed write is tried again at the end."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE)
        self.written = 0

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:
            count = os.write(self._file, view)
            self.written += count
            view = view[count:]
        return len(data)

    def tell(self) -> int:
        return self.written

    def flush(self) -> None:
        """Nothing waits here."""

    def sync(self) -> None:
        """Wait until the disk has it; an error of the disk is told only here. Raises OSError when the file is gone."""
        os.fdatasync(self._file)
        if os.fstat(self._file).st_nlink == 0:
            raise FileNotFoundError("the file or its folder has been removed while it was written")

    def close(self) -> None:
        if self._file >= 0:
            file, self._file = self._file, -1
            os.close(file)


class JournalOutput:
    """Writes records into a new file. Every method raises OSError when the disk does."""

    def __init__(self, path: Path, chunk_bytes: int = CHUNK_BYTES) -> None:
        self.path = path
        self._stream = _Stream(path)
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._newest_ns = 0
        self._writer = Writer(
            self._stream,  # type: ignore[arg-type]  # it asks for IO, and uses write, tell and flush
            chunk_size=chunk_bytes,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        self._writer.start(profile=PROFILE)

    @property
    def written(self) -> int:
        """Octets in the file so far."""
        return self._stream.written

    def begin_run(self, run: str, number: int, attachments: Mapping[str, bytes], time: float) -> None:
        """What follows belongs to this run; number: of its file. time: UTC s. Closes the chunk."""
        self._writer.flush()
        self.metadata(RUN_METADATA, {"run": run, "file": str(number), "format": FORMAT_VERSION})
        at = nanoseconds(time)
        for name, data in attachments.items():
            media = MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            self._writer.add_attachment(at, at, name, media, data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._writer.add_metadata(name, dict(values))

    def add(self, topic: str, sequence: int, time: float, data: bytes) -> None:
        """Append a record. time: UTC s of arrival; the order of the file never runs back, though clocks do."""
        arrived = nanoseconds(time)
        self._newest_ns = max(self._newest_ns, arrived)
        self._writer.add_message(
            self._channel(topic, schema_of(data)), self._newest_ns, data, arrived, sequence % SEQUENCES
        )

    def close_chunk(self) -> None:
        """What was added so far survives from now on the end of this process, and of the machine."""
        self._writer.flush()
        self._stream.sync()

    def finish(self) -> None:
        """Write the index and close."""
        self._writer.finish()
        self._stream.sync()
        self._stream.close()

    def abandon(self) -> None:
        """Close without writing anything more. Raises nothing."""
        with contextlib.suppress(OSError):
            self._stream.close()

    def _channel(self, topic: str, schema: ChannelSchema) -> int:
        known = self._channels.get((topic, schema.name))
        if known is None:
            if schema.name not in self._schemas:
                self._schemas[schema.name] = self._writer.register_schema(schema.name, SCHEMA_ENCODING, schema.data)
            known = self._writer.register_channel(topic, MESSAGE_ENCODING, self._schemas[schema.name])
            self._channels[(topic, schema.name)] = known
        return known
