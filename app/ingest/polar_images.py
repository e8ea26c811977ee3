"""A folder of polar PNGs as a recording.

The images in the order of their names, one turn each, rows from north clockwise, and one YAML file beside them:
`start` (UTC seconds or ISO 8601 with zone) and `period_s`, or `times` (one UTC a turn); optionally `id`,
`range_step_m`, `first_range_m`, `beamwidth_deg`, `db_per_step`, `bits` and `skip_columns` (columns before the first
cell).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from app.contract import Refused
from app.ingest.recording import (
    MAX_AZIMUTHS,
    MAX_RANGES,
    Recording,
    RecordingError,
    number_of,
    stretch_table,
    stretched_turn,
    turns_of,
    video_format,
)
from app.ingest.wire_json import recorded_time
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

_IMAGE_WORDS = {
    "start", "period_s", "times", "id", "range_step_m", "first_range_m", "beamwidth_deg", "db_per_step",
    "bits", "skip_columns",
}  # fmt: skip


def open_images(path: Path, blocks: int) -> Recording:
    """The recording in a folder; see `app.ingest.recordings.open_recording`. Raises RecordingError, OSError."""
    files = sorted(one for one in path.iterdir() if one.suffix.lower() == ".png")
    notes = sorted(one for one in path.iterdir() if one.suffix.lower() in (".yaml", ".yml"))
    if not files or len(notes) != 1:
        raise RecordingError(f"{path}: {len(files)} PNG and {len(notes)} YAML files; PNGs and one YAML are wanted")
    words = _notes(notes[0])
    skip = round(number_of(notes[0], words, "skip_columns", 0, 0))
    first = _image(files[0], skip)
    if "times" in words:
        if not isinstance(words["times"], list) or len(words["times"]) != len(files):
            raise RecordingError(f"{notes[0]}: times must list one time for each of {len(files)} images")
        times = np.array([_moment(notes[0], one) for one in words["times"]])
        period = number_of(notes[0], words, "period_s", 1.0, 1e-3) if "period_s" in words else None
    else:
        if "start" not in words or "period_s" not in words:
            raise RecordingError(f"{notes[0]}: start and period_s, or times, are missing")
        period = number_of(notes[0], words, "period_s", 1.0, 1e-3)
        times = _moment(notes[0], words["start"]) + np.arange(len(files)) * period
    begin, periods, usual = turns_of(notes[0], times, period)
    video = video_format(notes[0], (first.shape[0], first.shape[1]), usual, words)
    bits = round(number_of(notes[0], words, "bits", 8, 1)) if "bits" in words else None
    counters: Counter[str] = Counter()

    def read() -> Iterator[Sweeps]:
        used, table = stretch_table(notes[0], bits, first)
        for scan, file in enumerate(files):
            turn = _image(file, skip)
            if turn.shape != first.shape:
                raise RecordingError(f"{file}: {turn.shape} cells where the first image has {first.shape}")
            yield from stretched_turn(file, scan, turn, used, table, begin[scan], periods[scan], blocks)
            counters["scans"] += 1

    site = RadarSite(str(words.get("id", path.name))[:32], 0, 0, 0, video)
    return Recording(path, site, len(files), read, counters)


def _notes(path: Path) -> dict[str, Any]:
    try:
        words = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: not YAML ({str(error).splitlines()[0]})") from error
    if not isinstance(words, dict):
        raise RecordingError(f"{path}: must hold names with values")
    unknown = {str(one) for one in words} - _IMAGE_WORDS
    if unknown:
        raise RecordingError(
            f"{path}: {', '.join(sorted(unknown))}: not known; known are {', '.join(sorted(_IMAGE_WORDS))}"
        )
    return words


def _moment(path: Path, value: Any) -> float:
    try:
        if hasattr(value, "isoformat"):
            value = value.isoformat()
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise RecordingError(f"{path}: {value!r} is not a time")
        return recorded_time(value, str(path))
    except Refused as error:
        raise RecordingError(str(error)) from error


def _image(path: Path, skip: int) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            width, height = image.size
            if not 16 <= height <= MAX_AZIMUTHS or not 16 <= width - skip <= MAX_RANGES:
                raise RecordingError(f"{path}: {width} x {height} pixels cannot be a turn of radar video")
            if image.mode in ("L", "P", "1"):
                pixels = np.asarray(image.convert("L"))
            elif image.mode.startswith("I"):
                pixels = (np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8)
            else:
                raise RecordingError(f"{path}: pixels are {image.mode}; grey values of 8 or 16 bits are wanted")
    except RecordingError:
        raise
    except Exception as error:  # the decoders of Pillow raise many kinds on damaged files
        raise RecordingError(f"{path}: not a readable PNG ({error})") from error
    return np.ascontiguousarray(pixels[:, skip:])
