"""Turns of radar video in an `.npz` of numpy.

`scans` (n, azimuths, ranges), rows from north clockwise, cells from the radar outward, and `t` (n,) UTC seconds at
which each turn began. Scans are integers of 1 to 16 bits, or floats of 0 to 1 or 0 to 255; `scans` of two dimensions
are the rows of `len(t)` turns one below the other. Optional numbers beside them: `range_step_m`, `first_range_m`,
`beamwidth_deg`, `db_per_step`, `bits`, and `transpose` (1: scans are (n, ranges, azimuths)).

bits: how many bits of each integer are used; fewer than 8 are stretched to 0..255, of more the upper 8 are kept.
Without it the greatest value of the first turn says: 4 up to 15, else as many as it needs, 8 at least.

What is converted is said in the notes of the recording.
"""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.amplitudes import Amplitudes
from app.ingest.recording import (
    Recording,
    RecordingError,
    blocks_of_turn,
    in_seconds,
    turns_of,
    video_format,
)
from pipeline.assemble.layout import looks_transposed
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

MAX_SCANS = 1_000_000

_NUMBERS = ("range_step_m", "first_range_m", "beamwidth_deg", "db_per_step", "bits", "transpose")


class _Scans:
    """The turns in a file, read one by one. shape: (n, rows, columns) as they lie in it. columns_first: of a turn."""

    def __init__(self, path: Path, turns: int, transpose: bool) -> None:
        self.path, self._transpose = path, transpose
        with zipfile.ZipFile(path) as archive, archive.open("scans.npy") as member:
            found, self._dtype = _header(path, member)
        self.note = ""
        if len(found) == 2:
            if turns < 1 or found[0] % turns or found[0] // turns < 16:
                raise RecordingError(
                    f"{path}: scans has 2 dimensions, and {found[0]} rows are not {turns} turns one below the other: "
                    "(turns, azimuths, ranges) is wanted"
                )
            found = (turns, found[0] // turns, found[1])
            self.note = f"scans has 2 dimensions: taken for {turns} turn{'s' * (turns > 1)} of {found[1]} rows"
        self.shape = found
        self.grid = found[:0:-1] if transpose else found[1:]

    def read(self) -> Iterator[NDArray[Any]]:
        """Turns (azimuths, ranges) of the file's own kind of number."""
        rows, columns = self.shape[1:]
        size = rows * columns * self._dtype.itemsize
        with zipfile.ZipFile(self.path) as archive, archive.open("scans.npy") as member:
            _header(self.path, member)
            for scan in range(self.shape[0]):
                raw = member.read(size)
                if len(raw) < size:
                    raise RecordingError(f"{self.path}: ends inside scan {scan} of {self.shape[0]}")
                turn = np.frombuffer(raw, self._dtype).reshape(rows, columns)
                yield np.ascontiguousarray(turn.T) if self._transpose else turn


def open_npz(path: Path, blocks: int) -> Recording:
    """The recording in a file; see `app.ingest.recordings.open_recording`. Raises RecordingError."""
    counters: Counter[str] = Counter()
    try:
        with zipfile.ZipFile(path) as archive:
            words = {
                name: _small(path, archive, name) for name in ("t", *_NUMBERS) if f"{name}.npy" in archive.namelist()
            }
        times = np.atleast_1d(words.pop("t", np.zeros(0)))
        scans = _Scans(path, len(times), bool(words.get("transpose", np.zeros(1)).any()))
        if times.shape != scans.shape[:1]:
            raise RecordingError(f"{path}: t must have one time for each of {scans.shape[0]} scans")
        seconds, converted = in_seconds(times)
        begin, periods, usual = turns_of(path, seconds, None)
        video = video_format(path, (scans.grid[0], scans.grid[1]), usual, words)
        first = next(scans.read())
    except RecordingError:
        raise
    except Exception as error:  # zipfile and numpy's header reader raise a dozen kinds on damaged files
        raise RecordingError(f"{path}: not a readable npz of scans and t ({error})") from error
    bits = int(np.atleast_1d(words["bits"])[0]) if "bits" in words else None
    amplitudes = Amplitudes.of(path, first, bits)
    if "transpose" not in words and looks_transposed(first):
        raise RecordingError(
            f"{path}: the columns of scans go round and the rows do not, as if they were (n, ranges, azimuths): add "
            "transpose=1, or transpose=0 when rows are azimuths all the same"
        )

    def read() -> Iterator[Sweeps]:
        try:
            for scan, turn in enumerate(scans.read()):
                octets = amplitudes.octets(scan, turn)
                yield from blocks_of_turn(scan, octets, float(begin[scan]), float(periods[scan]), blocks)
                counters["scans"] += 1
        except RecordingError:
            raise
        except Exception as error:  # zipfile and numpy's header reader raise a dozen kinds on damaged files
            raise RecordingError(f"{path}: damaged after {counters['scans']} scans ({error})") from error

    notes = tuple(filter(None, (scans.note, f"t: {converted}" if converted else "", amplitudes.note)))
    return Recording(path, RadarSite(path.stem[:32], 0, 0, 0, video), len(times), read, counters, notes)


def _header(path: Path, member: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(member)
    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = reader(member)
    if dtype.kind not in "biuf" or len(shape) not in (2, 3) or fortran:
        raise RecordingError(
            f"{path}: scans must be of integers (such as uint8) or floats, of 3 dimensions, in C order; they are "
            f"{dtype} of {len(shape)} dimensions{' in Fortran order' if fortran else ''}"
        )
    if len(shape) == 3 and not 1 <= shape[0] <= MAX_SCANS:
        raise RecordingError(f"{path}: {shape[0]} scans")
    return tuple(int(one) for one in shape), dtype


def _small(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > 16 * MAX_SCANS:
        raise RecordingError(f"{path}: {name} is too large")
    with archive.open(info) as member:
        value = np.lib.format.read_array(member, allow_pickle=False)
    if value.dtype.kind not in ("fiuM" if name == "t" else "fiub") or not value.size:
        raise RecordingError(f"{path}: {name} must be of numbers")
    return np.asarray(value) if name == "t" else np.asarray(value, np.float64)
