"""What is in a journal: files, runs, time, topics, snapshots, gaps."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from app.journal.names import GAP, VERSIONS_FILE, JournalError
from app.journal.output import seconds
from app.journal.reader import Journal, JournalFile
from pipeline.values import ValueCodec


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One file. start, end: UTC s, None when it holds no record. left: octets cut off behind the last whole record.

    finished: it was closed as it should be; otherwise it was cut off, or is still being written.
    """

    path: str
    runs: tuple[str, ...]
    numbers: tuple[int, ...]
    octets: int
    records: int
    start: float | None
    end: float | None
    finished: bool
    left: int


@dataclass(frozen=True, slots=True)
class JournalInfo:
    """A whole journal. topics: records and octets (uncompressed) by topic. snapshots: UTC s. duration_s: end - start.

    runs: in order, with what was attached to each as versions. gaps: what the writer said about missing records.
    """

    files: tuple[FileInfo, ...]
    runs: tuple[dict[str, Any], ...]
    start: float | None
    end: float | None
    duration_s: float
    records: int
    octets: int
    topics: dict[str, dict[str, int]] = field(default_factory=dict)
    snapshots: tuple[float, ...] = ()
    gaps: tuple[dict[str, Any], ...] = ()


def journal_info(journal: Journal) -> JournalInfo:
    """Look at every file; chunks are unpacked only where the index does not tell. Raises JournalError."""
    files = tuple(_file(one) for one in journal.files)
    counts: Counter[str] = Counter()
    octets: Counter[str] = Counter()
    for file in journal.files:
        for chunk in file.chunks:
            for channel, _, size in chunk.messages:
                counts[file.topic(channel)] += 1
                octets[file.topic(channel)] += size
    starts = [one.start for one in files if one.start is not None]
    ends = [one.end for one in files if one.end is not None]
    return JournalInfo(
        files=files,
        runs=_runs(journal),
        start=starts[0] if starts else None,
        end=ends[-1] if ends else None,
        duration_s=ends[-1] - starts[0] if starts else 0.0,
        records=counts.total(),
        octets=sum(one.octets for one in files),
        topics={name: {"records": counts[name], "octets": octets[name]} for name in sorted(counts)},
        snapshots=tuple(at for file in journal.files for at, _ in file.snapshots()),
        gaps=tuple(_gaps(journal)) if counts[GAP] else (),
    )


def _file(file: JournalFile) -> FileInfo:
    times = [at for chunk in file.chunks for _, at, _ in chunk.messages]
    return FileInfo(
        path=str(file.path),
        runs=tuple(one["run"] for one in file.runs),
        numbers=tuple(_number(file, one["file"]) for one in file.runs),
        octets=file.size,
        records=len(times),
        start=seconds(times[0]) if times else None,
        end=seconds(times[-1]) if times else None,
        finished=file.cut_off is None,
        left=file.cut_off or 0,
    )


def _number(file: JournalFile, text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise JournalError(f"{file.path}: the number of the file is {text!r}")
    return int(text)


def _runs(journal: Journal) -> tuple[dict[str, Any], ...]:
    found: dict[str, dict[str, Any]] = {}
    for file in journal.files:
        for one in file.runs:
            run = found.setdefault(one["run"], {"run": one["run"], "format": one["format"], "files": 0, "records": 0})
            run["files"] += 1
            run.setdefault("versions", _versions(file, one["run"]))
        for chunk in file.chunks:
            if chunk.messages and chunk.run in found:
                run = found[chunk.run]
                run["records"] += len(chunk.messages)
                run.setdefault("start", seconds(chunk.messages[0][1]))
                run["end"] = seconds(chunk.messages[-1][1])
    return tuple(found.values())


def _versions(file: JournalFile, run: str) -> Any:
    attached = file.attachments(run).get(VERSIONS_FILE)
    try:
        return json.loads(attached) if attached is not None else None
    except ValueError:
        return None


def _gaps(journal: Journal) -> list[dict[str, Any]]:
    found = []
    for file in journal.files:
        for number, chunk in enumerate(file.chunks):
            if not any(file.topic(channel) == GAP for channel, _, _ in chunk.messages):
                continue
            for record in file.records(number, number + 1):
                if record.topic != GAP:
                    continue
                try:
                    told = ValueCodec().decode(record.data)
                except ValueError as error:
                    raise JournalError(f"{file.path}: a gap that cannot be read ({error})") from error
                found.append({"time": record.time, **told} if isinstance(told, dict) else {"time": record.time})
    return found
