"""Bare files of ASTERIX blocks: recognised by their octets, read to their end."""

import math
from pathlib import Path

import pytest

from app.ingest.containers.blocks import LOOKED_AT, is_blocks
from app.ingest.containers.packets import CaptureError
from tests.support.capture_files import read, video

VIDEO = video(1)
OTHER = b"\x22\x00\x07\xc0\x01\x01\x02"
"""A block of category 34."""


def test_blocks_come_back_without_time_and_port(tmp_path: Path) -> None:
    found, counted, met = read(tmp_path / "a", b"".join(VIDEO))
    assert [one.payload for one in found] == VIDEO
    assert all(math.isnan(one.time) and one.port is None for one in found)
    assert counted == {"blocks": len(VIDEO)}
    assert str(met) == ""


def test_other_categories_come_along_wherever_they_stand(tmp_path: Path) -> None:
    stream = [OTHER, *VIDEO[:5], OTHER, OTHER, *VIDEO[5:], OTHER]
    assert [one.payload for one in read(tmp_path / "a", b"".join(stream))[0]] == stream


def test_padding_between_and_behind_blocks_is_counted(tmp_path: Path) -> None:
    for pad in (1, 2, 3, 4, 13, 1000):
        found, counted, _ = read(tmp_path / "a", b"".join(one + bytes(pad) for one in VIDEO))
        assert [one.payload for one in found] == VIDEO
        assert counted == {"blocks": len(VIDEO), "trailing": pad * len(VIDEO)}


def test_behind_damage_the_next_block_of_video_is_found(tmp_path: Path) -> None:
    stream = [*VIDEO[:10], b"\xff\0\1junk, \xf0 and \xf0\0\2", *VIDEO[10:20], VIDEO[20][9:], *VIDEO[21:]]
    found, counted, _ = read(tmp_path / "a", b"".join(stream))
    assert [one.payload for one in found] == [*VIDEO[:20], *VIDEO[21:]]
    assert counted == {"blocks": len(VIDEO) - 1, "damaged": 2, "trailing": 2}


@pytest.mark.parametrize("cut", [1, 2, 3, 4, 20])
def test_a_file_that_ends_inside_a_block(tmp_path: Path, cut: int) -> None:
    octets = b"".join(VIDEO)
    for size in (len(octets) - cut, len(octets) + min(cut, 3)):
        found, counted, _ = read(tmp_path / "a", (octets + VIDEO[0])[:size])
        assert len(found) == size // len(VIDEO[0])
        assert counted["cut_off"] == 1


@pytest.mark.parametrize(
    "octets",
    [
        b"", b"\xf0", b"\xf0\0\4\0", bytes(1000), b"hello, world" * 1000, b"\xf0" * 5000, OTHER * 1000,
        b"# a text\n" * 99, bytes(range(256)) * 40, b"\x89PNG\r\n\x1a\n" + bytes(500), VIDEO[0][:-1],
        b"\xf0\0\x08\x40" + bytes(4),
    ],
)  # fmt: skip
def test_what_is_no_radar_video_is_refused_with_its_first_octets(tmp_path: Path, octets: bytes) -> None:
    says = octets[:4].hex(" ") if octets else "it is empty"
    with pytest.raises(CaptureError, match=f"neither .npz, pcap, pcapng nor ASTERIX .*{says}"):
        read(tmp_path / "a", octets)


def test_a_long_file_is_recognised_by_its_beginning() -> None:
    octets = b"".join(VIDEO) * (LOOKED_AT // len(b"".join(VIDEO)) + 1)
    assert is_blocks(octets[:LOOKED_AT])
    assert is_blocks(b"".join(VIDEO[:8]) + b"\xff" * 50)
    assert not is_blocks(b"".join(VIDEO[:1]) + b"\xff\0\1" * 50)
