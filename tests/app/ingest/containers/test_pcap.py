"""pcap: every form of it, and what its fields say."""

import struct
from pathlib import Path

import pytest

from app.ingest.containers.packets import MAX_PACKET, CaptureError
from tests.support.capture_files import ETHERNET, T0, ipv4, pcap, read

(PACKET,) = ipv4(b"video")


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_form_with_longer_record_headers(tmp_path: Path, order: str) -> None:
    octets = struct.pack(order + "IHHiIII", 0xA1B2CD34, 2, 4, 0, 0, 65535, 1)
    for i in range(2):
        size = len(ETHERNET + PACKET)
        octets += struct.pack(order + "IIIIIHBB", int(T0) + i, 250_000, size, size, 3, 8, 0, 0) + ETHERNET + PACKET
    found, counted, _ = read(tmp_path / "a", octets)
    assert [one.payload for one in found] == [b"video"] * 2
    assert [one.time for one in found] == [T0 + 0.25, T0 + 1.25]
    assert counted == {"packets": 2}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("field", "fcs"), [(0x24000001, 4), (0x14000001, 2), (0x00000001, 0), (0x03FF0001, 0)])
def test_the_link_type_may_carry_the_length_of_the_frame_check_sequence(
    tmp_path: Path, order: str, field: int, fcs: int
) -> None:
    unfilled = PACKET[:2] + b"\0\0" + PACKET[4:]  # the length that the network card fills in: all that is there
    bare = unfilled[:24] + b"\0\0" + unfilled[26:]
    for packet in (PACKET, unfilled, bare):
        frame = ETHERNET + packet + b"\xde\xad\xbe\xef"[:fcs]
        found, counted, met = read(tmp_path / "a", pcap([(T0, frame)], field, order))
        assert [one.payload for one in found] == [b"video"]
        assert counted == {"packets": 1}
        assert met.links == {1: 1}


def test_a_packet_of_megabytes_is_passed_over(tmp_path: Path) -> None:
    frames = [(T0, ETHERNET + PACKET), (T0, bytes(MAX_PACKET * 9 + 5)), (T0 + 1, ETHERNET + PACKET)]
    found, counted, _ = read(tmp_path / "a", pcap(frames))
    assert [one.time for one in found] == [T0, T0 + 1]
    assert counted == {"packets": 2, "oversized": 1}
    found, counted, _ = read(tmp_path / "a", pcap(frames)[: MAX_PACKET * 7])
    assert len(found) == 1
    assert counted == {"packets": 1, "oversized": 1, "cut_off": 1}


def test_a_packet_that_nobody_writes_is_damage(tmp_path: Path) -> None:
    octets = pcap([(T0, ETHERNET + PACKET)])
    with pytest.raises(CaptureError, match=f"damaged: a packet of 4294967295 octets at {len(octets)}"):
        read(tmp_path / "a", octets + bytes(8) + b"\xff" * 8)


def test_what_was_captured_in_part_is_taken_when_the_datagram_is_whole(tmp_path: Path) -> None:
    """Cards that strip the frame check sequence count it in the length on the wire."""
    octets = pcap([(T0, ETHERNET + PACKET), (T0, (ETHERNET + PACKET)[:-2])])
    size = len(ETHERNET + PACKET)
    for length in (size, size - 2):
        octets = octets.replace(struct.pack("<II", length, length), struct.pack("<II", length, size + 4))
    found, counted, _ = read(tmp_path / "a", octets)
    assert [one.payload for one in found] == [b"video"]
    assert counted == {"packets": 2, "snapped": 1}
