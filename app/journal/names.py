"""What a journal file is called, and the names inside it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

FORMAT_VERSION = "1"
"""Of the journal: its topics, metadata and byte forms."""

PROFILE = "airside"
"""MCAP profile in the header of each file."""

RUN_METADATA = "airside.run"
"""MCAP metadata in front of the records of a run: run, file, format."""

EXPORT_METADATA = "airside.export"
"""MCAP metadata at the end of an exported file: from, until, source."""

SNAPSHOT = "snapshot"
"""Topic of the whole state of the engine; every file begins with one."""

GAP = "gap"
"""Topic of records that say how many others could not be written, and why."""

DISPLAY = "display"
"""Optional topic: the messages of the live feed (JSON text) as they were sent to the displays."""

SETTINGS_FILE, AIRPORT_FILE, VERSIONS_FILE, CLOCK_FILE = (
    "settings.json",
    "airport.geojson",
    "versions.json",
    "clock.json",
)
"""The names of the attachments: all that is needed, besides the records, to run the engine again."""

_NAME = re.compile(r"airside-(\d{8}T\d{6}Z)-([0-9a-f]{8})-(\d{4,})\.mcap")


class JournalError(ValueError):
    """A journal cannot be read or cut; the message names the file and, where there is one, the place."""


@dataclass(frozen=True, order=True, slots=True)
class FileName:
    """The parts of a file's name, ordered by start of the run, run, and number in the run."""

    started: str
    run: str
    number: int

    def __str__(self) -> str:
        return f"airside-{self.started}-{self.run}-{self.number:04d}.mcap"


def start_text(utc_s: float) -> str:
    """The start of a run as file names tell it."""
    return datetime.fromtimestamp(utc_s, UTC).strftime("%Y%m%dT%H%M%SZ")


def parsed(name: str) -> FileName | None:
    """The parts of a journal file's name; None for other files."""
    found = _NAME.fullmatch(name)
    return FileName(found[1], found[2], int(found[3])) if found else None


def journal_files(folder: Path) -> list[Path]:
    """The journal files of a folder, oldest run first, in the order of their numbers. Raises OSError."""
    named = [(parsed(path.name), path) for path in folder.iterdir()]
    return [path for name, path in sorted((name, path) for name, path in named if name is not None)]


def size_of(path: Path) -> int:
    """Octets of a file; 0 when it has been removed meanwhile."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
