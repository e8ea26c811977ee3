"""Captures of CAT240 as recordings, through the same decoder and assembler as live video.

The formats are those of `app.ingest.containers.datagrams`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.ingest.containers.datagrams import Met, datagrams
from app.ingest.containers.packets import CaptureError, Datagram
from app.ingest.containers.times import UNDATED, timed
from app.ingest.recording import MAX_AZIMUTHS, Recording, RecordingError, video_format
from pipeline.assemble import Assembler
from pipeline.assemble.refusal import FS_PER_M, source_name
from pipeline.assemble.survey import SourceSurvey, survey
from pipeline.asterix.cat240_batch import decode_batch
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

BATCH = 256

SURVEYED = 100_000
"""Messages from which the radar is told: most of half a minute of a large one."""

USUAL_AZIMUTHS = 4096
"""A turn of a radar that shows one azimuth only."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What is taken of a capture; see `app.ingest.recordings.open_recording`."""

    sac: int | None = None
    sic: int | None = None
    resample: bool = False

    def fits(self, source: int) -> bool:
        """SAC << 8 | SIC is the source that is asked for, or none is."""
        return self.sac in (None, source >> 8) and self.sic in (None, source & 255)


def open_capture(
    path: Path, site: RadarSite | None, blocks: int, port: int | None, choice: Choice = Choice()
) -> Recording:
    """The recording in a capture; see `app.ingest.recordings.open_recording`. Raises RecordingError."""
    counters: Counter[str] = Counter()
    found = _source_of(path, port, choice)
    chosen = site if site is not None else _radar_of(path, found)

    def read() -> Iterator[Sweeps]:
        counters.clear()
        assembler = Assembler(
            chosen, 0, min(blocks, chosen.video.azimuths), sac=found.source >> 8, sic=found.source & 255,
            resample=choice.resample,
        )  # fmt: skip
        for batch in _batches(path, port, counters):
            made = assembler.push_datagrams(*_rows(batch))
            counters.update(_grown(assembler.counters, counters))
            yield from made
        made = assembler.flush()
        counters.update(_grown(assembler.counters, counters))
        yield from made
        if not counters["sweeps"]:
            why = assembler.refusals.words()
            raise RecordingError(
                f"{path}: no radar video that fits {chosen.id} in it ({_told(counters)})" + f"; {why}" * bool(why)
            )

    source = (found.source >> 8, found.source & 255)
    return Recording(path, chosen, None, read, counters, _notes(path) + _cells_told(found, choice), source)


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


def _source_of(path: Path, port: int | None, choice: Choice) -> SourceSurvey:
    """What the first messages of a capture say about its radar. Raises RecordingError when there is not one."""
    parts: list[NDArray[np.int64]] = []
    times: list[NDArray[np.float64]] = []
    reasons: dict[str, int] = {}
    counters, met = Counter[str](), Met()
    for batch in _batches(path, port, counters, met):
        rows, lengths, arrival = _rows(batch)
        for one, origin in decode_batch(rows, lengths, reasons):
            parts.append(one.fields)
            times.append(arrival[origin])
        if sum(map(len, parts)) >= SURVEYED:
            break
    fields = np.concatenate(parts) if parts else np.zeros((0, 10), np.int64)
    if not len(fields):
        raise RecordingError(f"{path}: no CAT240 video in it ({_nothing(counters, reasons, met, port)})")
    found = survey(fields, np.concatenate(times))
    wanted = [one for one in found if choice.fits(one.source)]
    if len(wanted) != 1:
        listed = ", ".join(f"{source_name(one.source)} ({one.messages} messages)" for one in found)
        first = (wanted or found)[0].source
        raise RecordingError(
            f"{path}: video of {len(found)} source{'s' * (len(found) > 1)} in it: {listed}; "
            f"choose with --sac and --sic, such as --sac {first >> 8} --sic {first & 255}"
        )
    return wanted[0]


def _radar_of(path: Path, found: SourceSurvey) -> RadarSite:
    """The radar of a source, as its messages show it."""
    step = found.durations[0][0] / FS_PER_M
    azimuths = min(found.azimuths or USUAL_AZIMUTHS, MAX_AZIMUTHS)
    period = found.period_s if math.isfinite(found.period_s) else 1.0
    words = {"first_range_m": found.first_cell * step, "range_step_m": step}
    return RadarSite(path.stem[:32], 0, 0, 0, video_format(path, (azimuths, found.ranges), period, words))


def _cells_told(found: SourceSurvey, choice: Choice) -> tuple[str, ...]:
    """What becomes of cells of other lengths."""
    if len(found.durations) < 2:
        return ()
    usual, *others = [f"{duration / FS_PER_M:.4g} m in {many} messages" for duration, many in found.durations]
    done = "brought to those of the first length" if choice.resample else "left out; --resample would convert them"
    return (f"cells of {usual}; {', '.join(others)} are {done}",)
