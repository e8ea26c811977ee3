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
