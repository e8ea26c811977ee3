"""Sweeps as octets: the body of `POST /api/v1/radars/{id}/sweeps` (application/octet-stream).

All numbers are little-endian. A header of 48 octets, then for each sweep 16 octets of its own and its cells:

    offset  type     header
    0       4 char   magic, "ASWP"
    4       u16      version, 1
    6       u16      flags: bit 0, the times are those of the sweeps; without it they are 0 and the body is refused
    8       u32      n, sweeps in this body
    12      u32      cells a sweep; the radar's own number
    16      f64      range of the centre of cell 0, metres
    24      f64      metres between cell centres
    32      u32      azimuths a turn that the rows count in; the radar's own number
    36      u32      number of the turn, counted by the sender; a turn may be spread over several bodies
    40      u64      0, for later use

    offset  type     sweep
    0       f64      UTC of the sweep, seconds since 1970
    8       u32      row: position in the turn from north, clockwise, 0 .. azimuths - 1
    12      u32      0, for later use
    16      u8 * c   log amplitude of each cell, nearest first

Rows ascend within a body; a body does not pass north. The length must be 48 + n * (16 + cells) exactly. Times that are
far from those of their arrival, or step, are corrected, and the radar is shown as degraded.
"""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.contract import Refused
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

MAGIC = b"ASWP"
VERSION = 1
TIMED = 1
_HEADER = struct.Struct("<4sHHIIddIIQ")
_ROW = 16

GREATEST_TIME_S = 1e12
"""Beyond this (30,000 years) the seconds of a float are no longer exact enough to tell sweeps apart."""


class _Header(NamedTuple):
    magic: bytes
    version: int
    flags: int
    sweeps: int
    cells: int
    first_range: float
    range_step: float
    azimuths: int
    scan: int
    spare: int


def encode_sweeps(sweeps: Sweeps, site: RadarSite) -> bytes:
    """The octet form of a block of sweeps, for clients."""
    video = site.video
    n, cells = sweeps.amplitude.shape
    header = _HEADER.pack(
        MAGIC, VERSION, TIMED, n, cells, video.first_range_m, video.range_step_m, video.azimuths,
        sweeps.scan % 2**32, 0,
    )  # fmt: skip
    rows = np.zeros(n, _row_type(cells))
    rows["time"], rows["row"], rows["cells"] = sweeps.time, sweeps.row, sweeps.amplitude
    return header + rows.tobytes()


def decode_sweeps(
    body: bytes, site: RadarSite, index: int, blocks_per_scan: int = 32
) -> tuple[list[Sweeps], dict[str, int]]:
    """The blocks in a body, cut at the edges of the chain's blocks, and what was taken.

    index: of the radar in the engine. Gives the blocks and {"taken": sweeps}. Raises Refused, with what is wrong, when
    anything in the body does not fit the radar; nothing is taken then.
    """
    header = _checked_header(body, site)
    rows = np.frombuffer(body, _row_type(header.cells), header.sweeps, _HEADER.size)
    row: NDArray[np.int64] = rows["row"].astype(np.int64)
    time: NDArray[np.float64] = rows["time"].astype(np.float64)
    _check_rows(row, time, header.azimuths)
    azimuth = np.asarray((row + 0.5) * site.video.azimuth_step_rad, np.float64)
    edges = np.flatnonzero(np.diff(row * blocks_per_scan // header.azimuths)) + 1
    blocks = []
    for low, high in zip([0, *edges.tolist()], [*edges.tolist(), len(row)], strict=True):
        blocks.append(
            Sweeps(
                radar=index,
                scan=header.scan,
                row=row[low:high].astype(np.int32),
                azimuth=azimuth[low:high],
                time=time[low:high],
                amplitude=np.ascontiguousarray(rows["cells"][low:high]),
                last=bool(row[high - 1] == header.azimuths - 1),
            )
        )
    return blocks, {"taken": header.sweeps}


class OctetIntake:
    """decode_sweeps for one radar over many bodies, with turns numbered here.

    A sender that starts again, or numbers wildly, then only begins the next turn: its own number would put the chain
    behind or far ahead of everything that follows. Bodies of one number whose rows go on belong to one turn.
    """

    def __init__(self, site: RadarSite, index: int, blocks_per_scan: int = 32) -> None:
        self._site, self._index, self._blocks = site, index, blocks_per_scan
        self._theirs, self._own, self._row = -1, -1, -1

    def take(self, body: bytes) -> tuple[list[Sweeps], dict[str, int]]:
        """The blocks in a body and {"taken": sweeps}. Raises Refused, taking nothing."""
        blocks, counted = decode_sweeps(body, self._site, self._index, self._blocks)
        if blocks[0].scan != self._theirs or int(blocks[0].row[0]) <= self._row:
            self._own += 1
        self._theirs, self._row = blocks[0].scan, int(blocks[-1].row[-1])
        return [replace(one, scan=self._own) for one in blocks], counted


def _row_type(cells: int) -> np.dtype[np.void]:
    return np.dtype([("time", "<f8"), ("row", "<u4"), ("_", "<u4"), ("cells", "u1", (cells,))])


def _checked_header(body: bytes, site: RadarSite) -> _Header:
    video = site.video
    if len(body) < _HEADER.size:
        raise Refused(f"{len(body)} octets are less than the header of {_HEADER.size}")
    header = _Header(*_HEADER.unpack_from(body))
    if header.magic != MAGIC:
        raise Refused("the body does not begin with ASWP")
    if header.version != VERSION:
        raise Refused(f"version {header.version} of the sweep form is not known, only {VERSION}")
    if header.flags != TIMED:
        raise Refused(f"flags {header.flags:#06x}: bit 0 (sweeps carry their time) and no other must be set")
    if header.cells != video.ranges or header.azimuths != video.azimuths:
        raise Refused(
            f"{header.cells} cells and {header.azimuths} azimuths; "
            f"radar {site.id} has {video.ranges} and {video.azimuths}"
        )
    if not _close(header.range_step, video.range_step_m, video.range_step_m / (2 * video.ranges)) or not _close(
        header.first_range, video.first_range_m, video.range_step_m / 2
    ):
        raise Refused(
            f"first range {header.first_range:g} m and step {header.range_step:g} m; "
            f"radar {site.id} has {video.first_range_m:g} m and {video.range_step_m:g} m"
        )
    if not 0 < header.sweeps <= header.azimuths:
        raise Refused(f"{header.sweeps} sweeps: a body holds 1 to {header.azimuths}")
    wanted = _HEADER.size + header.sweeps * (_ROW + header.cells)
    if len(body) != wanted:
        raise Refused(f"{len(body)} octets; {header.sweeps} sweeps of {header.cells} cells make {wanted}")
    return header


def _close(given: float, own: float, tolerance: float) -> bool:
    return math.isfinite(given) and abs(given - own) <= tolerance


def _check_rows(row: NDArray[np.int64], time: NDArray[np.float64], azimuths: int) -> None:
    if int(row.max()) >= azimuths:
        raise Refused(f"row {int(row.max())} is beyond the last of {azimuths} azimuths")
    if len(row) > 1 and int(np.diff(row).min()) <= 0:
        raise Refused("rows must ascend; a body does not pass north")
    if not bool((np.abs(time) <= GREATEST_TIME_S).all()):
        raise Refused("times must be finite UTC seconds")
