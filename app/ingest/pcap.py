"""UDP datagrams out of capture files: pcap (both byte orders, micro- and nanoseconds) and pcapng.

Link layers: Ethernet with VLAN tags, Linux cooked (1 and 2), raw IP, BSD loopback. IPv4 and IPv6; fragments are put
together. Every length is checked before it is believed; what is not a whole UDP datagram is counted by reason.
"""

from __future__ import annotations

import struct
from collections import Counter, OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple


class CaptureError(ValueError):
    """The file is no capture, or is damaged; the message names the file and the reason."""


class Datagram(NamedTuple):
    """One UDP datagram. time: UTC s of its capture. port: destination."""

    time: float
    port: int
    payload: bytes


MAX_RECORD = 1 << 20
"""Octets of one captured packet or block that are believed."""

MAX_ASSEMBLIES = 64
"""Fragmented datagrams that may be open at once."""

_MAGIC = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6), b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9), b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}  # fmt: skip
_SECTION = 0x0A0D0D0A
_IPV4, _IPV6, _VLAN = 0x0800, 0x86DD, (0x8100, 0x88A8, 0x9100)

_Packet = tuple[float, int, bytes]


def datagrams(path: Path, counters: Counter[str]) -> Iterator[Datagram]:
    """The UDP datagrams of a capture, in its order.

    Counted in `counters`: packets, not_udp, snapped (captured in part), damaged (lengths that do not fit), fragments,
    fragments_lost, unknown_link, cut_off (the file ends inside a packet, as when the capture was killed).
    Raises CaptureError, or OSError when the file cannot be read.
    """
    fragments = _Fragments(counters)
    with path.open("rb") as file:
        magic = file.read(4)
        if magic in _MAGIC:
            packets = _pcap(file, path, *_MAGIC[magic], counters)
        elif magic == b"\x0a\x0d\x0d\x0a":
            packets = _pcapng(file, path, counters)
        else:
            raise CaptureError(f"{path}: neither pcap nor pcapng")
        for time, link, frame in packets:
            counters["packets"] += 1
            found = _network(link, frame)
            if found is None:
                counters["not_udp" if link in _LINKS else "unknown_link"] += 1
                continue
            kind, data = found
            udp = _ipv4(data, fragments, counters) if kind == _IPV4 else _ipv6(data, fragments, counters)
            if udp is not None:
                made = _udp(udp, time, counters)
                if made is not None:
                    yield made
    counters["fragments_lost"] += len(fragments.open)


def _pcap(file: BinaryIO, path: Path, order: str, unit: float, counters: Counter[str]) -> Iterator[_Packet]:
    header = file.read(20)
    if len(header) < 20:
        raise CaptureError(f"{path}: ends inside its header")
    link = struct.unpack(order + "I", header[16:])[0] & 0x0FFFFFFF
    record = struct.Struct(order + "IIII")
    while head := file.read(16):
        if len(head) < 16:
            counters["cut_off"] += 1
            return
        seconds, fraction, kept, whole = record.unpack(head)
        if kept > MAX_RECORD:
            raise CaptureError(f"{path}: damaged: a packet of {kept} octets at {file.tell() - 16}")
        frame = file.read(kept)
        if len(frame) < kept:
            counters["cut_off"] += 1
            return
        if kept < whole:
            counters["snapped"] += 1
            continue
        yield seconds + fraction * unit, link, frame


def _pcapng(file: BinaryIO, path: Path, counters: Counter[str]) -> Iterator[_Packet]:
    file.seek(0)
    order, links = "<", list[tuple[int, float]]()
    while head := file.read(8):
        if len(head) < 8:
            counters["cut_off"] += 1
            return
        kind = struct.unpack(order + "I", head[:4])[0]
        if kind == _SECTION:
            mark = file.read(4)
            order = "<" if mark == b"\x4d\x3c\x2b\x1a" else ">"
            if mark not in (b"\x4d\x3c\x2b\x1a", b"\x1a\x2b\x3c\x4d"):
                raise CaptureError(f"{path}: damaged: a section without its byte order at {file.tell() - 4}")
            file.seek(-4, 1)
            links = []
        size = struct.unpack(order + "I", head[4:])[0]
        if size < 12 or size % 4 or size > MAX_RECORD:
            raise CaptureError(f"{path}: damaged: a block of {size} octets at {file.tell() - 8}")
        body = file.read(size - 8)
        if len(body) < size - 8:
            counters["cut_off"] += 1
            return
        yield from _block(kind, body[:-4], order, links, counters)


def _block(
    kind: int, body: bytes, order: str, links: list[tuple[int, float]], counters: Counter[str]
) -> Iterator[_Packet]:
    if kind == 1 and len(body) >= 8:
        links.append((struct.unpack(order + "H", body[:2])[0], _resolution(body[8:], order)))
    elif kind == 6 and len(body) >= 20:
        interface, high, low, kept, whole = struct.unpack(order + "IIIII", body[:20])
        if interface >= len(links) or kept > len(body) - 20:
            counters["damaged"] += 1
        elif kept < whole:
            counters["snapped"] += 1
        else:
            link, unit = links[interface]
            yield (high << 32 | low) * unit, link, body[20 : 20 + kept]


def _resolution(options: bytes, order: str) -> float:
    at = 0
    while at + 4 <= len(options):
        code, size = struct.unpack(order + "HH", options[at : at + 4])
        if code == 9 and size >= 1 and at + 4 < len(options):
            value = options[at + 4]
            return float(2.0 ** -(value & 0x7F) if value & 0x80 else 10.0**-value)
        if code == 0:
            break
        at += 4 + (size + 3) // 4 * 4
    return 1e-6


_LINKS = {0: 4, 1: 14, 12: 0, 14: 0, 101: 0, 108: 4, 113: 16, 228: 0, 229: 0, 276: 20}
"""Link type -> octets before what the network layer sent."""


def _network(link: int, frame: bytes) -> tuple[int, bytes] | None:
    if link not in _LINKS or len(frame) <= _LINKS[link]:
        return None
    at = _LINKS[link]
    if link == 1:
        kind = int.from_bytes(frame[12:14], "big")
        while kind in _VLAN and len(frame) >= at + 4:
            kind = int.from_bytes(frame[at + 2 : at + 4], "big")
            at += 4
    elif link in (113, 276):
        kind = int.from_bytes(frame[14:16] if link == 113 else frame[0:2], "big")
    else:
        kind = {4: _IPV4, 6: _IPV6}.get(frame[at] >> 4, 0)
    return (kind, frame[at:]) if kind in (_IPV4, _IPV6) and len(frame) > at else None


def _ipv4(data: bytes, fragments: _Fragments, counters: Counter[str]) -> bytes | None:
    header = (data[0] & 0x0F) * 4
    total = int.from_bytes(data[2:4], "big")
    if len(data) < 20 or data[0] >> 4 != 4 or header < 20 or not header <= total <= len(data):
        counters["damaged"] += 1
        return None
    if data[9] != 17:
        counters["not_udp"] += 1
        return None
    field = int.from_bytes(data[6:8], "big")
    offset, more = (field & 0x1FFF) * 8, bool(field & 0x2000)
    if not offset and not more:
        return data[header:total]
    return fragments.add(data[12:20] + data[4:6], offset, more, data[header:total])


def _ipv6(data: bytes, fragments: _Fragments, counters: Counter[str]) -> bytes | None:
    size = int.from_bytes(data[4:6], "big")
    if len(data) < 40 or data[0] >> 4 != 6 or 40 + size > len(data):
        counters["damaged"] += 1
        return None
    end, at, kind = 40 + size, 40, data[6]
    while kind in (0, 43, 60, 44):
        if at + 8 > end:
            counters["damaged"] += 1
            return None
        if kind == 44:
            field = int.from_bytes(data[at + 2 : at + 4], "big")
            if data[at] != 17:
                break
            return fragments.add(
                data[8:40] + data[at + 4 : at + 8], field & 0xFFF8, bool(field & 1), data[at + 8 : end]
            )
        kind, at = data[at], at + 8 + data[at + 1] * 8
    if kind != 17:
        counters["not_udp"] += 1
        return None
    return data[at:end]


def _udp(data: bytes, time: float, counters: Counter[str]) -> Datagram | None:
    if len(data) < 8:
        counters["damaged"] += 1
        return None
    size = int.from_bytes(data[4:6], "big")
    if not 8 <= size <= len(data):
        counters["damaged"] += 1
        return None
    return Datagram(time, int.from_bytes(data[2:4], "big"), data[8:size])


class _Fragments:
    """Datagrams whose fragments are not all here; the oldest makes room for the newest."""

    def __init__(self, counters: Counter[str]) -> None:
        self.open: OrderedDict[bytes, tuple[dict[int, bytes], int]] = OrderedDict()
        self._counters = counters

    def add(self, key: bytes, offset: int, more: bool, data: bytes) -> bytes | None:
        """The whole datagram when this was its last missing fragment."""
        self._counters["fragments"] += 1
        if offset + len(data) > 65535:
            self._counters["damaged"] += 1
            return None
        pieces, end = self.open.pop(key, ({}, -1))
        pieces[offset] = data
        if not more:
            end = offset + len(data)
        whole, at = [], 0
        while pieces.get(at):
            whole.append(pieces[at])
            at += len(pieces[at])
        if end >= 0 and at == end:
            return b"".join(whole)
        self.open[key] = (pieces, end)
        if len(self.open) > MAX_ASSEMBLIES:
            self.open.popitem(last=False)
            self._counters["fragments_lost"] += 1
        return None
