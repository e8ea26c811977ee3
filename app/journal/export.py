"""Cuts a part out of a journal into one file that can be replayed by itself."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from app.journal.names import EXPORT_METADATA, SNAPSHOT, JournalError
from app.journal.output import JournalOutput
from app.journal.reader import Journal, JournalFile, Record
from app.journal.times import utc_text


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written. start: UTC s of the snapshot it begins with. end: of the last record. runs: in it, in order."""

    path: Path
    records: int
    start: float
    end: float
    runs: tuple[str, ...]


def export(journal: Journal, since: float, until: float, target: Path) -> Exported:
    """Write the records from the last snapshot at or before `since` up to `until` (UTC s, inclusive) into a new file.

    Sequence numbers, times, attachments and metadata are kept; where a restart lies in between, the attachments of the
    later run stand before its records. Raises JournalError when there is no such snapshot, when nothing lies in the
    interval, at damage, and when the file is there already or cannot be written; no half file is left then.
    """
    if until < since:
        raise JournalError(f"until ({utc_text(until)}) lies before from ({utc_text(since)})")
    beside = target.with_name(f".{target.name}.new")
    try:
        if target.exists():
            raise JournalError(f"{target}: is there already")
        beside.unlink(missing_ok=True)
        output = JournalOutput(beside)
    except OSError as error:
        raise JournalError(f"{target}: cannot be written ({error})") from error
    try:
        done = _copy(journal, since, until, output, target)
        output.finish()
        os.replace(beside, target)
    except OSError as error:
        raise JournalError(f"{target}: cannot be written ({error})") from error
    finally:
        output.abandon()
        beside.unlink(missing_ok=True)
    return done


def _copy(journal: Journal, since: float, until: float, output: JournalOutput, target: Path) -> Exported:
    runs: list[str] = []
    records, first, last = 0, None, None
    for record in journal.records(since):
        if record.order > until:
            break
        if not runs or runs[-1] != record.run:
            if runs and record.topic != SNAPSHOT:
                raise JournalError(f"{journal.name}: run {record.run} does not begin with a snapshot")
            _begin(journal, record, output)
            runs.append(record.run)
        output.add(record.topic, record.sequence, record.time, record.data)
        records, last = records + 1, record.order
        first = record.order if first is None else first
    if first is None or last is None:
        raise JournalError(f"{journal.name}: nothing between {utc_text(since)} and {utc_text(until)}")
    output.metadata(
        EXPORT_METADATA,
        {
            "from": repr(since),
            "until": repr(until),
            "source": ", ".join(file.path.name for file in journal.files)[:1000],
        },
    )
    return Exported(target, records, first, last, tuple(runs))


def _begin(journal: Journal, record: Record, output: JournalOutput) -> None:
    file, number = _source(journal, record.run)
    output.begin_run(record.run, number, file.attachments(record.run), record.order)


def _source(journal: Journal, run: str) -> tuple[JournalFile, int]:
    """The first file of a run, and its number."""
    for file in journal.files:
        for one in file.runs:
            if one["run"] == run and one["file"].isdigit():
                return file, int(one["file"])
    raise JournalError(f"{journal.name}: records of an unknown run {run!r}")
