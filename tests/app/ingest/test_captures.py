"""Captures as recordings: what is said of those that are not as they should be."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.ingest.recordings import RecordingError, open_recording
from tests.support.capture_files import ETHERNET, T0, block, interface, ipv4, pcap, section, video

VIDEO = video(3)
FRAMES = [(T0 + i / 64, ETHERNET + ipv4(one)[0]) for i, one in enumerate(VIDEO)]
SIMPLE = section() + interface()
for _, FRAME in FRAMES:
    SIMPLE += block(3, len(FRAME).to_bytes(4, "little") + FRAME)


def written(path: Path, octets: bytes) -> Path:
    path.write_bytes(octets)
    return path


@pytest.mark.parametrize(
    ("octets", "says"),
    [
        (pcap([(T0, bytes(60))] * 7, 105),
         r"no datagrams; unknown_link_105 7; packets of link type 105 \(IEEE 802.11\) not read: 7"),
        (pcap([(T0, b"")] * 3), r"no datagrams; not_udp 3; packets of link type 1 \(Ethernet\): 3"),
        (pcap([]), r"no CAT240 video in it \(no datagrams\)"),
        (pcap([(T0, ETHERNET + ipv4(b"hello")[0])] * 2), r"no datagram is video; wrong_category 2; .*of port 8600: 2"),
        (pcap([(t, one[:90]) for t, one in FRAMES]), r"no datagrams; damaged 192; packets of link type 1"),
    ],
)  # fmt: skip
def test_without_video_the_message_says_what_there_is(tmp_path: Path, octets: bytes, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        open_recording(written(tmp_path / "a.pcap", octets))


def test_a_port_without_datagrams_names_those_there_are(tmp_path: Path) -> None:
    says = re.escape(
        "no datagrams of port 8700; other_port 192; packets of link type 1 (Ethernet): 192; datagrams of port 8600"
    )
    with pytest.raises(RecordingError, match=says):
        open_recording(written(tmp_path / "a.pcap", pcap(FRAMES)), port=8700)


@pytest.mark.parametrize("octets", [b"".join(VIDEO), SIMPLE])
def test_files_without_times_take_those_of_the_messages_and_say_so(tmp_path: Path, octets: bytes) -> None:
    recording = open_recording(written(tmp_path / "a", octets), port=8600)
    times = [float(time) for one in recording.blocks() for time in one.time]
    assert len(times) == 192
    assert times[0] == pytest.approx(36_000, abs=0.02)
    assert times[-1] == pytest.approx(36_003, abs=0.02)
    assert recording.notes == ("no times in the file: those of the messages are taken, as of 1970-01-01",)
    assert open_recording(written(tmp_path / "b", pcap(FRAMES))).notes == ()


def test_the_command_prints_what_was_assumed(tmp_path: Path) -> None:
    path = written(tmp_path / "A[bold].CAT240", b"".join(VIDEO))
    result = CliRunner().invoke(app, ["replay", str(path), "--headless"])
    assert result.exit_code == 0, result.output
    assert "A[bold].CAT240:" in result.output.replace("\n", "")
    assert "as of 1970-01-01" in " ".join(result.output.split())
    assert "left out" not in result.output
