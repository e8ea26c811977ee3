"""ASTERIX CAT240 (radar video, edition 1.3): making datagrams.

Source: EUROCONTROL-SPEC-0149-240 edition 1.3 as transcribed in asterix-specs `cat240/cat-1.3.ast`. A message made here
holds I240/010, 000, 020, 041, 048, 049, one of 050/051/052 and, when there is a time, 140.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

MAX_DATAGRAM = 1472
"""The UDP payload that fits one Ethernet frame of 1,500 octets."""

AZIMUTH_STEPS = 65536
"""Azimuth counts a turn."""

TIME_STEPS = 128
"""Time-of-day counts a second."""

_HEADER = 32
_OVERHEAD = _HEADER + 3
_SHORT = 1020
"""Octets that 255 blocks of I240/050 hold."""

RESOLUTION = {1: 1, 2: 2, 4: 3, 8: 4, 16: 5, 32: 6}
"""Bits a cell -> RES of I240/048."""


def cells_a_message(ranges: int) -> int:
    """How many 8-bit cells of a sweep of `ranges` cells go into each message, so that none passes MAX_DATAGRAM."""
    if ranges <= _SHORT:
        return ranges
    room = (MAX_DATAGRAM - _OVERHEAD) // 64 * 64
    if ranges <= room:
        return ranges
    parts = -(-ranges // room)
    return -(-ranges // (parts * 64)) * 64


def encode_sweeps(
    amplitude: NDArray[np.uint8],
    start_azimuth: NDArray[np.float64],
    end_azimuth: NDArray[np.float64],
    time_of_day: NDArray[np.float64],
    first_message: int,
    *,
    sac: int,
    sic: int,
    cell_duration_s: float,
    start_cell: int = 0,
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Datagrams of one video message each for sweeps of 8-bit cells.

    amplitude: (n, ranges) uint8. start_azimuth, end_azimuth: (n,) rad from the radar's own north. time_of_day: (n,)
    seconds since midnight UTC; a row that is nan sends no time. first_message: identification (I240/020) of the first
    message; the next free one is first_message + len(lengths), modulo 2**32. cell_duration_s: two-way time of one cell,
    2 * range step / c. start_cell: number of cells before the first one sent.
    Returns datagrams (m, 1472) uint8 and their lengths (m,) int32. A sweep too long for one datagram becomes several
    messages of one azimuth that follow each other in range.
    Raises ValueError when shapes or the cell duration do not fit.
    """
    n, ranges = amplitude.shape
    femto = round(cell_duration_s * 1e15)
    if amplitude.dtype != np.uint8 or not (len(start_azimuth) == len(end_azimuth) == len(time_of_day) == n):
        raise ValueError("amplitude must be uint8 and have one row for each azimuth and time")
    if not 0 < femto < 2**32 or ranges < 1:
        raise ValueError(f"{ranges} cells of {femto} fs cannot be sent: 1 fs to 4.29 us fit")
    if not (np.isfinite(start_azimuth).all() and np.isfinite(end_azimuth).all()):
        raise ValueError("azimuths must be finite")
    chunk = cells_a_message(ranges)
    parts = -(-ranges // chunk)
    datagrams = np.zeros((n * parts, MAX_DATAGRAM), np.uint8)
    lengths = np.zeros(n * parts, np.int32)
    _encode(
        np.ascontiguousarray(amplitude), azimuth_counts(start_azimuth), azimuth_counts(end_azimuth),
        _time_counts(time_of_day), first_message % 2**32, sac, sic, femto, start_cell, chunk, datagrams, lengths,
    )  # fmt: skip
    return datagrams, lengths


def azimuth_counts(azimuth: NDArray[np.float64]) -> NDArray[np.int64]:
    """Radians to the nearest of 65,536 counts a turn."""
    turns = np.asarray(azimuth, np.float64) / (2 * np.pi)
    return np.rint(turns * AZIMUTH_STEPS).astype(np.int64) % AZIMUTH_STEPS


def _time_counts(time_of_day: NDArray[np.float64]) -> NDArray[np.int64]:
    """Seconds since midnight to 1/128 s, -1 for nan; 86,400 and more is a leap second."""
    seconds = np.asarray(time_of_day, np.float64)
    known = np.isfinite(seconds)
    counts = np.rint(np.where(known, seconds, 0.0) * TIME_STEPS).astype(np.int64)
    # what is rounded up to midnight belongs to the next day
    counts = np.where(seconds >= 86400, counts, counts % (86400 * TIME_STEPS))
    return np.where(known, counts, -1)


def encode_message(
    cells: bytes,
    count: int,
    *,
    message: int,
    start: int,
    end: int,
    bits: int = 8,
    start_cell: int = 0,
    cell_duration: int = 20_000_000,
    nano: bool = False,
    time: int | None = None,
    sac: int = 0,
    sic: int = 0,
    compressed: bool = False,
) -> bytes:
    """One data block with one video message of any cell size; the plain, slow way.

    cells: the video octets. count: number of cells. start, end: azimuth counts. cell_duration: fs, or ns with `nano`.
    time: counts of 1/128 s, or None. Raises ValueError when the cells do not fit the video items.
    """
    octets = len(cells)
    if octets <= _SHORT:
        block, item = 4, 0x40
    elif octets <= 255 * 64:
        block, item = 64, 0x20
    elif octets <= 254 * 256:
        block, item = 256, 0x10
    else:
        raise ValueError(f"{octets} octets of video do not fit one message")
    repeats = -(-octets // block)
    second = 0x80 | item | (0x08 if time is not None else 0)
    record = bytes([0xE3 | (0x08 if nano else 0x04), second, sac, sic, 2])
    record += struct.pack(">IHHII", message % 2**32, start, end, start_cell, cell_duration)
    record += bytes([0x80 if compressed else 0, RESOLUTION[bits]])
    record += struct.pack(">H", octets) + count.to_bytes(3, "big")
    record += bytes([repeats]) + cells.ljust(repeats * block, b"\0")
    if time is not None:
        record += time.to_bytes(3, "big")
    return b"\xf0" + struct.pack(">H", 3 + len(record)) + record


def encode_summary(text: str, *, sac: int = 0, sic: int = 0) -> bytes:
    """One data block with one video summary message. Raises ValueError when the text is not ASCII or too long."""
    raw = text.encode("ascii")
    if len(raw) > 255:
        raise ValueError("a video summary holds at most 255 characters")
    record = bytes([0xD0, sac, sic, 1, len(raw)]) + raw
    return b"\xf0" + struct.pack(">H", 3 + len(record)) + record


@allocating
def _encode(amplitude, start, end, time, first_message, sac, sic, femto, start_cell, chunk, datagrams, lengths):  # type: ignore[no-untyped-def]
    ranges = amplitude.shape[1]
    parts = (ranges + chunk - 1) // chunk
    for i in range(amplitude.shape[0]):
        row = amplitude[i]
        for part in range(parts):
            m = i * parts + part
            out = datagrams[m]
            low = part * chunk
            cells = min(chunk, ranges - low)
            block = 4 if cells <= 1020 else 64
            repeats = (cells + block - 1) // block
            size = 32 + repeats * block + (3 if time[i] >= 0 else 0)
            message = (first_message + m) & 0xFFFFFFFF
            out[0] = 0xF0
            out[1] = size >> 8
            out[2] = size & 255
            out[3] = 0xE7
            out[4] = (0xC0 if block == 4 else 0xA0) | (0x08 if time[i] >= 0 else 0)
            out[5] = sac
            out[6] = sic
            out[7] = 2
            _put4(out, 8, message)
            out[12] = start[i] >> 8
            out[13] = start[i] & 255
            out[14] = end[i] >> 8
            out[15] = end[i] & 255
            _put4(out, 16, start_cell + low)
            _put4(out, 20, femto)
            out[24] = 0
            out[25] = 4
            out[26] = cells >> 8
            out[27] = cells & 255
            out[28] = 0
            out[29] = cells >> 8
            out[30] = cells & 255
            out[31] = repeats
            out[32 : 32 + cells] = row[low : low + cells]
            if time[i] >= 0:
                at = 32 + repeats * block
                out[at] = time[i] >> 16
                out[at + 1] = (time[i] >> 8) & 255
                out[at + 2] = time[i] & 255
            lengths[m] = size


@allocating
def _put4(out, at, value):  # type: ignore[no-untyped-def]
    out[at] = (value >> 24) & 255
    out[at + 1] = (value >> 16) & 255
    out[at + 2] = (value >> 8) & 255
    out[at + 3] = value & 255
