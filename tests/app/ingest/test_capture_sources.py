"""Captures whose radar says things oddly: azimuths, sources, cells that change, and what is around the video."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.demo.pcap import PcapWriter
from app.ingest.recordings import RecordingError, open_recording
from pipeline.asterix.cat240 import encode_message

AZIMUTHS, RANGES, TURNS = 128, 40, 3
T0 = 1_700_000_000.0
FS = 20_013_846
"""Cells of 3 m."""

VIDEO = np.random.default_rng(4).integers(0, 256, (AZIMUTHS, RANGES), dtype=np.uint8)
WIDTH = 65536 // AZIMUTHS
Sent = tuple[float, bytes]


def sent(video: np.ndarray = VIDEO, turns: int = TURNS, **words: object) -> Iterator[Sent]:
    """Datagrams of some turns; what a word names is a number, or a function of the message's place."""
    for i in range(turns * AZIMUTHS):
        start = i * WIDTH % 65536
        usual = {"message": i, "start": start, "end": (start + WIDTH) % 65536, "cell_duration": FS, "sac": 3, "sic": 4}
        said = usual | {name: one(i) if callable(one) else one for name, one in words.items()}
        time = T0 + i / AZIMUTHS
        cells = video[i % AZIMUTHS]
        yield time, encode_message(cells.tobytes(), len(cells), time=round(time % 86400 * 128), **said)  # type: ignore[arg-type]


def capture(path: Path, datagrams: Iterator[Sent] | list[Sent]) -> Path:
    with PcapWriter(path.open("wb")) as pcap:
        for time, datagram in datagrams:
            pcap.write(time, datagram)
    return path


def video_of(path: Path, **words: object) -> np.ndarray:
    recording = open_recording(path, **words)  # type: ignore[arg-type]
    assert recording.site.video.period_s == pytest.approx(1.0, abs=0.02)
    blocks = list(recording.blocks())
    return np.concatenate([one.amplitude for one in blocks])


def test_the_end_azimuth_decides_nothing(tmp_path: Path) -> None:
    ends: list[int | Callable[[int], int]] = [0, 77, lambda i: (i * WIDTH + 1741) % 65536, lambda i: i * WIDTH % 65536]
    for k, end in enumerate(ends):
        path = capture(tmp_path / f"{k}.pcap", sent(end=end))
        assert open_recording(path).site.video.azimuths == AZIMUTHS
        assert np.array_equal(video_of(path), np.tile(VIDEO, (TURNS, 1)))


def test_numbers_that_begin_anew_and_octets_around_the_video_lose_nothing(tmp_path: Path) -> None:
    other = b"\x22\0\x07\xc0\x01\x01\x02"
    around = [(t, (other if i % 3 else b"") + one + b"\xa5" * (i % 5)) for i, (t, one) in enumerate(sent())]
    for k, datagrams in enumerate((around, list(sent(message=lambda i: i % AZIMUTHS)))):
        recording = open_recording(capture(tmp_path / f"{k}.pcap", datagrams))
        blocks = list(recording.blocks())
        assert np.array_equal(np.concatenate([one.amplitude for one in blocks]), np.tile(VIDEO, (TURNS, 1)))
        assert recording.counters["lost"] == recording.counters["duplicate"] == 0
    assert open_recording(tmp_path / "0.pcap").source == (3, 4)


def two_sources(path: Path) -> Path:
    first, second = sent(), sent(video=VIDEO[:, ::-1], sic=9, message=lambda i: 7000 + i)
    return capture(path, [one for pair in zip(first, second, strict=True) for one in pair])


def test_of_two_sources_one_has_to_be_chosen(tmp_path: Path) -> None:
    path = two_sources(tmp_path / "a.pcap")
    for words in ({}, {"sac": 3}, {"sic": 5}):
        with pytest.raises(RecordingError, match=r"SAC 3 SIC 4 \(384 messages\), SAC 3 SIC 9 \(384 messages\)"):
            open_recording(path, **words)  # type: ignore[arg-type]
    assert np.array_equal(video_of(path, sic=4), np.tile(VIDEO, (TURNS, 1)))
    assert np.array_equal(video_of(path, sac=3, sic=9), np.tile(VIDEO[:, ::-1], (TURNS, 1)))
    assert open_recording(path, sic=9).source == (3, 9)


def test_a_source_that_is_not_there_is_answered_with_those_that_are(tmp_path: Path) -> None:
    path = capture(tmp_path / "a.pcap", sent())
    with pytest.raises(RecordingError, match=r"1 source in it: SAC 3 SIC 4 .* --sac 3 --sic 4"):
        open_recording(path, sac=8)


@pytest.mark.parametrize("often", [0.3, 0.5, 0.8])
def test_of_changing_cells_the_most_frequent_are_taken_and_the_others_told(tmp_path: Path, often: float) -> None:
    change = round(often * TURNS * AZIMUTHS)
    path = capture(tmp_path / "a.pcap", sent(cell_duration=lambda i: FS if i < change else FS * 2))
    recording = open_recording(path)
    step = recording.site.video.range_step_m
    assert step == pytest.approx(3.0 if often >= 0.5 else 6.0, rel=1e-6)
    usual, other = (change, 384 - change) if often >= 0.5 else (384 - change, change)
    (note,) = recording.notes
    assert f"m in {usual} messages" in note
    assert f"m in {other} messages" in note
    assert "--resample" in note
    assert sum(map(len, recording.blocks())) == usual
    assert recording.counters["wrong_geometry"] == other
    whole = open_recording(path, resample=True)
    assert sum(map(len, whole.blocks())) == TURNS * AZIMUTHS
    assert whole.counters["wrong_geometry"] == 0


def run(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["replay", *map(str, words)], env={"COLUMNS": "400"})
    return done.exit_code, done.output


def test_the_command_asks_which_source_and_tells_of_other_cells(tmp_path: Path) -> None:
    path = two_sources(tmp_path / "a.pcap")
    status, told = run(path, "--headless")
    assert status == 2
    assert "SAC 3 SIC 4" in told
    assert "SAC 3 SIC 9" in told
    assert run(path, "--headless", "--sac", 3, "--sic", 9)[0] == 0
    changing = capture(tmp_path / "b.pcap", sent(cell_duration=lambda i: FS if i < 300 else 2 * FS))
    status, told = run(changing, "--headless")
    assert status == 0
    assert "cells of 3 m in 300 messages; 6 m in 84 messages are left out" in told
    assert "wrong_geometry 84" in told
    assert "wrong_geometry" not in run(changing, "--headless", "--resample")[1]
