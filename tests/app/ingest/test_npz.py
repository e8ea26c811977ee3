"""An .npz of turns as people make them: other numbers, other units, other shapes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.evaluate.recorded import recorded_video
from app.ingest.recordings import Recording, RecordingError, open_recording
from tests.support.sweeps import closed_turn

T0 = 1_700_000_000.0
VIDEO = np.random.default_rng(3).integers(0, 256, (3, 64, 40), dtype=np.uint8)
TIMES = T0 + np.array([0.0, 1.5, 3.0])


def opened(path: Path, **columns: Any) -> Recording:
    np.savez(path, **columns)
    return open_recording(path)


def cells(recording: Recording) -> np.ndarray:
    video = recording.site.video
    blocks = [one.amplitude for one in recording.blocks()]
    return np.concatenate(blocks).reshape(-1, video.azimuths, video.ranges)


@pytest.mark.parametrize(
    ("t", "note"),
    [
        (TIMES, ""), (np.rint(TIMES * 1e3).astype(np.int64), "t: times are in milliseconds"),
        (TIMES * 1e3, "milliseconds"),
        (np.rint(TIMES * 1e6).astype(np.int64), "microseconds"), (TIMES * 1e9, "nanoseconds"),
        ((TIMES * 1e3).astype("datetime64[ms]"), "dates of numpy"),
        ((TIMES * 1e9).astype("datetime64[ns]"), "dates of numpy"),
        (TIMES.astype(np.int64), ""),
    ],
)  # fmt: skip
def test_times_in_other_units_are_converted_and_told(tmp_path: Path, t: np.ndarray, note: str) -> None:
    recording = opened(tmp_path / "a.npz", scans=VIDEO, t=t)
    times = np.concatenate([one.time for one in recording.blocks()])
    whole = t.dtype == np.int64 and not note
    assert times[0] == pytest.approx(T0 + recording.site.video.period_s / 128, abs=0.05)
    assert times[128] == pytest.approx(T0 + 3, abs=0.05)
    assert recording.site.video.period_s == pytest.approx(1.5, abs=1e-3) or whole
    assert [note in one for one in recording.notes] == ([True] if note else [])
    assert recorded_video(tmp_path / "a.npz").time[0] == pytest.approx(T0, abs=1e-5)


@pytest.mark.parametrize("t", [np.array([0.0, 1500.0, 3000.0]), np.arange(3) * 1e-3, T0 + np.arange(3) * 1000])
def test_a_turn_that_no_radar_makes_is_refused(tmp_path: Path, t: np.ndarray) -> None:
    with pytest.raises(RecordingError, match=r"no radar turns once in .* must be in seconds"):
        opened(tmp_path / "a.npz", scans=VIDEO, t=t)


@pytest.mark.parametrize(
    ("scans", "note"),
    [
        (VIDEO.astype(np.uint16) * 257, "16 bits"), (VIDEO.astype(">u2") << 4, "12 bits"),
        (VIDEO / np.float32(255), "times 255"), (VIDEO.astype(np.float64), "0 to 255"), (VIDEO.astype(np.int64), ""),
    ],
)  # fmt: skip
def test_other_numbers_are_converted_and_told(tmp_path: Path, scans: np.ndarray, note: str) -> None:
    recording = opened(tmp_path / "a.npz", scans=scans, t=TIMES)
    assert np.array_equal(cells(recording), VIDEO)
    assert [note in one for one in recording.notes] == ([True] if note else [])


def test_two_dimensions_are_turns_one_below_the_other(tmp_path: Path) -> None:
    one = opened(tmp_path / "a.npz", scans=VIDEO[0], t=T0)
    assert np.array_equal(cells(one), VIDEO[:1])
    assert one.notes == ("scans has 2 dimensions: taken for 1 turn of 64 rows",)
    many = opened(tmp_path / "a.npz", scans=VIDEO.reshape(192, 40), t=TIMES)
    assert np.array_equal(cells(many), VIDEO)
    for t in (TIMES[:2], T0 + np.arange(192)):
        with pytest.raises(RecordingError, match=r"rows are not .* turns one below the other"):
            opened(tmp_path / "a.npz", scans=VIDEO.reshape(192, 40)[:-1], t=t)
    with pytest.raises(RecordingError, match="of 4 dimensions"):
        opened(tmp_path / "a.npz", scans=VIDEO[..., None], t=TIMES)


def test_a_transposed_turn_is_refused_until_it_is_said(tmp_path: Path) -> None:
    turns = np.stack([closed_turn(seed) for seed in range(3)])
    assert np.array_equal(cells(opened(tmp_path / "a.npz", scans=turns, t=TIMES)), turns)
    turned = np.ascontiguousarray(turns.transpose(0, 2, 1))
    with pytest.raises(RecordingError, match="transpose=1"):
        opened(tmp_path / "a.npz", scans=turned, t=TIMES)
    assert np.array_equal(cells(opened(tmp_path / "a.npz", scans=turned, t=TIMES, transpose=1)), turns)
    assert np.array_equal(cells(opened(tmp_path / "a.npz", scans=turned, t=TIMES, transpose=0)), turned)


def test_arrays_that_are_not_numbers_are_refused(tmp_path: Path) -> None:
    for columns in ({"t": TIMES, "bits": np.array([])}, {"t": TIMES, "transpose": "yes"}, {"t": np.zeros(0)}):
        with pytest.raises(RecordingError, match="of numbers"):
            opened(tmp_path / "a.npz", scans=VIDEO, **columns)
    with pytest.raises(RecordingError, match="Fortran"):
        opened(tmp_path / "a.npz", scans=np.asfortranarray(VIDEO), t=TIMES)
