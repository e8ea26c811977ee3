"""Recorded video: any bits, any grid, every detector; on a recording made here."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from pipeline.assemble.bit_depth import to_octets
from pipeline.lab.evaluate import RecordedVideo
from pipeline.lab.evaluate.cfar_cases import CASES, every_part
from pipeline.lab.evaluate.real_video import RealVideo, _overlapping, fixed_things, video_format

THINGS = ((10, 30), (40, 60), (70, 100))


def recording(bits: int, azimuths: int = 90, ranges: int = 130, turns: int = 6) -> RecordedVideo:
    """Noise, and three things that stand still."""
    rng = np.random.default_rng(bits)
    octets = np.clip(40 + 10 * np.log10(rng.exponential(size=(turns, azimuths, ranges))) / 0.3125, 0, 255)
    for row, cell in THINGS:
        octets[:, row : row + 4, cell : cell + 5] = 230 + rng.integers(0, 20, (turns, 4, 5))
    values = np.minimum(np.rint(octets * ((1 << bits) - 1) / 255), (1 << bits) - 1)
    kind = np.uint8 if bits <= 8 else np.uint16
    return RecordedVideo(values.astype(kind), 100.0 + 2.5 * np.arange(turns), bits)


def rows_of(experiment: RealVideo) -> dict[str, float]:
    results = [
        experiment.trial(np.random.default_rng(k), k, time.perf_counter)
        for k in range(len(experiment.detectors) * len(experiment.extractors))
    ]
    assert all(one.lines or one.pictures for one in experiment.figures(results))
    return {row.name: row.measured for row in experiment.rows(results)}


def test_every_detector_sees_what_stands_still_and_makes_no_flood() -> None:
    rows = rows_of(RealVideo(video=recording(8)))
    for case in every_part():
        # what stood there from the first turn on is clutter to a map of single cells
        seen = 0.0 if case.part == "clutter_map" else 100.0
        assert rows[f"{case.label}: fixed things of the recording seen"] == seen, case.label
        for extractor in ("manhattan", "hysteresis"):
            assert rows[f"{case.label}, {extractor}: plots a turn"] < 8
        assert rows[f"{case.label}: degraded turns of 20"] == 0
    for label in ("hybrid", "adaptive"):
        assert rows[f"{label}: of these, still seen after 15 turns"] == 100.0
        assert rows[f"{label}, manhattan: of these, found again within 15 m in the next turn"] > 95.0
        assert rows[f"{label}, manhattan: of these, overlapped by a plot of the next turn"] > 95.0


@pytest.mark.parametrize(("bits", "azimuths", "ranges"), [(1, 64, 130), (4, 100, 129), (6, 90, 1000), (12, 720, 140),
                                                          (16, 75, 110)])  # fmt: skip
def test_any_bits_and_any_grid(bits: int, azimuths: int, ranges: int) -> None:
    hybrid = tuple(case for case in CASES if case.label == "hybrid")
    rows = rows_of(RealVideo(video=recording(bits, max(azimuths, 75), ranges), detectors=hybrid))
    assert rows["hybrid: degraded turns of 20"] == 0
    if bits > 1:  # a single bit leaves nothing between noise and full scale
        assert rows["hybrid: fixed things of the recording seen"] == 100.0


def test_bits_keep_full_scale_and_order() -> None:
    for bits in range(1, 17):
        values = np.arange(1 << bits).astype(np.uint8 if bits <= 8 else np.uint16)
        octets = to_octets(values, bits)
        assert octets.dtype == np.uint8
        assert octets[0] == 0
        assert octets[-1] == 255
        assert (np.diff(octets.astype(int)) >= 0).all()
        if bits <= 8:
            assert len(np.unique(octets)) == len(values)
    np.testing.assert_array_equal(to_octets(np.arange(16, dtype=np.uint8), 4), np.arange(16) * 17)


def test_what_cannot_be_used_is_refused_with_words() -> None:
    for bits in (0, 17):
        with pytest.raises(ValueError, match="bits must be 1 to 16"):
            to_octets(np.zeros(3, np.uint8), bits)
    with pytest.raises(ValueError, match="more than 4 bits"):
        to_octets(np.array([16], np.uint8), 4)
    with pytest.raises(ValueError, match="unsigned"):
        to_octets(np.zeros(3), 8)
    with pytest.raises(ValueError, match="--file"):
        RealVideo().trial(np.random.default_rng(0), 0, time.perf_counter)
    with pytest.raises(ValueError, match="turns must"):
        RealVideo(turns=10)
    flat = replace(recording(8), scans=np.zeros((2, 90), np.uint8))
    with pytest.raises(ValueError, match="a recording is"):
        RealVideo(video=flat).trial(np.random.default_rng(0), 0, time.perf_counter)


def test_fixed_things_are_told_from_the_recording_alone() -> None:
    octets = recording(8).scans.astype(np.uint8)
    things, many = fixed_things(octets, 4)
    assert many == len(THINGS)
    for row, cell in THINGS:
        assert len(np.unique(things[row : row + 4, cell : cell + 5])) == 1
    assert np.count_nonzero(things) == 20 * len(THINGS)


def test_windows_overlap_across_north() -> None:
    these = np.array([[86.0, 6.0, 10.0, 5.0], [20.0, 2.0, 10.0, 5.0]])
    others = np.array([[0.0, 3.0, 14.0, 4.0], [20.0, 2.0, 15.0, 5.0]])
    assert _overlapping(these, others, 90).tolist() == [True, False]
    assert _overlapping(others, these, 90).tolist() == [True, False]


def test_the_grid_follows_the_recording() -> None:
    video = video_format(replace(recording(8), range_step_m=7.5, first_range_m=30.0))
    assert (video.azimuths, video.ranges, video.range_step_m, video.first_range_m) == (90, 130, 7.5, 30.0)
    assert video.period_s == pytest.approx(2.5)
    assert video.beamwidth_rad == pytest.approx(2 * np.pi / 90)
