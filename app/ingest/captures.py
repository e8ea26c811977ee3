"""Captures of CAT240 as recordings, through the same decoder and assembler as live video.

The formats are those of `app.ingest.containers.datagrams`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.ingest.containers.datagrams import Met, datagrams
from app.ingest.containers.packets import CaptureError, Datagram
from app.ingest.containers.times import UNDATED, timed
from app.ingest.recording import MAX_AZIMUTHS, Recording, RecordingError, video_format
from pipeline.assemble import Assembler
from pipeline.asterix.cat240_batch import CELLS, DURATION, END, FIRST_CELL, START, TIME, decode_batch
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

LIGHT_M_PER_S = 299_792_458.0
BATCH = 256


def open_capture(path: Path, site: RadarSite | None, blocks: int, port: int | None) -> Recording:
    """The recording in a capture; see `app.ingest.recordings.open_recording`. Raises RecordingError."""
    counters: Counter[str] = Counter()
    chosen = site if site is not None else _radar_of(path, port)

    def read() -> Iterator[Sweeps]:
        counters.clear()
        assembler = Assembler(chosen, 0, min(blocks, chosen.video.azimuths))
        for batch in _batches(path, port, counters):
            made = assembler.push_datagrams(*_rows(batch))
            counters.update(_grown(assembler.counters, counters))
            yield from made
        made = assembler.flush()
        counters.update(_grown(assembler.counters, counters))
        yield from made
        if not counters["sweeps"]:
            raise RecordingError(f"{path}: no radar video that fits {chosen.id} in it ({_told(counters)})")

    return Recording(path, chosen, None, read, counters, _notes(path))


def _notes(path: Path) -> tuple[str, ...]:
    first = next(_found(path, Counter()), None)
    if first is None or not math.isnan(first.time):
        return ()
    return (f"no times in the file: those of the messages are taken, as of {UNDATED}",)


def _nothing(counters: Counter[str], reasons: Mapping[str, int], met: Met, port: int | None) -> str:
    """Why there is no video: what was left out, and what the file holds instead."""
    left_out = Counter(reasons) + Counter({name: n for name, n in counters.items() if name != "packets"})
    here = "" if port is None else f" of port {port}"
    words = f"no datagrams{here}" if not reasons else "no datagram is video"
    return "; ".join(one for one in (words, _told(left_out) if left_out else "", str(met)) if one)


def _grown(now: Mapping[str, int], before: Counter[str]) -> dict[str, int]:
    return {name: count - before[name] for name, count in now.items()}


def _told(counters: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counters.items()) if count) or "empty"


def _batches(path: Path, port: int | None, counters: Counter[str], met: Met | None = None) -> Iterator[list[Datagram]]:
    batch: list[Datagram] = []
    for one in timed(_found(path, counters, met)):
        if port is not None and one.port is not None and one.port != port:
            counters["other_port"] += 1
            continue
        batch.append(one)
        if len(batch) == BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


def _found(path: Path, counters: Counter[str], met: Met | None = None) -> Iterator[Datagram]:
    try:
        yield from datagrams(path, counters, met)
    except CaptureError as error:
        raise RecordingError(str(error)) from error
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _rows(batch: list[Datagram]) -> tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.float64]]:
    lengths = np.array([len(one.payload) for one in batch], np.int32)
    rows = np.zeros((len(batch), max(2048, int(lengths.max()))), np.uint8)
    for row, one in zip(rows, batch, strict=True):
        row[: len(one.payload)] = np.frombuffer(one.payload, np.uint8)
    return rows, lengths, np.array([one.time for one in batch])


def _radar_of(path: Path, port: int | None) -> RadarSite:
    """What the first messages of a capture say about the radar."""
    parts: list[NDArray[np.int64]] = []
    reasons: dict[str, int] = {}
    counters, met = Counter[str](), Met()
    for batch in _batches(path, port, counters, met):
        rows, lengths, _ = _rows(batch)
        parts += [one.fields for one, _ in decode_batch(rows, lengths, reasons)]
        if sum(map(len, parts)) >= 20_000:
            break
    fields = np.concatenate(parts) if parts else np.zeros((0, 10), np.int64)
    if not len(fields):
        raise RecordingError(f"{path}: no CAT240 video in it ({_nothing(counters, reasons, met, port)})")
    width = float(np.median((fields[:, END] - fields[:, START]) & 0xFFFF))
    steps = np.diff(fields[:, START]) & 0xFFFF
    steps = steps[(steps > 0) & (steps < 0x4000)]
    if width == 0:
        width = float(np.median(steps)) if len(steps) else 16.0
    timed = fields[fields[:, TIME] >= 0]
    turns = float((np.diff(timed[:, START]) & 0xFFFF).sum()) / 65536 if len(timed) > 1 else 0.0
    elapsed = ((int(timed[-1, TIME]) - int(timed[0, TIME])) % (86400 * 128)) / 128 if len(timed) > 1 else 0.0
    period = elapsed / turns if turns > 0.5 and elapsed > 0 else 1.0
    step = float(np.median(fields[:, DURATION])) * 1e-15 * LIGHT_M_PER_S / 2
    first = int(fields[:, FIRST_CELL].min())
    ranges = int((fields[:, FIRST_CELL] + fields[:, CELLS]).max()) - first
    azimuths = min(max(round(65536 / width), 1), MAX_AZIMUTHS)
    video = video_format(path, (azimuths, ranges), period, {"first_range_m": first * step, "range_step_m": step})
    return RadarSite(path.stem[:32], 0, 0, 0, video)
