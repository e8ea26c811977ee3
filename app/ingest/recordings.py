"""Recordings of radar video, read as blocks of sweeps.

`.npz` of turns, see `app.ingest.npz`; a folder of polar PNGs, see `app.ingest.polar_images`; captures and bare files of
CAT240, see `app.ingest.captures`. What a file is, its octets say; its name decides nothing.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from app.ingest.captures import Choice, open_capture
from app.ingest.npz import open_npz
from app.ingest.polar_images import open_images
from app.ingest.recording import Recording, RecordingError
from pipeline.sites import RadarSite

__all__ = ["Recording", "RecordingError", "open_recording"]


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
        elif _is_zip(path):
            made = open_npz(path, blocks_per_scan)
        else:
            return open_capture(path, site, blocks_per_scan, port, Choice(sac, sic, resample))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    if site is None:
        return made
    own, wanted = made.site.video, site.video
    if (own.azimuths, own.ranges) != (wanted.azimuths, wanted.ranges):
        turned = (own.azimuths, own.ranges) == (wanted.ranges, wanted.azimuths)
        raise RecordingError(
            f"{path}: {own.azimuths} azimuths of {own.ranges} cells; radar {site.id} has {wanted.azimuths} of "
            f"{wanted.ranges}{': say `transpose`' if turned else ''}"
        )
    return replace(made, site=site)


def _is_zip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) == b"PK"
