"""What a file is, its octets say; what it holds is told when it is not video."""

import bz2
import gzip
import lzma
from pathlib import Path

import pytest

from app.ingest.containers.datagrams import Met, datagrams
from app.ingest.containers.packets import CaptureError
from tests.support.capture_files import ETHERNET, T0, ipv4, pcap, pcapng, read, video

VIDEO = video(2)
FRAMES = [(T0 + i, ETHERNET + ipv4(one)[0]) for i, one in enumerate(VIDEO)]
FORMS = {"pcap": pcap(FRAMES), "pcapng": pcapng(FRAMES), "blocks": b"".join(VIDEO)}
PACKED = {"plain": bytes, "gzip": gzip.compress, "bzip2": bz2.compress, "xz": lzma.compress}
NAMES = [
    "a.pcap.gz",
    "A.PCAP",
    "a.pcap0",
    "cap_00001_20241127165321.pcapng.1",
    "a.ast",
    "a.cat240",
    "a",
    "a.npz",
    "a.b c",
]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("packed", PACKED)
def test_every_form_is_recognised_under_any_name(tmp_path: Path, form: str, packed: str) -> None:
    for name in NAMES:
        found, counted, _ = read(tmp_path / name, PACKED[packed](FORMS[form]))
        assert [one.payload for one in found] == VIDEO
        assert counted == {("blocks" if form == "blocks" else "packets"): len(VIDEO)}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("packed", ["gzip", "bzip2", "xz"])
def test_a_compressed_file_that_ends_early_gives_what_is_there(tmp_path: Path, form: str, packed: str) -> None:
    octets = PACKED[packed](FORMS[form] * (8 if form == "blocks" else 1))
    found, counted, _ = read(tmp_path / "a", octets[:-5])
    assert counted["cut_off"] == 1
    assert [one.payload for one in found] == VIDEO[: len(found)] if form != "blocks" else found
    assert found or packed != "gzip"


def test_several_compressed_parts_in_a_row_are_one_file(tmp_path: Path) -> None:
    half = len(FORMS["pcap"]) // 2
    octets = gzip.compress(FORMS["pcap"][:half]) + gzip.compress(FORMS["pcap"][half:])
    assert len(read(tmp_path / "a", octets)[0]) == len(VIDEO)


@pytest.mark.parametrize("packed", ["gzip", "bzip2", "xz"])
def test_damage_inside_a_compressed_file_is_told(tmp_path: Path, packed: str) -> None:
    octets = bytearray(PACKED[packed](FORMS["pcap"]))
    octets[len(octets) // 2] ^= 0x55
    octets[len(octets) // 2 + 40] ^= 0x55
    with pytest.raises(CaptureError, match="damaged"):
        read(tmp_path / "a", bytes(octets))


@pytest.mark.parametrize(("magic", "name"), [(b"\x28\xb5\x2f\xfd", "zstd"), (b"\x04\x22\x4d\x18", "lz4")])
def test_what_is_compressed_otherwise_is_refused_by_name(tmp_path: Path, magic: bytes, name: str) -> None:
    with pytest.raises(CaptureError, match=f"compressed with {name}: unpack it first"):
        read(tmp_path / "a.pcap.x", magic + bytes(50))


def test_link_types_and_ports_that_were_met_are_told(tmp_path: Path) -> None:
    frames = [(T0, ETHERNET + ipv4(b"x", port=port)[0]) for port in (53, 8600, 8600)]
    assert str(read(tmp_path / "a", pcap(frames))[2]) == (
        "packets of link type 1 (Ethernet): 3; datagrams of port 8600: 2, 53: 1"
    )
    assert str(Met()) == ""


def test_fragments_that_are_left_are_counted_when_the_reader_stops_early(tmp_path: Path) -> None:
    from collections import Counter

    path = tmp_path / "a"
    path.write_bytes(pcap([(T0, ETHERNET + ipv4(bytes(999), cut=400)[0]), *FRAMES]))
    counters = Counter[str]()
    reading = datagrams(path, counters)
    next(reading)
    reading.close()
    assert counters["fragments_lost"] == 1
