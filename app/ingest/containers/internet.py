"""UDP datagrams out of IPv4 and IPv6 packets: fragments put together, lengths and checksums judged.

Sources: RFC 791 (IPv4), RFC 8200 (IPv6), RFC 768 (UDP).
"""

from __future__ import annotations

from collections import Counter

from app.ingest.containers.fragments import Fragments
from app.ingest.containers.links import IPV4
from app.ingest.containers.packets import Datagram, Packet

UDP = 17
_HOP_BY_HOP, _ROUTING, _FRAGMENT, _AUTHENTICATION, _DESTINATION = 0, 43, 44, 51, 60
"""Headers of IPv6 that may stand before UDP."""


class Internet:
    """Reads IP packets in the order of the capture.

    Counted: not_udp; snapped (lengths do not fit a packet of which only a part was captured); damaged (lengths do not
    fit); wrong_checksum (of UDP: the datagram is dropped, as a receiver does); those of `Fragments`.
    """

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self._fragments = Fragments(counters)

    def datagram(self, kind: int, data: bytes, packet: Packet) -> Datagram | None:
        """The datagram that the IP packet `data` of `packet` completes, if any. kind: IPV4 or IPV6."""
        return self._ipv4(data, packet) if kind == IPV4 else self._ipv6(data, packet)

    def finish(self) -> None:
        """Count the fragments whose datagram was never whole."""
        self._fragments.finish()

    def _ipv4(self, data: bytes, packet: Packet) -> Datagram | None:
        header = (data[0] & 0x0F) * 4
        # a length of 0 was to be filled in by the network card that the capture stands before
        total = int.from_bytes(data[2:4], "big") or len(data) - packet.fcs
        if len(data) < 20 or data[0] >> 4 != 4 or header < 20 or not header <= total <= len(data):
            self._short(packet)
            return None
        if data[9] != UDP:
            self._counters["not_udp"] += 1
            return None
        field = int.from_bytes(data[6:8], "big")
        offset, more, addresses = (field & 0x1FFF) * 8, bool(field & 0x2000), data[12:20]
        whole: bytes | None = data[header:total]
        if offset or more:
            whole = self._fragments.add(addresses, data[4:6], offset, more, data[header:total], packet.time)
        return None if whole is None else self._udp(whole, addresses, packet)

    def _ipv6(self, data: bytes, packet: Packet) -> Datagram | None:
        end = 40 + int.from_bytes(data[4:6], "big")
        end = len(data) - packet.fcs if end == 40 else end
        if len(data) < 40 or data[0] >> 4 != 6 or end > len(data):
            self._short(packet)
            return None
        at, kind, addresses = 40, data[6], data[8:40]
        while kind in (_HOP_BY_HOP, _ROUTING, _FRAGMENT, _AUTHENTICATION, _DESTINATION):
            if at + 8 > end:
                self._short(packet)
                return None
            if kind == _FRAGMENT and data[at] == UDP:
                field = int.from_bytes(data[at + 2 : at + 4], "big")
                offset, more, piece = field & 0xFFF8, bool(field & 1), data[at + 8 : end]
                whole = self._fragments.add(addresses, data[at + 4 : at + 8], offset, more, piece, packet.time)
                return None if whole is None else self._udp(whole, addresses, packet)
            if kind == _FRAGMENT:
                break
            size = data[at + 1] * 4 + 8 if kind == _AUTHENTICATION else data[at + 1] * 8 + 8
            kind, at = data[at], at + size
        if kind != UDP:
            self._counters["not_udp"] += 1
            return None
        return self._udp(data[at:end], addresses, packet)

    def _udp(self, data: bytes, addresses: bytes, packet: Packet) -> Datagram | None:
        size = int.from_bytes(data[4:6], "big") or len(data)
        if len(data) < 8 or not 8 <= size <= len(data):
            self._short(packet)
            return None
        if not _checksum_holds(data[:size], addresses):
            self._counters["wrong_checksum"] += 1
            return None
        return Datagram(packet.time, int.from_bytes(data[2:4], "big"), data[8:size])

    def _short(self, packet: Packet) -> None:
        self._counters["snapped" if len(packet.frame) < packet.wire else "damaged"] += 1


def _checksum_holds(data: bytes, addresses: bytes) -> bool:
    """The checksum of a UDP datagram with its header holds, or none was made: 0, or the sum of the addresses alone,
    which the network card that the capture stands before was to complete.
    """
    stated = int.from_bytes(data[6:8], "big")
    if stated == 0:
        return True
    # a number is, modulo 65,535, the sum of its 16-bit digits: that is the sum in ones' complement
    pseudo = int.from_bytes(addresses, "big") + UDP + len(data)
    whole = pseudo + int.from_bytes(data + bytes(len(data) & 1), "big")
    return whole % 0xFFFF == 0 or stated % 0xFFFF == pseudo % 0xFFFF
