"""ASTERIX CAT240 (radar video, edition 1.3): reading datagrams, the clear way.

Source: EUROCONTROL-SPEC-0149-240 edition 1.3 as transcribed in asterix-specs `cat240/cat-1.3.ast`. Edition 1.2 is
read by the same rules; that has not been verified, neither against its text nor against a recording. The setting
`udp.edition` of a radar therefore changes nothing in the reading: it notes what was agreed with the radar, since it is
not on the wire. `cat240_batch` reads the common case much faster.

Blocks carry their length, so those of other categories are passed over, and what stands behind the last block (padding
to a fixed size) does no harm. Compressed video (C of I240/048) is read where it is zlib or gzip: the standard leaves
the method to the users, and these are the ones met.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

CATEGORY = 240
MAX_CELLS = 65536
"""More cells than this in one message are not believed: 254 blocks of 256 octets hold fewer 8-bit cells."""

LONGEST_DAY = 86401 * 128
"""Counts of 1/128 s in a day with a leap second: a clock that shows it says 23:59:60, time of day 86,400."""

REASONS = ("malformed", "wrong_category", "compressed", "trailing")
"""Why a part of a datagram is left out: octets that break the rules; a block of another category; compressed in a way
that is not known; octets behind the last block."""

Reason = Literal["malformed", "wrong_category", "compressed", "trailing"]


class DecodeError(ValueError):
    """A datagram, or a part of one, that cannot be read. reason: one of REASONS, the counter it belongs to."""

    def __init__(self, reason: Reason, message: str) -> None:
        super().__init__(message)
        self.reason: Reason = reason


@dataclass(frozen=True, slots=True, eq=False)
class VideoMessage:
    """One video message.

    message: identification (I240/020). start, end: azimuth in 65,536 counts a turn. first_cell: cells before the first
    one here. cell_duration_fs: two-way time of a cell. bits: bits a cell on the wire. time_of_day: counts of 1/128 s
    since midnight UTC, or None. cells: (n,) uint8; cells of fewer bits are stretched to 0..255, of more bits cut to
    their eight highest.
    """

    sac: int
    sic: int
    message: int
    start: int
    end: int
    first_cell: int
    cell_duration_fs: int
    bits: int
    time_of_day: int | None
    cells: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class SummaryMessage:
    """One video summary message: free text about the stream. time_of_day: counts of 1/128 s, or None."""

    sac: int
    sic: int
    text: str
    time_of_day: int | None


_ZLIB_OR_GZIP = zlib.MAX_WBITS + 32
"""The header of the stream says which of the two it is."""

_FIXED = {1: 2, 2: 1, 3: 4, 5: 12, 6: 12, 7: 2, 8: 5, 12: 3}
"""FRN -> octets of the items of fixed length."""

_REPEATED = {4: 1, 9: 4, 10: 64, 11: 256}
"""FRN -> octets of one repetition; a REP octet goes before."""

_NAMES = {
    1: "010", 2: "000", 3: "020", 4: "030", 5: "040", 6: "041", 7: "048", 8: "049", 9: "050", 10: "051", 11: "052",
    12: "140", 13: "RE", 14: "SP",
}  # fmt: skip


def decode(datagram: bytes) -> list[VideoMessage | SummaryMessage]:
    """All messages of all data blocks of one datagram, in order; see `read_datagram` for what is left out.

    Raises DecodeError when there is none: a block of another category, a length that does not fit, an item that is
    missing, unknown or cut off, video that is compressed in an unknown way.
    """
    found, faults = read_datagram(datagram)
    if not found:
        raise faults[0]
    return found


def read_datagram(datagram: bytes) -> tuple[list[VideoMessage | SummaryMessage], list[DecodeError]]:
    """(all messages of a datagram in order, what was left out of it); at least one of the two is not empty.

    A record that cannot be read does not harm those before it; what is behind it in its block is left out with it, when
    nothing says where the next one begins. Blocks of other categories and octets behind the last block are left out.
    """
    found: list[VideoMessage | SummaryMessage] = []
    faults: list[DecodeError] = []
    at = 0
    while at < len(datagram):
        size = int.from_bytes(datagram[at + 1 : at + 3], "big")
        left = len(datagram) - at
        ours = datagram[at] == CATEGORY
        if left < 3 or not 3 <= size <= left:
            faults.append(_no_block(datagram[at], size, left, bool(at) and not (ours and left >= 3)))
            break
        if ours:
            _block(datagram, at + 3, at + size, found, faults)
        else:
            faults.append(DecodeError("wrong_category", f"category {datagram[at]}, not {CATEGORY}"))
        at += size
    if not found and not faults:
        faults.append(DecodeError("malformed", "empty datagram"))
    return found, faults


def _no_block(category: int, size: int, left: int, behind: bool) -> DecodeError:
    """What to say of octets whose first are no block header. behind: a block stands before them."""
    if behind:
        return DecodeError("trailing", f"{left} octets behind the last block")
    if left < 3:
        return DecodeError("malformed", f"{left} octets where a block header of 3 should be")
    if category != CATEGORY:
        return DecodeError("wrong_category", f"category {category}, not {CATEGORY}")
    return DecodeError("malformed", f"block of {size} octets in {left}")


def _block(
    data: bytes, at: int, end: int, found: list[VideoMessage | SummaryMessage], faults: list[DecodeError]
) -> None:
    if at == end:
        faults.append(DecodeError("malformed", "a block without a record"))
    begin = at
    while at < end:
        if at > begin and not any(data[at:end]):
            faults.append(DecodeError("trailing", f"{end - at} octets 0 behind the last record of a block"))
            return
        try:
            items, at = _items(data, at, end)
        except DecodeError as error:
            faults.append(error)
            return  # where the next record begins is not known
        try:
            found.append(_message(items))
        except DecodeError as error:
            faults.append(error)


def _message(items: dict[int, bytes]) -> VideoMessage | SummaryMessage:
    if 1 not in items or 2 not in items:
        raise DecodeError("malformed", "a record without I240/010 or I240/000")
    kind = items[2][0]
    if kind == 1:
        return _summary(items)
    if kind == 2:
        return _video(items)
    raise DecodeError("malformed", f"message type {kind} is neither summary nor video")


def _items(data: bytes, at: int, end: int) -> tuple[dict[int, bytes], int]:
    present: list[int] = []
    frn = 1
    while True:
        if at >= end:
            raise DecodeError("malformed", "the record ends inside its FSPEC")
        octet = data[at]
        at += 1
        present += [frn + i for i in range(7) if octet & (0x80 >> i)]
        frn += 7
        if not octet & 1:
            break
    items: dict[int, bytes] = {}
    for frn in present:
        size, skip = _size(data, at, end, frn)
        if at + size > end:
            raise DecodeError("malformed", f"I240/{_NAMES[frn]} is cut off")
        items[frn] = data[at + skip : at + size]
        at += size
    return items, at


def _size(data: bytes, at: int, end: int, frn: int) -> tuple[int, int]:
    """(octets of the item, octets of it that are a length or a repetition count)."""
    if frn in _FIXED:
        return _FIXED[frn], 0
    if frn not in _NAMES:
        raise DecodeError("malformed", f"FRN {frn} is not in the UAP")
    if at >= end:
        raise DecodeError("malformed", f"I240/{_NAMES[frn]} is cut off")
    count = data[at]
    if frn in _REPEATED:
        return 1 + count * _REPEATED[frn], 1
    if count == 0:
        raise DecodeError("malformed", f"I240/{_NAMES[frn]} says that it has no length")
    return count, 1


def _time(items: dict[int, bytes]) -> int | None:
    if 12 not in items:
        return None
    counts = int.from_bytes(items[12], "big")
    if counts >= LONGEST_DAY:
        raise DecodeError("malformed", f"time of day {counts / 128:.1f} s is more than a day with a leap second")
    return counts


def _summary(items: dict[int, bytes]) -> SummaryMessage:
    if 4 not in items:
        raise DecodeError("malformed", "a summary message without I240/030")
    return SummaryMessage(items[1][0], items[1][1], items[4].decode("ascii", "replace"), _time(items))


def _video(items: dict[int, bytes]) -> VideoMessage:
    for frn in (3, 7, 8):
        if frn not in items:
            raise DecodeError("malformed", f"a video message without I240/{_NAMES[frn]}")
    if (5 in items) == (6 in items):
        raise DecodeError("malformed", "a video message wants one of I240/040 and I240/041")
    if (9 in items) + (10 in items) + (11 in items) != 1:
        raise DecodeError("malformed", "a video message wants one of I240/050, 051 and 052")
    header = items.get(6) or items[5]
    video = items.get(9) or items.get(10) or items.get(11) or b""
    duration = int.from_bytes(header[8:12], "big") * (1 if 6 in items else 1_000_000)
    if duration == 0:
        raise DecodeError("malformed", "cells of no duration")
    resolution = items[7][1]
    if not 1 <= resolution <= 6:
        raise DecodeError("malformed", f"RES {resolution} of I240/048 is not defined")
    bits = 1 << (resolution - 1)
    octets = int.from_bytes(items[8][:2], "big")
    count = int.from_bytes(items[8][2:], "big")
    if items[7][0] & 0x80 and 0 < count <= MAX_CELLS:
        video = _expanded(video, (count * bits + 7) // 8)
        octets = len(video)
    if not 0 < count <= MAX_CELLS or octets > len(video) or (count * bits + 7) // 8 > octets:
        raise DecodeError("malformed", f"{count} cells of {bits} bits, {octets} octets valid of {len(video)}")
    return VideoMessage(
        sac=items[1][0],
        sic=items[1][1],
        message=int.from_bytes(items[3], "big"),
        start=int.from_bytes(header[0:2], "big"),
        end=int.from_bytes(header[2:4], "big"),
        first_cell=int.from_bytes(header[4:8], "big"),
        cell_duration_fs=duration,
        bits=bits,
        time_of_day=_time(items),
        cells=_to_octets(video, count, bits),
    )


def _expanded(video: bytes, wanted: int) -> bytes:
    """The first `wanted` octets of compressed video, or as many as there are. Where the stream ends it says itself."""
    try:
        return zlib.decompressobj(_ZLIB_OR_GZIP).decompress(video, wanted)
    except zlib.error as error:
        raise DecodeError("compressed", f"compressed video that is neither zlib nor gzip ({error})") from error


def _to_octets(video: bytes, count: int, bits: int) -> NDArray[np.uint8]:
    raw = np.frombuffer(video, np.uint8)
    if bits == 8:
        return raw[:count].copy()
    if bits > 8:
        return raw[:: bits // 8][:count].copy()
    lines = np.unpackbits(raw[: (count * bits + 7) // 8])[: count * bits].reshape(count, bits)
    weights = 1 << np.arange(bits - 1, -1, -1)
    values = lines @ weights
    return (values * (255 // ((1 << bits) - 1))).astype(np.uint8)
