"""Recordings of radar video, read as blocks of sweeps.

`.npz`: `scans` (n, azimuths, ranges) uint8, rows from north clockwise, cells from the radar outward, and `t` (n,) UTC
seconds at which each turn began. Optional numbers beside them: `range_step_m`, `first_range_m`, `beamwidth_deg`,
`db_per_step`, `bits`.

A folder of polar PNGs, see `app.ingest.polar_images`; `.pcap` and `.pcapng` of CAT240, see `app.ingest.captures`.

bits: how many bits of each 8-bit value are used; fewer than 8 are stretched to 0..255. Without it, values that do not
pass 15 in the whole first turn are taken for 4-bit.
"""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.captures import Choice, open_capture
from app.ingest.polar_images import open_images
from app.ingest.recording import (
    Recording,
    RecordingError,
    stretch_table,
    stretched_turn,
    turns_of,
    video_format,
)
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

__all__ = ["Recording", "RecordingError", "open_recording"]

MAX_SCANS = 1_000_000


def open_recording(
    path: Path,
    *,
    site: RadarSite | None = None,
    blocks_per_scan: int = 32,
    port: int | None = None,
    sac: int | None = None,
    sic: int | None = None,
    resample: bool = False,
) -> Recording:
    """The recording at `path`.

    site: how the radar is described (else as the file says, or as it can be told from it). port: UDP port of the video
    in a capture (else all). sac, sic: which source in a capture is taken; there must be one choice. resample: cells of
    another length than the most frequent one are brought to that instead of left out. Raises RecordingError.
    """
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder")
    try:
        if path.is_dir():
            made = open_images(path, blocks_per_scan)
        elif path.suffix == ".npz":
            made = _npz(path, blocks_per_scan)
        elif path.suffix in (".pcap", ".pcapng", ".cap"):
            return open_capture(path, site, blocks_per_scan, port, Choice(sac, sic, resample))
        else:
            raise RecordingError(f"{path}: neither .npz, .pcap, .pcapng nor a folder of PNG files")
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    if site is None:
        return made
    own, wanted = made.site.video, site.video
    if (own.azimuths, own.ranges) != (wanted.azimuths, wanted.ranges):
        raise RecordingError(
            f"{path}: {own.azimuths} azimuths of {own.ranges} cells; radar {site.id} has {wanted.azimuths} of "
            f"{wanted.ranges}"
        )
    return replace(made, site=site)


def _npz(path: Path, blocks: int) -> Recording:
    try:
        with zipfile.ZipFile(path) as archive:
            with archive.open("scans.npy") as member:
                shape = _header(path, member, "scans", np.dtype(np.uint8), 3)
            words = {
                name: _small(path, archive, name)
                for name in ("t", "range_step_m", "first_range_m", "beamwidth_deg", "db_per_step", "bits")
                if f"{name}.npy" in archive.namelist()
            }
    except RecordingError:
        raise
    except Exception as error:  # zipfile and numpy's header reader raise a dozen kinds on damaged files
        raise RecordingError(f"{path}: not a readable npz of scans and t ({error})") from error
    times = np.atleast_1d(words.get("t", np.zeros(0)))
    if times.shape != (shape[0],):
        raise RecordingError(f"{path}: t must have one time for each of {shape[0]} scans")
    begin, periods, usual = turns_of(path, times, None)
    video = video_format(path, (shape[1], shape[2]), usual, {k: v for k, v in words.items() if k not in ("t", "bits")})
    counters: Counter[str] = Counter()
    size = shape[1] * shape[2]
    given = words.get("bits")
    bits = None if given is None else int(np.atleast_1d(given)[0])

    def read() -> Iterator[Sweeps]:
        try:
            with zipfile.ZipFile(path) as archive, archive.open("scans.npy") as member:
                _header(path, member, "scans", np.dtype(np.uint8), 3)
                for scan in range(shape[0]):
                    raw = member.read(size)
                    if len(raw) < size:
                        raise RecordingError(f"{path}: ends inside scan {scan} of {shape[0]}")
                    turn = np.frombuffer(raw, np.uint8).reshape(shape[1:])
                    if scan == 0:
                        used, table = stretch_table(path, bits, turn)
                    yield from stretched_turn(path, scan, turn, used, table, begin[scan], periods[scan], blocks)
                    counters["scans"] += 1
        except RecordingError:
            raise
        except Exception as error:  # zipfile and numpy's header reader raise a dozen kinds on damaged files
            raise RecordingError(f"{path}: damaged after {counters['scans']} scans ({error})") from error

    return Recording(path, RadarSite(path.stem[:32], 0, 0, 0, video), shape[0], read, counters)


def _header(path: Path, member: IO[bytes], name: str, dtype: np.dtype[Any], dimensions: int) -> tuple[int, ...]:
    version = np.lib.format.read_magic(member)
    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, found = reader(member)
    if found != dtype or len(shape) != dimensions or fortran:
        raise RecordingError(f"{path}: {name} must be {dtype} of {dimensions} dimensions in C order")
    if shape[0] > MAX_SCANS or shape[0] < 1:
        raise RecordingError(f"{path}: {shape[0]} scans")
    return tuple(int(one) for one in shape)


def _small(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[np.float64]:
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > 16 * MAX_SCANS:
        raise RecordingError(f"{path}: {name} is too large")
    with archive.open(info) as member:
        value = np.lib.format.read_array(member, allow_pickle=False)
    if value.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: {name} must be of numbers")
    return np.asarray(value, np.float64)
