"""Cell averaging against its text, its calibration, its twin and scipy."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.stats import binom

from pipeline.contracts.detect import Detector
from pipeline.detect.ca import CellAveraging
from pipeline.detect.calibration import mean_offsets_db, power_mean_offsets_db
from pipeline.detect.window import window_of
from pipeline.parts import PartError, build
from pipeline.tables import VideoFormat
from tests.pipeline.contracts.detect import DetectorContract
from tests.pipeline.detect.naive_detect import cell_averaging_limit, window_cells
from tests.support.video_scenes import busy_video, false_alarm_share, rayleigh, strip


class TestCellAveragingKeepsTheContract(DetectorContract):
    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "ca", setting)
        return part


class TestCellAveragingOfPowersOverSweepsKeepsTheContract(DetectorContract):
    flooding: ClassVar[dict[str, Any]] = {"pfa": 1e-2}

    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "ca", {"domain": "power", "sweeps": 5, "guard_sweeps": 3, **setting})
        return part


@pytest.mark.parametrize("domain", ["log", "power"])
@pytest.mark.parametrize(("sweeps", "guard_sweeps", "guard"), [(0, 2, 2), (4, 2, 1), (3, 3, 0), (2, 0, 2)])
def test_equal_to_the_obvious_twin(domain: Any, sweeps: int, guard_sweeps: int, guard: int) -> None:
    """Missing sweeps, the seam at north and both ends of the sweep included."""
    video = VideoFormat(azimuths=17, ranges=40, range_step_m=6.0, beamwidth_rad=0.5)
    part = CellAveraging(pfa=1e-2, domain=domain, side=6, guard=guard, sweeps=sweeps, guard_sweeps=guard_sweeps)
    frames = busy_video(video, 3)
    keep = np.random.default_rng(2).random((3, 17)) >= 0.15
    state = part.start(video)
    limits = np.full(frames.shape, -1)
    for block, kept in zip(strip(frames, video, keep), keep, strict=True):
        limits[block.scan, kept] = part.thresholds(block, state)
        part(block, state)
    share = video.azimuth_step_rad / video.beamwidth_rad
    for scan, row, j, inside in window_cells(window_of(part), frames, keep):
        rows = 1 + sum(
            back <= scan * 17 + row and bool(keep.ravel()[scan * 17 + row - back]) for back in range(1, sweeps + 1)
        )
        independent = max(int(len(inside) * max(1 / rows, share) + 1e-9), 1)
        wanted = cell_averaging_limit(part, inside, independent, video.db_per_step)
        assert limits[scan, row, j] == wanted, (scan, row, j)


def test_the_mean_in_range_is_scipys() -> None:
    part = CellAveraging(side=16, guard=2)
    video = VideoFormat(azimuths=64, ranges=400)
    frame = rayleigh(np.random.default_rng(4), (64, 400), 25.0)
    outer = uniform_filter1d(frame.astype(float), 37, axis=1) * 37
    inner = uniform_filter1d(frame.astype(float), 5, axis=1) * 5
    level = (outer - inner) / 32
    above = mean_offsets_db(1e-6, 0.3125, 32)[32] / 0.3125
    wanted = np.minimum(np.floor(level + above + 0.5 + 1e-9), 255)
    limits = part.thresholds(strip(frame[None], video)[0], part.start(video))
    np.testing.assert_array_equal(limits[:, 18:-18], wanted[:, 18:-18])


def test_offsets_of_the_texts() -> None:
    assert mean_offsets_db(1e-6, 0.3125, 32)[32] == pytest.approx(15.21, abs=0.02)
    fine = power_mean_offsets_db(1e-6, 1e-6, 32)[32]
    assert fine == pytest.approx(10 * np.log10(32 * (1e6 ** (1 / 32) - 1)), abs=1e-4)  # Rohling 1983


SETTINGS: list[dict[str, Any]] = [
    {"domain": "log"},
    {"domain": "power"},
    {"domain": "log", "sweeps": 4, "side": 8},
    {"domain": "power", "side": 4, "guard": 0},
]


@pytest.mark.parametrize("setting", SETTINGS)
def test_false_alarms_are_what_was_asked_at_1e_4(setting: dict[str, Any]) -> None:
    video = VideoFormat(azimuths=512, ranges=512, beamwidth_rad=0.01)
    part = CellAveraging(pfa=1e-4, **setting)
    state = part.start(video)
    frames = rayleigh(np.random.default_rng(20), (10, 512, 512), 25.0)
    alarms = sum(int(np.bitwise_count(part(block, state).mask).sum()) for block in strip(frames, video))
    cells = 10 * 512 * 512
    assert binom.cdf(alarms, cells, 0.85e-4) > 0.001
    assert binom.sf(alarms, cells, 1.15e-4) > 0.001


@pytest.mark.parametrize("setting", SETTINGS[:3])
def test_false_alarms_are_what_was_asked_at_1e_6_given_the_thresholds(setting: dict[str, Any]) -> None:
    """Semi-analytic: limits as the detector sets them, the tail of the rounded Rayleigh amplitude exactly."""
    video = VideoFormat(azimuths=512, ranges=1024, beamwidth_rad=0.01)
    part = CellAveraging(**setting)
    state = part.start(video)
    frame = rayleigh(np.random.default_rng(21), (512, 1024), 25.0)
    limits = part.thresholds(strip(frame[None], video)[0], state)
    assert false_alarm_share(limits, np.full(1024, 25.0)) == pytest.approx(1e-6, rel=0.25)


def test_the_first_scan_detects_already() -> None:
    frame = rayleigh(np.random.default_rng(5), (1, 96, 300), 25.0)
    frame[0, 40:43, 100:102] = 200
    video = VideoFormat(azimuths=96, ranges=300)
    for part in (CellAveraging(), CellAveraging(sweeps=4)):
        found = part(strip(frame, video)[0], part.start(video)).cells(300)
        assert found[40:43, 100:102].all()
        assert found.sum() == 6


@pytest.mark.parametrize(
    "setting",
    [
        {"pfa": 0.6},
        {"pfa": 1e-320},
        {"domain": "amplitude"},
        {"side": 0},
        {"side": 10**9},
        {"guard": -1},
        {"guard": 10**20},
        {"sweeps": -1},
        {"sweeps": 1000, "guard_sweeps": 500},
        {"max_runs": 0},
        {"max_runs": 10**400},
    ],
)
def test_wrong_settings_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(PartError):
        build("detect", "ca", setting)
