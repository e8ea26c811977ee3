"""pcapng: its kinds of blocks, and what its options say."""

import math
import struct
from pathlib import Path

import pytest

from app.ingest.containers.packets import MAX_PACKET, CaptureError
from tests.support.capture_files import ETHERNET, T0, block, enhanced, interface, ipv4, read, section

ORDERS = pytest.mark.parametrize("order", ["<", ">"])
FRAME = ETHERNET + ipv4(b"video")[0]


@ORDERS
def test_simple_packet_blocks_are_read_and_have_no_time(tmp_path: Path, order: str) -> None:
    octets = section(order) + interface(order=order)
    octets += block(3, struct.pack(order + "I", len(FRAME)) + FRAME, order) * 2
    found, counted, _ = read(tmp_path / "a", octets)
    assert [one.payload for one in found] == [b"video"] * 2
    assert all(math.isnan(one.time) for one in found)
    assert counted == {"packets": 2}


def test_a_simple_packet_block_holds_no_more_than_its_interface_keeps(tmp_path: Path) -> None:
    for kept, there, name in (
        (len(FRAME), len(FRAME), ""),
        (0, len(FRAME), ""),
        (40, 40, "snapped"),
        (0, 40, "snapped"),
    ):
        octets = section() + interface(kept=kept) + block(3, struct.pack("<I", len(FRAME) + 99) + FRAME[:there])
        found, counted, _ = read(tmp_path / "a", octets)
        assert len(found) == (not name)
        assert counted == {"packets": 1} | ({name: 1} if name else {})


@ORDERS
def test_obsolete_packet_blocks_are_read(tmp_path: Path, order: str) -> None:
    ticks = round(T0 * 1e6) + 500_000
    head = struct.pack(order + "HHIIII", 0, 9, ticks >> 32, ticks & 0xFFFFFFFF, len(FRAME), len(FRAME))
    found, counted, _ = read(tmp_path / "a", section(order) + interface(order=order) + block(2, head + FRAME, order))
    assert [(one.payload, one.time) for one in found] == [(b"video", pytest.approx(T0 + 0.5, abs=1e-6))]
    assert counted == {"packets": 1}


@ORDERS
@pytest.mark.parametrize("offset", [0, 3600, -7200, 1_600_000_000])
@pytest.mark.parametrize(("resolution", "unit"), [(b"", 1e-6), (b"\x09", 1e-9), (b"\x03", 1e-3), (b"\x94", 2**-20)])
def test_resolution_and_offset_of_times(
    tmp_path: Path, order: str, offset: int, resolution: bytes, unit: float
) -> None:
    options = (*([(9, resolution)] if resolution else []), (2, b"eth0"), (14, struct.pack(order + "q", offset)))
    octets = section(order) + interface(order=order, options=options)
    octets += enhanced(T0 + 0.125 - offset, FRAME, order, unit=unit)
    ((time, _, _),), _, _ = read(tmp_path / "a", octets)
    assert time == pytest.approx(T0 + 0.125, abs=2e-6)


def test_every_interface_has_its_own_link_type_and_times(tmp_path: Path) -> None:
    octets = section() + interface(1) + interface(101, options=((14, struct.pack("<q", 10)),))
    octets += enhanced(T0, FRAME) + enhanced(T0, FRAME[14:], number=1)
    octets += section(">") + interface(228, ">") + enhanced(T0 + 1, FRAME[14:], ">")
    found, counted, met = read(tmp_path / "a", octets)
    assert [one.time for one in found] == [T0, T0 + 10, T0 + 1]
    assert met.links == {1: 1, 101: 1, 228: 1}
    assert counted == {"packets": 3}


@pytest.mark.parametrize("octets", [1, 4, 16, 32])
def test_the_length_of_the_frame_check_sequence_is_in_bits_or_octets(tmp_path: Path, octets: int) -> None:
    size = octets if octets < 16 else octets // 8
    unfilled = FRAME[:16] + b"\0\0" + FRAME[18:38] + b"\0\0" + FRAME[40:]  # no lengths of IP and UDP
    file = section() + interface(options=((13, bytes([octets])),)) + enhanced(T0, unfilled + bytes(size))
    found, _, _ = read(tmp_path / "a", file)
    assert [one.payload for one in found] == [b"video"]


@ORDERS
@pytest.mark.parametrize("kind", [4, 10, 0x0BAD, 0x80000001])
def test_blocks_of_megabytes_are_passed_over(tmp_path: Path, order: str, kind: int) -> None:
    large = block(kind, b"\x06" * (3 << 20), order)
    octets = section(order) + large + interface(order=order) + large + enhanced(T0, FRAME, order)
    found, counted, _ = read(tmp_path / "a", octets + large)
    assert [one.payload for one in found] == [b"video"]
    assert counted == {"packets": 1}
    _, counted, _ = read(tmp_path / "a", octets + large[: 2 << 20])
    assert counted == {"packets": 1, "cut_off": 1}


def test_a_packet_whose_comments_are_long_is_taken_and_one_that_is_long_is_not(tmp_path: Path) -> None:
    octets = section() + interface()
    head = struct.pack("<IIIII", 0, 0, 0, len(FRAME), len(FRAME))
    octets += block(6, head + FRAME + bytes(2 << 20)) + enhanced(T0, bytes(MAX_PACKET)) + enhanced(T0, FRAME)
    found, counted, _ = read(tmp_path / "a", octets)
    assert [one.time for one in found] == [0.0, T0]
    assert counted == {"packets": 2, "oversized": 1}


def test_blocks_that_do_not_fit_are_counted(tmp_path: Path) -> None:
    octets = section() + block(3, struct.pack("<I", len(FRAME)) + FRAME)  # before any interface
    octets += interface() + enhanced(T0, FRAME, number=1) + block(6, bytes(8)) + block(6, b"")
    octets += block(6, struct.pack("<IIIII", 0, 0, 0, 5000, 5000) + FRAME)
    octets += interface(options=((14, struct.pack("<q", 1 << 62)),)) + enhanced(T0, FRAME, number=1)
    found, counted, _ = read(tmp_path / "a", octets + enhanced(T0, FRAME))
    assert len(found) == 1
    assert counted == {"packets": 1, "damaged": 6}


@pytest.mark.parametrize("size", [0, 8, 13, 0x10000000])
def test_a_broken_chain_of_blocks_is_damage(tmp_path: Path, size: int) -> None:
    begin = section() + interface()
    with pytest.raises(CaptureError, match=f"damaged: a block of {size} octets at {len(begin)}"):
        read(tmp_path / "a", begin + struct.pack("<II", 6, size) + bytes(64))
