"""IP and UDP: lengths that were not filled in, checksums, headers of IPv6."""

import struct
from pathlib import Path

import pytest

from tests.support.capture_files import ADDRESSES, T0, ipv4, pcap, read, udp

PAYLOAD = b"radar video"


def ones_complement_sum(octets: bytes) -> int:
    """RFC 1071, the plain way."""
    total = 0
    for high, low in zip(octets[::2], (octets + b"\0")[1::2], strict=False):
        total += high << 8 | low
        total = (total & 0xFFFF) + (total >> 16)
    return total


def pseudo_header(payload: bytes, addresses: bytes = ADDRESSES) -> bytes:
    return addresses + struct.pack(">HH", 17, 8 + len(payload))


def checksum(payload: bytes, addresses: bytes = ADDRESSES) -> int:
    return ~ones_complement_sum(pseudo_header(payload, addresses) + udp(payload)) & 0xFFFF or 0xFFFF


def counted(path: Path, packets: list[bytes]) -> tuple[int, dict[str, int]]:
    found, counters, _ = read(path, pcap([(T0, one) for one in packets], 101))
    return len(found), {name: count for name, count in counters.items() if name not in ("packets", "fragments")}


@pytest.mark.parametrize("payload", [PAYLOAD, PAYLOAD + b"!", b"", bytes(1400), b"\xff" * 1400])
def test_a_checksum_that_holds_or_was_not_made_is_right(tmp_path: Path, payload: bytes) -> None:
    for value in (checksum(payload), 0):
        assert counted(tmp_path / "a", ipv4(payload, checksum=value)) == (1, {})


def test_a_checksum_that_the_card_was_to_complete_is_right(tmp_path: Path) -> None:
    packets = ipv4(PAYLOAD, checksum=ones_complement_sum(pseudo_header(PAYLOAD)))
    assert counted(tmp_path / "a", packets) == (1, {})


def test_a_datagram_with_a_wrong_checksum_is_dropped_and_counted(tmp_path: Path) -> None:
    (packet,) = ipv4(PAYLOAD, checksum=checksum(PAYLOAD))
    for at in range(20, len(packet)):
        damaged = bytearray(packet)
        damaged[at] ^= 0x40
        taken, why = counted(tmp_path / "a", [bytes(damaged), packet])
        assert (taken, sum(why.values())) == (1, 1)
        assert set(why) <= ({"damaged", "wrong_checksum"} if 24 <= at < 26 else {"wrong_checksum"})


def test_the_checksum_of_fragments_is_that_of_the_whole(tmp_path: Path) -> None:
    payload = bytes(range(250)) * 8
    pieces = ipv4(payload, cut=800, checksum=checksum(payload))
    assert counted(tmp_path / "a", pieces) == (1, {})
    assert counted(tmp_path / "a", [pieces[0], pieces[1][:-1] + b"\0", pieces[2]]) == (0, {"wrong_checksum": 1})


def test_the_checksum_over_ipv6(tmp_path: Path) -> None:
    addresses = bytes(range(100, 132))
    for value, expected in ((checksum(PAYLOAD, addresses), (1, {})), (1, (0, {"wrong_checksum": 1}))):
        data = udp(PAYLOAD, checksum=value)
        packet = struct.pack(">IHBB", 6 << 28, len(data), 17, 64) + addresses + data
        assert counted(tmp_path / "a", [packet]) == expected


def test_lengths_that_the_card_was_to_fill_in(tmp_path: Path) -> None:
    (packet,) = ipv4(PAYLOAD)
    no_total = packet[:2] + b"\0\0" + packet[4:]
    six = struct.pack(">IHBB", 6 << 28, 0, 17, 64) + bytes(32) + udp(PAYLOAD)
    for one in (no_total, no_total + bytes(9), no_total[:24] + b"\0\0" + no_total[26:], six, six + bytes(9)):
        assert counted(tmp_path / "a", [one]) == (1, {})


def test_headers_before_udp_in_ipv6(tmp_path: Path) -> None:
    authentication = b"\x11\x04" + bytes(22)
    options = b"\x33\x01" + bytes(14)
    for first, headers in (
        (51, authentication),
        (60, options + authentication),
        (0, b"\x3c\0" + bytes(6) + b"\x11\0" + bytes(6)),
    ):
        body = headers + udp(PAYLOAD)
        packet = struct.pack(">IHBB", 6 << 28, len(body), first, 64) + bytes(32) + body
        assert counted(tmp_path / "a", [packet]) == (1, {})
    assert counted(tmp_path / "a", [packet[:44]]) == (0, {"damaged": 1})


SIX = bytes(range(100, 132))
"""Source and destination of IPv6."""


def fragments6(payload: bytes, cut: int, identification: int = 7, before: bytes = b"", first: int = 44) -> list[bytes]:
    """The datagram in fragments of IPv6 (RFC 8200, 4.5). before: headers in front of theirs, of kind `first`."""
    data = udp(payload, checksum=checksum(payload, SIX))
    made = []
    for offset in range(0, len(data), cut):
        piece = data[offset : offset + cut]
        header = struct.pack(">BBHI", 17, 0, offset | (offset + cut < len(data)), identification)
        body = before + header + piece
        made.append(struct.pack(">IHBB", 6 << 28, len(body), first, 64) + SIX + body)
    return made


LONG = bytes(range(250)) * 8
OPTIONS = b"\x2c\0" + bytes(6)
"""A header of hop-by-hop options that a fragment header follows."""


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)], ids=str)
@pytest.mark.parametrize(("before", "first"), [(b"", 44), (OPTIONS, 0)], ids=["alone", "behind options"])
def test_fragments_of_ipv6_are_put_together(tmp_path: Path, order: tuple[int, ...], before: bytes, first: int) -> None:
    pieces = fragments6(LONG, 800, before=before, first=first)
    assert len(pieces) == 3
    found, counters, _ = read(tmp_path / "a", pcap([(T0, pieces[k]) for k in order], 101))
    assert [one.payload for one in found] == [LONG]
    assert dict(counters) == {"packets": 3, "fragments": 3}


def test_fragments_of_ipv6_that_belong_to_different_datagrams_are_never_joined(tmp_path: Path) -> None:
    one, other = fragments6(LONG, 800, 7), fragments6(LONG[::-1], 800, 8)
    assert counted(tmp_path / "a", [one[0], other[1], one[2]]) == (0, {"fragments_lost": 2})
    assert counted(tmp_path / "a", [one[0], other[0], one[1], other[1], other[2], one[2]]) == (2, {})
    elsewhere = [piece[:39] + b"\xff" + piece[40:] for piece in one]
    assert counted(tmp_path / "a", [one[0], elsewhere[1], one[2]]) == (0, {"fragments_lost": 2})


def test_fragments_of_ipv6_are_judged_as_a_whole(tmp_path: Path) -> None:
    pieces = fragments6(LONG, 800)
    assert counted(tmp_path / "a", [*pieces[:2], pieces[2][:-1] + b"\0"]) == (0, {"wrong_checksum": 1})
    assert counted(tmp_path / "a", [pieces[0][:46]]) == (0, {"damaged": 1})
    tcp = [piece[:40] + b"\x06" + piece[41:] for piece in pieces]
    assert counted(tmp_path / "a", tcp) == (0, {"not_udp": 3})


def test_lengths_that_do_not_fit_are_damage(tmp_path: Path) -> None:
    (packet,) = ipv4(PAYLOAD)
    for wrong in (
        packet[:-1],
        packet[:12],
        b"\x44" + packet[1:],
        packet[:24] + b"\0\x07" + packet[26:],
        packet[:2] + b"\0\x0a" + packet[4:],
    ):
        assert counted(tmp_path / "a", [wrong]) == (0, {"damaged": 1})
