"""Packets of a pcapng file: enhanced, simple and obsolete packet blocks, any number of sections and interfaces.

Source: draft-ietf-opsawg-pcapng. Simple packet blocks have no time.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from app.ingest.containers.packets import MAX_PACKET, MAX_RECORD, CaptureError, Packet, skip, take

SECTION = b"\x0a\x0d\x0d\x0a"
"""The first 4 octets of a file, the same in both byte orders."""

_ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_INTERFACE, _OBSOLETE_PACKET, _SIMPLE_PACKET, _ENHANCED_PACKET = 1, 2, 3, 6
_WANTED = (_INTERFACE, _OBSOLETE_PACKET, _SIMPLE_PACKET, _ENHANCED_PACKET)
_END, _RESOLUTION, _FCS_LENGTH, _OFFSET = 0, 9, 13, 14
"""Codes of options of an interface."""

_FARTHEST_S = 1e11
"""Seconds since 1970 that are believed of a packet (3,000 years)."""


class _Interface(NamedTuple):
    """unit: s of a count. offset: s to be added. kept: octets of a packet that are kept, 0 for all."""

    link: int
    kept: int
    unit: float
    offset: int
    fcs: int


def packets(file: BinaryIO, path: Path, counters: Counter[str]) -> Iterator[Packet]:
    """The packets of a file that is at its beginning.

    Counts damaged (lengths that do not fit), oversized (too long for what is looked for) and cut_off. Raises
    CaptureError where the chain of blocks is broken.
    """
    order, interfaces, at = "<", list[_Interface](), 0
    while head := file.read(8):
        if len(head) < 8:
            counters["cut_off"] += 1
            return
        begun = b""
        if head[:4] == SECTION:
            begun = file.read(4)
            if begun not in _ORDERS:
                raise CaptureError(f"{path}: damaged: a section without its byte order at {at + 8}")
            order, interfaces = _ORDERS[begun], []
        kind, size = struct.unpack(order + "II", head)
        if size < 12 + len(begun) or size % 4 or size > MAX_RECORD:
            raise CaptureError(f"{path}: damaged: a block of {size} octets at {at}")
        at += size
        left = size - 8 - len(begun)
        body = take(file, min(left, MAX_PACKET) if kind in _WANTED else 0, counters)
        if body is None or not skip(file, left - len(body), counters):
            return
        if kind == _INTERFACE:
            interfaces.append(_interface(body[: size - 12], order))
        elif kind in _WANTED:
            packet = _packet(kind, body[: size - 12], size - 12, order, interfaces, counters)
            if packet is not None:
                yield packet


def _packet(
    kind: int, body: bytes, room: int, order: str, interfaces: list[_Interface], counters: Counter[str]
) -> Packet | None:
    """room: octets of the block's body, of which `body` may hold fewer."""
    try:
        if kind == _ENHANCED_PACKET:
            number, high, low, kept, wire = struct.unpack_from(order + "IIIII", body)
            begin = 20
        elif kind == _OBSOLETE_PACKET:
            number, _, high, low, kept, wire = struct.unpack_from(order + "HHIIII", body)
            begin = 20
        else:
            (wire,) = struct.unpack_from(order + "I", body)
            number, high, low, begin = 0, 0, 0, 4
            kept = min(wire, interfaces[0].kept or wire, room - begin)
        one = interfaces[number]
    except (struct.error, IndexError):
        counters["damaged"] += 1
        return None
    time = math.nan if kind == _SIMPLE_PACKET else (high << 32 | low) * one.unit + one.offset
    if kept > room - begin or abs(time) > _FARTHEST_S:
        counters["damaged"] += 1
        return None
    if kept > len(body) - begin:
        counters["oversized"] += 1
        return None
    return Packet(time, one.link, body[begin : begin + kept], wire, one.fcs)


def _interface(body: bytes, order: str) -> _Interface:
    if len(body) < 8:
        return _Interface(-1, 0, 1e-6, 0, 0)
    link, _, kept = struct.unpack_from(order + "HHI", body)
    unit, offset, fcs = 1e-6, 0, 0
    for code, value in _options(body[8:], order):
        if code == _RESOLUTION and value:
            unit = 2.0 ** -(value[0] & 0x7F) if value[0] & 0x80 else 10.0 ** -value[0]
        elif code == _OFFSET and len(value) == 8:
            (offset,) = struct.unpack(order + "q", value)
        elif code == _FCS_LENGTH and value:
            # the standard says bits, writers write octets as well: 4 and 32 mean the same
            fcs = value[0] // 8 if value[0] >= 16 else value[0]
    return _Interface(link, kept, unit, offset, fcs)


def _options(octets: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(octets):
        code, size = struct.unpack_from(order + "HH", octets, at)
        if code == _END:
            return
        yield code, octets[at + 4 : at + 4 + size]
        at += 4 + (size + 3) // 4 * 4
