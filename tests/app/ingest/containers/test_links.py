"""Link layers: VLAN tags and other headers before IP."""

from pathlib import Path

import pytest

from tests.support.capture_files import T0, ipv4, ipv6, pcap, read

(PACKET,) = ipv4(b"video")
TAG, TWO = b"\x81\x00\x00\x64", b"\x88\xa8\x00\x07\x81\x00\x00\x64"
IP, IP6 = b"\x08\x00", b"\x86\xdd"


def cooked(kind: bytes) -> bytes:
    return bytes(14) + kind


def cooked_2(kind: bytes) -> bytes:
    return kind[:2] + bytes(18) + kind[2:]


def ethernet(kind: bytes) -> bytes:
    return bytes(12) + kind


@pytest.mark.parametrize(("link", "header"), [(1, ethernet), (113, cooked), (276, cooked_2)])
@pytest.mark.parametrize("tags", [b"", TAG, TWO, TWO + TAG, b"\x92\x00\x00\x01"])
def test_tags_are_passed_over_in_every_link_layer(tmp_path: Path, link: int, header, tags: bytes) -> None:  # type: ignore[no-untyped-def]
    frames = [(T0, header(tags + IP) + PACKET), (T0, header(tags + IP6) + ipv6(b"video"))]
    found, counted, _ = read(tmp_path / "a", pcap(frames, link))
    assert [one.payload for one in found] == [b"video"] * 2
    assert counted == {"packets": 2}


def test_frames_of_ieee_802_2_with_an_ethertype(tmp_path: Path) -> None:
    inside = bytes.fromhex("aaaa03000000") + IP + PACKET
    frame = ethernet(len(inside).to_bytes(2, "big")) + inside
    found, _, _ = read(tmp_path / "a", pcap([(T0, frame), (T0, frame[:20] + b"\x08\x06" + frame[22:])]))
    assert [one.payload for one in found] == [b"video"]


def test_tags_that_end_the_frame_hold_nothing(tmp_path: Path) -> None:
    frames = [(T0, ethernet(TAG)), (T0, ethernet(TAG[:3])), (T0, ethernet(TAG + IP)), (T0, b""), (T0, b"\0")]
    assert read(tmp_path / "a", pcap(frames))[1] == {"packets": 5, "not_udp": 5}


@pytest.mark.parametrize(("link", "name"), [(105, "105 (IEEE 802.11) not read"), (4711, "4711 not read")])
def test_link_types_that_are_not_read_are_counted_by_number(tmp_path: Path, link: int, name: str) -> None:
    _, counted, met = read(tmp_path / "a", pcap([(T0, bytes(40))] * 3, link))
    assert counted == {"packets": 3, f"unknown_link_{link}": 3}
    assert str(met) == f"packets of link type {name}: 3"
