"""Bare files of ASTERIX data blocks, one behind the other (often named .ast or .cat240): no times, no ports.

A block is category, length (16 bits, of all of it), records. Octets 0 between blocks are padding; behind other octets
that are no block the next block of radar video is looked for.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO

from app.ingest.containers.packets import Datagram
from pipeline.asterix.cat240_decode import CATEGORY

LOOKED_AT = 1 << 18
"""Octets at the beginning by which a file is recognised: four blocks of the greatest length."""

_LEAST = 4
"""Octets of a block: its header and something in it."""

_LONGEST_OTHER = 1472
"""Octets of a block of another category that are believed: what one Ethernet frame carries. A length out of octets that
are no block would hide the video behind it."""

_ENOUGH = 4
"""Blocks of radar video that follow each other without a fault are no accident; a fault behind them is damage."""

_SOURCE_AND_TYPE = 0xC0
"""Bits of the first octet of a record of radar video: it has a source (I240/010) and a type (I240/000)."""


def is_blocks(head: bytes) -> bool:
    """The first LOOKED_AT octets of a file (all, when it is shorter) are ASTERIX blocks, some of radar video."""
    at, found = 0, 0
    while at < len(head):
        size = _size(head[at : at + _LEAST])
        if head[at] == 0 and at:
            at += 1
            continue
        if not size:
            return found >= _ENOUGH or (found > 0 and len(head) - at < _LEAST)
        if head[at] == CATEGORY and not _is_video(head[at : at + _LEAST]):
            return found >= _ENOUGH
        found += head[at] == CATEGORY and at + size <= len(head)
        at += size
    return found > 0


def datagrams(file: BinaryIO, counters: Counter[str]) -> Iterator[Datagram]:
    """The blocks of a file that is at its beginning, each as a datagram without time and port.

    Counts blocks, trailing (octets that are padding), damaged (places where octets are no block) and cut_off.
    """
    head, lost = file.read(_LEAST), False
    while len(head) == _LEAST:
        size = _size(head)
        if not size or (lost and not _is_video(head)):
            if head[0] == 0 and not lost:
                counters["trailing"] += 1
            elif not lost:
                counters["damaged"] += 1
                lost = True
            head = head[1:] + file.read(1)
            continue
        body = file.read(size - _LEAST)
        if len(body) < size - _LEAST:
            counters["cut_off"] += 1
            return
        lost = False
        counters["blocks"] += 1
        yield Datagram(math.nan, None, head + body)
        head = file.read(_LEAST)
    if any(head) and not lost:
        counters["cut_off"] += 1
    elif not lost:
        counters["trailing"] += len(head)


def _size(head: bytes) -> int:
    """Octets of the block that begins so; 0 when it is none."""
    size = int.from_bytes(head[1:3], "big")
    most = 0xFFFF if head[:1] == bytes([CATEGORY]) else _LONGEST_OTHER
    return size if len(head) == _LEAST and head[0] and _LEAST <= size <= most else 0


def _is_video(head: bytes) -> bool:
    return head[0] == CATEGORY and head[3] & _SOURCE_AND_TYPE == _SOURCE_AND_TYPE
