"""Bearings of a chain's plots: which get one, from which video, and what tracks expect of them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from pipeline.bearing.ml import MaximumLikelihood
from pipeline.bearing.moments import Moments
from pipeline.bearing.of_plots import MOST_A_PART, Expectations, PlotBearings
from pipeline.chain import RadarChain
from pipeline.contracts.bearing import Bearing, Expected, TargetView
from pipeline.detect.hybrid import Hybrid
from pipeline.extract.manhattan import Manhattan
from pipeline.lab.simulate.closeup import CLOSEUP_TYPES, Posed, closeup
from pipeline.sites import RadarSite
from pipeline.tables import Plots, Sweeps, VideoFormat
from tests.pipeline.bearing.scene import axis_error
from tests.support.video_scenes import cut, rayleigh, strip

VIDEO = VideoFormat(azimuths=1024, ranges=256, beamwidth_rad=0.008)
SITE = RadarSite("smr", east=200.0, north=-100.0, height=0.0, video=VIDEO)
HEADINGS = {0.0: 0.6, 1.5: 2.0, 4.0: 1.1}
"""Azimuth of each aircraft and its heading; the first stands across north."""


class Spy:
    """Keeps what it was shown, and has no bearing."""

    def __init__(self) -> None:
        self.seen: list[tuple[TargetView, Expected | None]] = []

    def start(self, site: RadarSite) -> None:
        return None

    def __call__(self, view: TargetView, expected: Expected | None, state: Any) -> Bearing:
        self.seen.append((view, expected))
        return Bearing(math.nan, math.nan)


def frames(scans: int = 4, headings: dict[float, float] = HEADINGS) -> Any:
    chance = np.random.default_rng(12)
    made = rayleigh(chance, (scans, VIDEO.azimuths, VIDEO.ranges), 25.0)
    for scan in range(1, scans):
        for azimuth, heading in headings.items():
            posed = Posed.at(CLOSEUP_TYPES["A320"], 300.0, azimuth, heading)
            look = closeup(chance, [posed], 25.0, VIDEO, clutter_level=80.0 - 8.0, margin_m=2.0)
            rows = (look.first_row + np.arange(len(look.amplitude))) % VIDEO.azimuths
            cells = look.first_cell + np.arange(look.amplitude.shape[1])
            np.maximum.at(made[scan], np.ix_(rows, cells), look.amplitude)
    return made


def worked(part: Any, blocks: Iterable[Sweeps], **expected: Any) -> tuple[RadarChain, Plots]:
    chain = RadarChain(SITE, 0, Hybrid(), Manhattan(), bearing=part)
    if expected:
        chain.expect(**expected)
    sectors = [chain.process(one) for one in blocks]
    return chain, Plots.concatenate([*(one.plots for one in sectors), chain.flush().plots])


def aircraft(plots: Plots) -> Plots:
    return plots[(plots.length > 20) & (plots.cells > 20)]


def test_aircraft_get_the_bearing_of_the_part() -> None:
    chain, plots = worked(MaximumLikelihood(), strip(frames(), VIDEO))
    large = aircraft(plots[(plots.scan >= 2) & (plots.window[:, :2].sum(axis=1) != VIDEO.azimuths)])
    for azimuth, heading in HEADINGS.items():
        mine = large[np.abs((large.azimuth - azimuth + 1) % (2 * math.pi) - 1) < 0.2]
        errors = [axis_error(float(one), heading) for one in mine.bearing]
        assert len(errors) >= 2
        assert np.sqrt(np.mean(np.square(errors))) < 5
    assert not large.nose_known.any()
    assert chain.counters["bearings"] == len(aircraft(plots))
    assert chain.counters["bearings_left_out"] == 0
    _, without = worked(None, strip(frames(), VIDEO))
    small = plots[plots.length < 15]
    np.testing.assert_array_equal(small.bearing, without[without.length < 15].bearing)


@pytest.mark.parametrize("part", [Moments(), MaximumLikelihood()])
def test_block_size_does_not_matter(part: Any) -> None:
    whole = strip(frames(), VIDEO)
    _, wanted = worked(part, whole)
    for size in (7, 32, 300):
        _, made = worked(part, [one for block in whole for one in cut(block, range(0, VIDEO.azimuths, size))])
        assert len(made) == len(wanted)
        for name in ("east", "bearing", "bearing_sd", "nose_known", "type"):
            np.testing.assert_array_equal(getattr(made, name), getattr(wanted, name))


def test_the_view_is_the_video_about_the_plot() -> None:
    spy = Spy()
    video = frames(3)
    _, plots = worked(spy, strip(video, VIDEO))
    assert len(spy.seen) == len(aircraft(plots))
    for (seen, expected), k in zip(spy.seen, np.flatnonzero((plots.length > 20) & (plots.cells > 20)), strict=True):
        first, rows, near, deep = plots.window[k]
        top, wanted_rows, left, wanted_deep = seen.plot
        assert expected is None
        assert (rows, deep) == (wanted_rows, wanted_deep)
        assert seen.amplitude.shape[0] == top + rows + 1
        start = int(plots.scan[k]) if first * VIDEO.azimuth_step_rad <= plots.azimuth[k] else int(plots.scan[k]) - 1
        turns = video.reshape(-1, VIDEO.ranges)
        at = start * VIDEO.azimuths + first
        if at + rows == len(turns):
            continue  # the recording ends within it
        np.testing.assert_array_equal(
            seen.amplitude, turns[at - top : at + rows + 1, near - left : near - left + seen.amplitude.shape[1]]
        )
        assert seen.range_m == (near - left) * VIDEO.range_step_m
        assert (seen.azimuth / VIDEO.azimuth_step_rad - 0.5) % VIDEO.azimuths == pytest.approx((first - top) % 1024)


def test_what_tracks_expect_tells_the_nose() -> None:
    azimuth, heading = 1.5, 2.0
    place = {"east": 200 + 300 * math.sin(azimuth), "north": -100 + 300 * math.cos(azimuth)}
    for sense in (0.0, math.pi):
        track = {**place, "heading": heading + sense, "sd": math.radians(5)}
        _, plots = worked(MaximumLikelihood(), strip(frames(), VIDEO), **track)
        large = aircraft(plots)
        near = np.abs(large.azimuth - azimuth) < 0.2
        assert (large.nose_known == near).all()
        assert (np.cos(large.bearing[near] - heading - sense) > 0.95).all()


def test_expectations_are_matched_by_place() -> None:
    table = Expectations.of([0.0, 100.0, np.nan, 7.0], [0.0, 0.0, 0.0, 1.0], [1.0, 7.0, 1.0, 1.0], [0.1, 0.2, 0.1, 0.0])
    assert len(table.east) == 2, "what is not finite, or sure without end, is left out"
    assert table.at(14.0, 0.0, 5.0) == Expected(1.0, 0.1)
    assert table.at(16.0, 0.0, 5.0) is None
    assert table.at(16.0, 0.0, 40.0) == Expected(1.0, 0.1)
    found = table.at(99.0, 3.0, 40.0)
    assert found is not None
    assert found.heading == pytest.approx(7.0 - 2 * math.pi)
    assert Expectations.of([], [], [], []).at(0.0, 0.0, 40.0) is None
    with pytest.raises(ValueError, match="one length"):
        Expectations.of([1.0], [1.0, 2.0], [1.0], [1.0])


def test_an_expectation_is_a_copy() -> None:
    east = np.array([5.0])
    table = Expectations.of(east, [0.0], [1.0], [0.1])
    east[0] = 900.0
    assert table.at(5.0, 0.0, 10.0) is not None


def test_a_part_of_the_turn_has_a_bound_and_what_was_left_out_is_counted() -> None:
    n = MOST_A_PART + 5
    plots = Plots.build(
        n, time=np.zeros(n), range=np.full(n, 300.0), azimuth=np.full(n, 0.1), east=np.zeros(n), north=np.zeros(n),
        covariance=np.zeros((n, 2, 2)), range_extent=np.ones(n), azimuth_extent=np.ones(n), cells=np.full(n, 50),
        length=np.full(n, 30.0), mean_amplitude=np.ones(n), peak_amplitude=np.ones(n),
        window=np.tile([10, 5, 90, 8], (n, 1)),
    )  # fmt: skip
    newest = np.zeros((VIDEO.azimuths, VIDEO.ranges), np.uint8)
    for pieces in (1, n):
        spy = Spy()
        bearings = PlotBearings(SITE, spy)
        for k in np.array_split(np.arange(n), pieces):
            bearings(plots[k], newest)
        assert len(spy.seen) == MOST_A_PART
        assert bearings.counters == {"bearings": 0, "bearings_left_out": 5}


def test_the_axis_of_the_cells_stays_where_the_part_has_none() -> None:
    _, plots = worked(Spy(), strip(frames(), VIDEO))
    _, without = worked(None, strip(frames(), VIDEO))
    np.testing.assert_array_equal(plots.bearing, without.bearing)
    np.testing.assert_array_equal(plots.bearing_sd, without.bearing_sd)
    assert np.isfinite(aircraft(plots).bearing).any()


def test_images_of_delivered_plots_show_them() -> None:
    chain, plots = worked(None, strip(frames(), VIDEO))
    newest = aircraft(plots[plots.scan == 3])
    images = chain.images(newest, step_m=1.5, size=64)
    assert images.shape == (len(newest), 64, 64)
    assert len(newest) == 3
    for image in images:
        bright = np.argwhere(image > 120)
        assert np.abs(bright.mean(axis=0) - 31.5).max() < 6
        assert len(bright) > 60
    # nose and tail lie along the heading, north up
    lying = images[int(np.argmin(np.abs(newest.azimuth - 4.0)))]
    down, right = (np.argwhere(lying > 120) - 31.5).T
    axis = 0.5 * math.atan2(2 * float(np.mean(-down * right)), float(np.var(down) - np.var(right)))
    assert abs(axis_error(axis, HEADINGS[4.0])) < 25


def test_bearings_are_timed() -> None:
    ticks = iter(range(1000))
    chain = RadarChain(SITE, 0, Hybrid(), Manhattan(), clock=lambda: float(next(ticks)), bearing=Moments())
    block = strip(frames(1), VIDEO)[0]
    chain.process(next(cut(block, [64])))
    assert chain.timings == {"keep": 1.0, "detect": 1.0, "extract": 1.0, "bearing": 1.0}
    chain.process(block)
    assert set(chain.timings.values()) == {8.0}
