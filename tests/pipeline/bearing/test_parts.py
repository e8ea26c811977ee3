"""Every bearing estimator keeps the contract; what each promises besides."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2
from skimage.transform import hough_line

from pipeline.bearing.hough import Hough
from pipeline.bearing.hough_template import HoughTemplate
from pipeline.bearing.ml import MaximumLikelihood
from pipeline.bearing.moments import Moments
from pipeline.bearing.template import Template
from pipeline.contracts.bearing import BearingEstimator, Expected
from pipeline.kernels.echo import measured
from pipeline.kernels.hough import hough, peaks
from pipeline.kernels.planform import Planform, templates
from pipeline.kernels.scan_convert import grid_of
from pipeline.parts import PartError, build
from tests.pipeline.bearing import naive
from tests.pipeline.bearing.scene import SITE, VIDEO, axis_error, view
from tests.pipeline.contracts.bearing import BearingContract


class TestMoments(BearingContract):
    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "moments", setting)
        return part


class TestWeightedMoments(BearingContract):
    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "moments", {"weighted": True, **setting})
        return part


class TestHough(BearingContract):
    turns_deg = 1.0
    least = 15.0

    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "hough", setting)
        return part


class TestBinaryHough(BearingContract):
    turns_deg = 1.0
    least = 15.0

    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "hough", {"weighted": False, **setting})
        return part


class TestHoughTemplate(BearingContract):
    turns_deg = 2.4

    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "hough_template", setting)
        return part


class TestTemplate(BearingContract):
    turns_deg = 0.3
    least = 4.0

    def make(self, **setting: Any) -> BearingEstimator:
        few = {"types": ("B738", "AT72"), "distances_m": (500.0,)}
        part: BearingEstimator = build("bearing", "template", {**few, **setting})
        return part


class TestMaximumLikelihood(BearingContract):
    turns_deg = 0.1
    least = 4.0

    def make(self, **setting: Any) -> BearingEstimator:
        part: BearingEstimator = build("bearing", "ml", setting)
        return part

    @pytest.mark.parametrize(("sd_deg", "most"), [(None, 4.0), (5.0, 3.0)])
    def test_its_standard_deviation_is_honest(
        self, part: BearingEstimator, state: Any, sd_deg: float | None, most: float
    ) -> None:
        # seeds that no setting was chosen on; the band is that of a chi-square of half as many degrees, once more as
        # wide as errors of one shape and many ranges would need
        chance = np.random.default_rng(20_260)
        scaled, errors = [], []
        for k in range(120):
            heading, azimuth = chance.uniform(0, 2 * math.pi, 2)
            kind, range_m = ("B734", "A320", "E190", "A332")[k % 4], (250.0, 450.0, 800.0, 1200.0)[k // 4 % 4]
            expected = None
            if sd_deg is not None:
                expected = Expected(heading + chance.normal() * math.radians(sd_deg), math.radians(sd_deg))
            made = part(view(heading, kind=kind, range_m=range_m, azimuth=azimuth, seed=5000 + k), expected, state)
            if math.isnan(made.bearing):
                continue
            errors.append(axis_error(made.bearing, heading))
            scaled.append(errors[-1] / math.degrees(made.sd))
        assert len(errors) > 110
        assert float(np.sqrt(np.mean(np.square(errors)))) < most
        low, high = chi2.ppf([1e-4, 1 - 1e-4], 60) / 60
        assert low < float(np.mean(np.square(scaled))) < high

    def test_types_need_not_be_known(self, part: BearingEstimator, state: Any) -> None:
        for kind in ("AT72", "B77W"):
            made = part(view(2.0, kind=kind, seed=2), None, state)
            assert abs(axis_error(made.bearing, 2.0)) < 5
            assert made.type == ""

    def test_a_wrong_expectation_does_not_hold_against_a_clear_echo(self, part: BearingEstimator, state: Any) -> None:
        made = part(view(2.0, range_m=250.0, seed=2), Expected(2.0 + math.radians(60), math.radians(5)), state)
        assert math.isnan(made.bearing) or abs(axis_error(made.bearing, 2.0)) < 5 or made.sd > math.radians(5)


def test_the_best_template_tells_the_type() -> None:
    part = Template(types=("AT72", "A320", "A332"), distances_m=(500.0,))
    state = part.start(SITE)
    for kind in part.types:
        assert part(view(0.4, kind=kind, seed=6, range_m=450.0), None, state).type == kind


def test_h_c_looks_at_the_paper_s_number_of_templates() -> None:
    part = HoughTemplate()
    assert 10 <= part.peaks * len(part.offsets_deg) * 2 <= 20


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("ml", {"angles": 100}, "multiple"), ("ml", {"sizes": ()}, "sizes"), ("ml", {"outliers": 1.0}, "outliers"),
        ("ml", {"sweep_deg": 90.0}, "sweep"), ("ml", {"floor_deg": 0.0}, "floor"), ("hough", {"angles": 4}, "angles"),
        ("hough", {"line_m": -1.0}, "line_m"), ("moments", {"floor_deg": 0.0}, "floor_deg"),
        ("template", {"types": ("CAR",)}, "CAR"), ("template", {"distances_m": ()}, "distances"),
        ("template", {"sharpness": 0.0}, "sharpness"), ("hough_template", {"peaks": 0}, "peaks"),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(name: str, wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(PartError, match=said):
        build("bearing", name, wrong)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), angles=st.sampled_from([12, 45, 180]), width=st.sampled_from([1.0, 2.0, 3.0]))
def test_hough_is_its_slow_twin_s(seed: int, angles: int, width: float) -> None:
    chance = np.random.default_rng(seed)
    weights = np.where(chance.random((9, 13)) < 0.2, chance.random((9, 13)), 0).astype(np.float32)
    np.testing.assert_allclose(hough(weights, angles, width), naive.hough(weights, angles, width), atol=1e-4)


def test_hough_is_scikit_image_s() -> None:
    picture = np.random.default_rng(4).random((40, 50)) < 0.1
    theta = np.pi * np.arange(180) / 180
    wanted, _, distances = hough_line(picture, theta=theta)
    made = hough(picture.astype(np.float32), 180, 1.0)
    middle = made.shape[1] // 2
    np.testing.assert_array_equal(made[:, middle + distances.astype(int)].T, wanted)


def test_peaks_of_a_cross_are_its_two_lines() -> None:
    weights = np.zeros((41, 41), np.float32)
    weights[20, :] = 1
    weights[:, 20] = 2
    (first, full), (second, half) = peaks(hough(weights, 180, 1.0), 2, math.radians(20))
    assert abs(axis_error(first, 0.0)) < 1
    assert abs(axis_error(second, math.pi / 2)) < 1
    assert full == 82
    assert half == 42


@pytest.mark.parametrize("weighted", [False, True])
def test_moments_are_opencv_s(weighted: bool) -> None:
    one = view(0.9, range_m=700.0, seed=8)
    step = VIDEO.db_per_step
    echo = measured(
        one.amplitude, one.plot, grid_of(SITE, one.azimuth, one.range_m), 0.0, 12.0, step, weighted=weighted
    )
    assert echo is not None
    east, north, above = naive.cells_of(one, SITE, 12.0)
    # a fine raster of the cells' places is what OpenCV takes
    raster = np.zeros((1200, 1200), np.float32)
    steps = 0.1
    column, row = ((east - echo.east) / steps + 600).round(), ((north - echo.north) / steps + 600).round()
    np.add.at(raster, (row.astype(int), column.astype(int)), above if weighted else 1.0)
    wanted = cv2.moments(raster)
    mass = wanted["m00"]
    assert echo.cells == len(east)
    assert wanted["m10"] / mass == pytest.approx(600, abs=0.6)
    assert wanted["m01"] / mass == pytest.approx(600, abs=0.6)
    for mine, theirs in ((echo.cxx, "mu20"), (echo.cxy, "mu11"), (echo.cyy, "mu02")):
        assert mine == pytest.approx(wanted[theirs] / mass * steps**2, rel=0.01, abs=0.3)


def test_the_beam_s_width_is_taken_out_of_the_moments() -> None:
    one = view(0.9, range_m=1200.0, seed=8)
    grid = grid_of(SITE, one.azimuth, one.range_m)
    wide = measured(one.amplitude, one.plot, grid, VIDEO.beamwidth_rad, 12.0, VIDEO.db_per_step)
    point = measured(one.amplitude, one.plot, grid, 0.0, 12.0, VIDEO.db_per_step)
    assert wide is not None
    assert point is not None
    cross = wide.range_m * VIDEO.beamwidth_rad
    grid_step = wide.range_m * VIDEO.azimuth_step_rad
    assert point.cxx + point.cyy - wide.cxx - wide.cyy == pytest.approx((cross**2 - grid_step**2) / 12, rel=1e-6)


def test_templates_are_of_norm_one_and_turn_with_the_heading() -> None:
    made = templates(Planform(38, 32, 4, 0.44), 36, 32, 1.5, 3.0, (3.0, 6.0), 18.0)
    assert made.shape == (2, 36, 32, 32)
    np.testing.assert_allclose(np.square(made).sum(axis=(2, 3)), 1.0, atol=1e-4)
    # with one resolution both ways, a quarter turn of the heading is a quarter turn of the picture
    for k in range(36):
        np.testing.assert_allclose(made[0, (k + 9) % 36], np.rot90(made[0, k], -1), atol=2e-3)
        np.testing.assert_allclose(made[0, -k % 36], made[0, k][:, ::-1], atol=2e-3)
    nose = np.nonzero(made[0, 0].sum(axis=1))[0]
    wings = made[0, 0].sum(axis=1).argmax()
    assert nose[0] < wings < nose[-1]


def test_a_weak_echo_is_less_sure_than_a_strong_one() -> None:
    part = MaximumLikelihood()
    state = part.start(SITE)
    near = [part(view(1.0, range_m=300.0, seed=k), None, state).sd for k in range(5)]
    far = [part(view(1.0, range_m=1400.0, seed=k), None, state).sd for k in range(5)]
    assert max(near) < min(far)


def test_parts_are_what_their_files_are_called() -> None:
    for name, kind in {"moments": Moments, "hough": Hough, "ml": MaximumLikelihood, "template": Template}.items():
        assert isinstance(build("bearing", name), kind)


def test_a_taxiway_between_grass_is_not_seen_as_a_wing() -> None:
    # the cells beside a strip are 8 dB brighter: ground, not echo
    part = MaximumLikelihood()
    state = part.start(SITE)
    chance = np.random.default_rng(5)
    for seed in range(4):
        one = view(1.0 + seed, range_m=550.0, seed=seed, snr_db=25.0)
        grass = np.zeros(one.amplitude.shape)
        grass[:, : one.plot[2] + 3] = grass[:, one.plot[2] + one.plot[3] - 3 :] = 8.0
        power = 60 + (grass + 10 * np.log10(chance.exponential(size=grass.shape)) + 2.51) / VIDEO.db_per_step
        mixed = np.where(grass > 0, np.maximum(one.amplitude, power), one.amplitude)
        made = part(replace(one, amplitude=np.clip(mixed, 0, 255).astype(np.uint8)), None, state)
        assert abs(axis_error(made.bearing, 1.0 + seed)) < 6
