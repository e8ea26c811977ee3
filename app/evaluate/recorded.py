"""A recording of radar video for the experiments that work on one."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from app.ingest.recording import RecordingError, in_seconds, number_of, turns_of, video_format
from pipeline.lab.evaluate import RecordedVideo


def recorded_video(path: Path) -> RecordedVideo:
    """The video of an `.npz`: `scans` (turns, azimuths, ranges) uint8 or uint16 and `t`, as `airside replay` takes it.

    Values are left as they are. Optional numbers: `range_step_m`, `first_range_m`, `bits`; without bits, values that do
    not pass 15 are taken for 4-bit, other uint8 for 8-bit, and uint16 for as many as the greatest value needs. Raises
    RecordingError.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            missing = [name for name in ("scans", "t") if name not in archive.files]
            if missing:
                raise RecordingError(f"{path}: has no {' and no '.join(missing)}")
            scans, time = archive["scans"], archive["t"]
            names = ("range_step_m", "first_range_m", "bits")
            words = {name: archive[name].ravel()[0] for name in names if name in archive.files and archive[name].size}
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # zipfile and numpy's readers raise a dozen kinds on damaged files
        raise RecordingError(f"{path}: not a readable npz of scans and t ({error})") from error
    if scans.dtype not in (np.uint8, np.uint16) or scans.ndim != 3 or not scans.size:
        raise RecordingError(f"{path}: scans must be uint8 or uint16 of 3 dimensions, not {scans.dtype} {scans.shape}")
    if time.shape != (len(scans),) or time.dtype.kind not in "fiuM":
        raise RecordingError(f"{path}: t must have one time for each of {len(scans)} scans")
    begin, _, usual = turns_of(path, in_seconds(time)[0], None)
    top = int(scans.max())
    bits = int(number_of(path, words, "bits", _bits(top, scans.dtype.itemsize), 1))
    if bits > 8 * scans.dtype.itemsize or top >> bits:
        raise RecordingError(f"{path}: bits says {bits}, but scans are {scans.dtype} up to {top}")
    video = video_format(path, (scans.shape[1], scans.shape[2]), usual, words)
    scans.flags.writeable = False
    return RecordedVideo(scans, begin, bits, video.range_step_m, video.first_range_m, name_of(path))


def name_of(path: Path) -> str:
    """The name of a file as text that can be written, whatever its octets are."""
    return os.fsencode(path.name).decode("utf-8", "replace")


def _bits(top: int, octets: int) -> int:
    if octets == 1:
        return 4 if top <= 15 else 8
    return max(8, top.bit_length())
