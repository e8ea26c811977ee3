"""Scan conversion: north up, no seam at north, near ranges, any grid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from pipeline.kernels.scan_convert import grid_of, plot_images, scan_converted
from pipeline.sites import RadarSite
from pipeline.tables import Plots, VideoFormat
from tests.pipeline.bearing.naive import pixel
from tests.pipeline.bearing.scene import SITE, VIDEO


def turn(points: list[tuple[float, float]], site: RadarSite = SITE) -> np.ndarray:
    """A turn of video of level 10 with a bright cell at each (east, north)."""
    video = site.video
    frame = np.full((video.azimuths, video.ranges), 10, np.uint8)
    for east, north in points:
        row = int(math.atan2(east, north) / video.azimuth_step_rad // 1) % video.azimuths
        slant = math.hypot(math.hypot(east, north), site.height)
        frame[row, round((slant - video.first_range_m) / video.range_step_m)] = 250
    return frame


@pytest.mark.parametrize(("east", "north"), [(0, 400), (400, 0), (0, -400), (-400, 0), (-3, 400), (200, 330)])
def test_north_is_up_and_east_to_the_right(east: float, north: float) -> None:
    place = (east - 9.0, north - 15.0)
    image = scan_converted(turn([(east, north)]), grid_of(SITE), place, step=1.5, size=64)
    i, j = np.nonzero(image > 60)
    assert (31.5 - i.mean()) * 1.5 == pytest.approx(15.0, abs=2.0)
    assert (j.mean() - 31.5) * 1.5 == pytest.approx(9.0, abs=2.0)


def test_up_is_where_it_is_wanted() -> None:
    image = scan_converted(turn([(430, 0)]), grid_of(SITE), (400.0, 0.0), step=1.5, size=64, up=math.pi / 2)
    i, j = np.nonzero(image > 60)
    assert (31.5 - i.mean()) * 1.5 == pytest.approx(30.0, abs=2.0)
    assert j.mean() == pytest.approx(31.5, abs=1.5)


def test_there_is_no_seam_at_north() -> None:
    frame = np.random.default_rng(1).integers(0, 255, (VIDEO.azimuths, VIDEO.ranges)).astype(np.uint8)
    half = VIDEO.azimuths // 2
    north = scan_converted(frame, grid_of(SITE), (0.0, 300.0), step=1.5, size=48)
    south = scan_converted(np.roll(frame, half, axis=0), grid_of(SITE), (0.0, -300.0), step=1.5, size=48, up=math.pi)
    np.testing.assert_allclose(north, south, atol=0.05)
    assert north.min() > 0


def test_a_part_of_the_turn_gives_the_same_as_the_turn() -> None:
    frame = np.random.default_rng(2).integers(0, 255, (VIDEO.azimuths, VIDEO.ranges)).astype(np.uint8)
    rows, near = np.arange(-100, 100) % VIDEO.azimuths, 80
    part = frame[rows, near : near + 60]
    grid = grid_of(SITE, (rows[0] + 0.5) * VIDEO.azimuth_step_rad, near * VIDEO.range_step_m)
    whole = scan_converted(frame, grid_of(SITE), (5.0, 330.0), step=2.0, size=24)
    np.testing.assert_allclose(scan_converted(part, grid, (5.0, 330.0), step=2.0, size=24), whole, atol=0.05)


@settings(max_examples=30, deadline=None)
@given(
    azimuth=st.floats(0, 2 * math.pi), distance=st.floats(15, 900), height=st.sampled_from([0.0, 25.0]),
    step=st.floats(0.5, 8), azimuths=st.sampled_from([360, 1000, 4096]), seed=st.integers(0, 99),
)  # fmt: skip
def test_pixels_are_means_over_what_they_cover(
    azimuth: float, distance: float, height: float, step: float, azimuths: int, seed: int
) -> None:
    video = VideoFormat(azimuths=azimuths, ranges=400, first_range_m=3.0)
    site = RadarSite("r", 0.0, 0.0, height, video)
    frame = np.random.default_rng(seed).integers(0, 255, (azimuths, 400)).astype(np.uint8)
    east, north = distance * math.sin(azimuth), distance * math.cos(azimuth)
    made = scan_converted(frame, grid_of(site), (east, north), step=step, size=1)[0, 0]
    assert made == pytest.approx(pixel(frame, grid_of(site), east, north, step), abs=0.5)


def test_far_away_it_is_bilinear_interpolation() -> None:
    frame = np.random.default_rng(3).integers(0, 255, (VIDEO.azimuths, VIDEO.ranges)).astype(np.uint8)
    made = scan_converted(frame, grid_of(SITE), (1500.0, 1500.0), step=1.0, size=16)
    offset = np.arange(16) - 7.5
    east, north = np.meshgrid(1500 + offset, 1500 - offset)
    rows = np.arctan2(east, north) / VIDEO.azimuth_step_rad - 0.5
    wanted = map_coordinates(frame.astype(float), [rows, np.hypot(east, north) / 3.0], order=1)
    np.testing.assert_allclose(made, wanted, atol=0.1)


def test_outside_the_video_is_as_said() -> None:
    frame = np.full((VIDEO.azimuths, 50), 99, np.uint8)
    site = RadarSite("r", 0.0, 0.0, 0.0, VideoFormat(ranges=50))
    image = scan_converted(frame, grid_of(site), (0.0, 150.0), step=10.0, size=8, outside=-1.0)
    assert set(np.unique(image)) == {-1.0, 99.0}
    assert (scan_converted(frame[:0], grid_of(site), (0.0, 100.0), step=1.0, size=4, outside=7.0) == 7).all()
    with pytest.raises(ValueError, match="pixels"):
        scan_converted(frame, grid_of(site), (0.0, 100.0), step=1.0, size=0)
    with pytest.raises(ValueError, match="cannot be made"):
        scan_converted(frame, grid_of(site), (0.0, 100.0), step=0.0, size=4)


def test_over_the_radar_nothing_breaks() -> None:
    frame = np.full((VIDEO.azimuths, VIDEO.ranges), 77, np.uint8)
    for height in (0.0, 25.0):
        image = scan_converted(frame, grid_of(RadarSite("r", 0, 0, height, VIDEO)), (0.0, 0.0), step=1.5, size=33)
        np.testing.assert_allclose(image, 77.0, atol=1e-3)


def test_images_of_plots_lie_about_them() -> None:
    site = RadarSite("r", 1000.0, -500.0, 20.0, VIDEO)
    frame = turn([(0.0, 600.0), (-300.0, 250.0)], site)
    empty = Plots.empty()
    assert plot_images(empty, frame, site, step=1.5, size=32).shape == (0, 32, 32)
    plots = Plots.build(
        2, time=np.zeros(2), range=np.ones(2), azimuth=np.ones(2), east=np.array([1000.0, 700.0]),
        north=np.array([100.0, -250.0]), covariance=np.zeros((2, 2, 2)), range_extent=np.zeros(2),
        azimuth_extent=np.zeros(2), cells=np.ones(2), mean_amplitude=np.ones(2), peak_amplitude=np.ones(2),
    )  # fmt: skip
    for image in plot_images(plots, frame, site, step=1.5, size=32):
        i, j = np.nonzero(image > 60)
        assert image.dtype == np.uint8
        assert i.mean() == pytest.approx(15.5, abs=1.5)
        assert j.mean() == pytest.approx(15.5, abs=1.5)
