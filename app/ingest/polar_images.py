"""A folder of polar PNGs as a recording.

The images in the order of the numbers in their names (2 before 10), one turn each, rows from north clockwise, and one
YAML file beside them: `start` (UTC seconds or ISO 8601 with zone) and `period_s`, or `times` (one UTC a turn);
optionally `transpose` (true: columns are azimuths, rows are cells), `id`, `range_step_m`, `first_range_m`,
`beamwidth_deg`, `db_per_step`, `bits` and `skip_columns` (columns before the first cell, after `transpose`).

Pixels are grey values of 1, 8 or 16 bits. Colours that are all grey are converted; others are refused, as nothing says
which amplitude a colour stands for.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from app.contract import Refused
from app.ingest.amplitudes import Amplitudes
from app.ingest.recording import (
    MAX_AZIMUTHS,
    MAX_RANGES,
    Recording,
    RecordingError,
    blocks_of_turn,
    number_of,
    turns_of,
    video_format,
)
from app.ingest.wire_json import recorded_time
from pipeline.assemble.layout import looks_transposed
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

_IMAGE_WORDS = {
    "start", "period_s", "times", "id", "range_step_m", "first_range_m", "beamwidth_deg", "db_per_step",
    "bits", "skip_columns", "transpose",
}  # fmt: skip


@dataclass(frozen=True)
class _Layout:
    """How the pixels of an image lie. skip: columns before the first cell. transpose: None when it is not said."""

    skip: int
    transpose: bool | None


def open_images(path: Path, blocks: int) -> Recording:
    """The recording in a folder; see `app.ingest.recordings.open_recording`. Raises RecordingError, OSError."""
    inside = sorted((one for one in path.iterdir() if not one.name.startswith(".")), key=_natural)
    files = [one for one in inside if one.suffix.lower() == ".png"]
    notes = [one for one in inside if one.suffix.lower() in (".yaml", ".yml")]
    if not files or len(notes) != 1:
        raise RecordingError(f"{path}: {len(files)} PNG and {len(notes)} YAML files; PNGs and one YAML are wanted")
    words = _notes(notes[0])
    layout = _layout(notes[0], words)
    first, told = _image(files[0], layout)
    begin, periods, usual = _turns(notes[0], words, len(files))
    video = video_format(notes[0], (first.shape[0], first.shape[1]), usual, words)
    bits = round(number_of(notes[0], words, "bits", 8, 1)) if "bits" in words else None
    amplitudes = Amplitudes.of(notes[0], first, bits)
    counters: Counter[str] = Counter()

    def read() -> Iterator[Sweeps]:
        for scan, file in enumerate(files):
            turn, _ = _image(file, layout)
            if turn.shape != first.shape or turn.dtype != first.dtype:
                was = f"{first.shape} of {first.dtype}"
                raise RecordingError(f"{file}: {turn.shape} cells of {turn.dtype} where the first image has {was}")
            octets = replace(amplitudes, path=file).octets(scan, turn)
            yield from blocks_of_turn(scan, octets, float(begin[scan]), float(periods[scan]), blocks)
            counters["scans"] += 1

    site = RadarSite(str(words.get("id", path.name))[:32], 0, 0, 0, video)
    remarks = (*told, amplitudes.note, _which_way(files[0], first, layout))
    return Recording(path, site, len(files), read, counters, tuple(filter(None, remarks)))


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sorts names by the numbers in them, those of equal numbers by their letters."""
    parts = re.split(r"([0-9]+)", path.name)
    return [(int(one), "") if i % 2 else (0, one) for i, one in enumerate(parts)], path.name


def _layout(path: Path, words: dict[str, Any]) -> _Layout:
    transpose = words.get("transpose")
    if transpose is not None and not isinstance(transpose, bool):
        raise RecordingError(f"{path}: transpose must be true or false")
    return _Layout(round(number_of(path, words, "skip_columns", 0, 0)), transpose)


def _which_way(path: Path, first: NDArray[Any], layout: _Layout) -> str:
    if layout.transpose is not None:
        return ""
    if looks_transposed(first):
        raise RecordingError(
            f"{path}: its columns go round and its rows do not, as if they were cells: say `transpose: true`, or "
            "`transpose: false` when rows are azimuths all the same"
        )
    azimuths, ranges = first.shape
    return (
        f"{azimuths} rows are taken for azimuths and {ranges} columns for cells; `transpose: true` swaps them, "
        "`transpose: false` says that this is right"
    )


def _turns(path: Path, words: dict[str, Any], images: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    if "times" in words:
        if not isinstance(words["times"], list) or len(words["times"]) != images:
            raise RecordingError(f"{path}: times must list one time for each of {images} images")
        times = np.array([_moment(path, one) for one in words["times"]])
        period = number_of(path, words, "period_s", 1.0, 1e-3) if "period_s" in words else None
    else:
        if "start" not in words or "period_s" not in words:
            raise RecordingError(f"{path}: start and period_s, or times, are missing")
        period = number_of(path, words, "period_s", 1.0, 1e-3)
        times = _moment(path, words["start"]) + np.arange(images) * period
    return turns_of(path, times, period)


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


def _image(path: Path, layout: _Layout) -> tuple[NDArray[Any], tuple[str, ...]]:
    """(one turn (azimuths, ranges) of unsigned integers, what was converted)."""
    try:
        with Image.open(path) as image:
            width, height = image.size[::-1] if layout.transpose else image.size
            if not 16 <= height <= MAX_AZIMUTHS or not 16 <= width - layout.skip <= MAX_RANGES:
                raise RecordingError(f"{path}: {width} x {height} pixels cannot be a turn of radar video")
            pixels, note = _grey(path, image)
    except RecordingError:
        raise
    except Exception as error:  # the decoders of Pillow raise many kinds on damaged files
        raise RecordingError(f"{path}: not a readable PNG ({error})") from error
    turn = pixels.T if layout.transpose else pixels
    return np.ascontiguousarray(turn[:, layout.skip :]), (note,) if note else ()


def _grey(path: Path, image: Image.Image) -> tuple[NDArray[Any], str]:
    """(grey values of an image as unsigned integers, what was converted or "")."""
    if image.mode in ("L", "1"):
        return np.asarray(image.convert("L")), ""
    if image.mode.startswith("I"):
        return np.asarray(image).astype(np.uint16), ""
    if image.mode not in ("P", "PA", "LA", "RGB", "RGBA"):
        raise RecordingError(f"{path}: pixels are {image.mode}; grey values of 8 or 16 bits are wanted")
    colours = np.asarray(image.convert("RGBA"))
    red, green, blue, opaque = (colours[..., i] for i in range(4))
    if bool((red != green).any() or (red != blue).any()):
        of = "a palette" if image.mode.startswith("P") else image.mode
        raise RecordingError(
            f"{path}: pixels are colours of {of}, and nothing says which amplitude a colour stands for; grey values of "
            "8 or 16 bits are wanted"
        )
    if bool((opaque != 255).any()):
        raise RecordingError(f"{path}: pixels of {image.mode} are transparent; grey values of 8 or 16 bits are wanted")
    return red, f"pixels of {image.mode} are all grey, and taken as grey values"
