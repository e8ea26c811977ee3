from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.airport.model import SurfaceKind
from pipeline.lab.simulate.clutter import NAMES as GROUND_NAMES
from pipeline.lab.simulate.clutter import SHAPES, PowerLaw, quantiles
from pipeline.lab.simulate.paths import Truth
from pipeline.lab.simulate.rain import RainCell, shower
from pipeline.lab.simulate.scatter import centres
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.reference.types import TYPES
from tests.pipeline.lab.simulate.field import airport, one_target, radar, uniform

DB = 0.3125
NOISE = 80.0
FIELD = airport()


def nothing(_: float) -> Truth:
    return Truth.empty()


def always(truth: Truth) -> Callable[[float], Truth]:
    return lambda _: truth


@cache
def quiet(reference: float = 20.0) -> VideoSimulator:
    """Weak ground far away; with a low reference nothing but thermal noise."""
    site = radar()
    return VideoSimulator(FIELD, site, 7, surface=uniform(site, SurfaceKind.WATER), law=PowerLaw(reference=reference))


@cache
def whole_field() -> VideoSimulator:
    from pipeline.airport.surfaces import surface_of_radar

    site = radar()
    return VideoSimulator(FIELD, site, 7, surface=surface_of_radar(FIELD, site))


def scans(video: VideoSimulator, count: int, truth: Truth | None = None) -> NDArray[np.uint8]:
    at = always(truth) if truth is not None else nothing
    return np.stack([video.sweeps(scan, 0, video.site.video.azimuths, at) for scan in range(count)])


def test_thermal_noise_is_rayleigh_at_the_set_level() -> None:
    level = scans(quiet(-40.0), 4)[:, :, 100:].astype(float) * DB
    power = 10 * math.log10(np.mean(10 ** (level / 10)))
    # 4 x 512 x 156 independent cells: the mean is good to 0.02 dB, the deviation to 0.01 dB
    assert power == pytest.approx(NOISE * DB, abs=0.1)
    assert level.mean() == pytest.approx(NOISE * DB - 2.507, abs=0.08)
    assert level.std() == pytest.approx(5.57, abs=0.12)


def test_noise_is_independent_from_scan_to_scan_and_from_cell_to_cell() -> None:
    first, second = scans(quiet(-40.0), 2)[:, :, 100:].astype(float)
    first -= first.mean()
    second -= second.mean()
    scale = first.std() ** 2
    limit = 5 / math.sqrt(first.size)
    assert abs(np.mean(first * second) / scale) < limit
    for lag in (1, 2, 4):
        assert abs(np.mean(first[:, lag:] * first[:, :-lag]) / scale) < limit
    assert abs(np.mean(first[1:] * first[:-1]) / scale) < limit


def test_the_tail_of_the_noise_reaches_past_one_in_a_million() -> None:
    main, tail = quantiles()
    rayleigh = tail[0] / 1e6
    # P(power > x mean) = exp(-x): entry v stands for 1 - u = (1 - (v + 0.5) / 65536) / 4096
    np.testing.assert_allclose(
        rayleigh, 10 * np.log10(-np.log((1 - (np.arange(65536) + 0.5) / 65536) / 4096)), atol=1e-5
    )
    assert rayleigh[-1] > 10 * math.log10(math.log(1e8))
    assert np.all(np.diff(main, axis=1) > 0)
    assert np.all(main[:, -2] < tail[:, 0])


@pytest.mark.parametrize("family", range(len(SHAPES)))
def test_every_family_has_its_shape_and_unit_mean_power(family: int) -> None:
    main, tail = quantiles()
    power = 10 ** (main[family] / 1e7)
    mean = (power[:-1].sum() + np.mean(10 ** (tail[family] / 1e7))) / 4096
    assert mean == pytest.approx(1.0, abs=0.01)
    # in decibels a Weibull amplitude of shape c is a Rayleigh one stretched by 2 / c
    assert (main[family] / 1e6).std() == pytest.approx(5.57 * 2 / SHAPES[family], rel=0.01)


def grounds() -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    video = whole_field()
    return video.clutter.ground, scans(video, 12).astype(float) * DB


def test_clutter_by_kind_of_ground() -> None:
    ground, level = grounds()
    video = whole_field()
    slant = np.arange(256) * 6.0
    law = PowerLaw()
    ring = (slant > 350) & (slant < 1200)
    lit = video.clutter.slope[:, ring] < np.tan(np.arctan2(-30.0, slant[ring])) * 16384
    means = {}
    for name, sigma0, shape in (("asphalt", -43.0, 2.0), ("weak grass", -33.0, 2.0), ("strong grass", -27.5, 1.7)):
        cells = (ground[:, ring] == GROUND_NAMES.index(name)) & lit
        assert np.sum(cells) > 300
        area = slant * math.radians(1.4) * 6.0
        clutter = 10 ** ((sigma0 + law.decibels(slant[ring]) + 10 * np.log10(area[ring])) / 10)
        expected = NOISE * DB + 10 * np.log10(1 + clutter)
        excess = (level[:, :, ring] - expected)[:, cells]
        power = 10 * math.log10(np.mean(10 ** (excess / 10)))
        means[name] = power
        # texture (lognormal, up to 1.2 dB) adds at most 0.2 dB to the mean power
        assert power == pytest.approx(0.1, abs=0.25)
        # fluctuation in time, cell by cell, is that of the family
        spread = excess.std(axis=0, ddof=1)
        assert np.sqrt(np.mean(spread**2)) == pytest.approx(5.57 * 2 / shape, abs=0.35)
    building = level[:, :, :][:, ground == GROUND_NAMES.index("building")]
    asphalt = level[:, ground == GROUND_NAMES.index("asphalt")]
    assert np.median(building) > np.median(asphalt) + 20.0


def test_same_seed_same_video_other_seed_other_video() -> None:
    site = radar()
    surface = uniform(site, SurfaceKind.GRASS)
    truth = always(one_target("A320", 100.0, -300.0))
    first, same, other = (VideoSimulator(FIELD, site, seed, surface=surface) for seed in (3, 3, 4))
    video = first.sweeps(5, 100, 200, truth)
    np.testing.assert_array_equal(video, same.sweeps(5, 100, 200, truth))
    assert np.mean(video == other.sweeps(5, 100, 200, truth)) < 0.2
    assert np.mean(video == first.sweeps(6, 100, 200, truth)) < 0.2


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 512), max_size=6), st.booleans())
def test_however_it_is_split_the_video_is_the_same(cuts: list[int], rain: bool) -> None:
    site = radar()
    video = split_video(rain)

    def truth(time: float) -> Truth:
        return one_target("B738", 300.0 * time, -500.0, heading=1.5, speed=300.0)

    whole = video.sweeps(2, 0, site.video.azimuths, truth)
    marks = [0, *sorted(cuts), site.video.azimuths]
    parts = [video.sweeps(2, a, b, truth) for a, b in pairwise(marks)]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


@cache
def split_video(rain: bool) -> VideoSimulator:
    site = radar()
    return VideoSimulator(
        FIELD, site, 1, surface=uniform(site, SurfaceKind.GRASS), rain=shower(1, -100.0) if rain else ()
    )


@pytest.mark.parametrize(("east", "north"), [(0.0, -300.0), (700.0, -900.0), (-500.0, -1400.0), (3.0, -100.0)])
def test_a_target_appears_where_the_truth_says(east: float, north: float) -> None:
    video = quiet()
    site = video.site
    truth = one_target("CAR", east, north, heading=0.7)
    power = np.mean(10 ** (scans(video, 30, truth) * DB / 10), axis=0) - 10 ** (NOISE * DB / 10)
    power[:, :60] = 0.0  # near the radar the ground answers
    power[power < 0.05 * power.max()] = 0.0
    rows, cells = np.nonzero(power)
    assert len(rows)
    weight = power[rows, cells]
    angle = np.angle(np.sum(weight * np.exp(1j * (rows + 0.5) * site.video.azimuth_step_rad)))
    x, y = east - site.east, north - site.north
    off = math.remainder(float(angle) - math.atan2(x, y), 2 * math.pi)
    distance = math.hypot(x, y)
    assert abs(off) * distance < 4.0
    slant = math.hypot(distance, site.height)
    assert np.sum(weight * cells) / weight.sum() * 6.0 == pytest.approx(slant, abs=3.0)


def test_power_falls_with_range_as_the_law_says() -> None:
    video = quiet()
    law = PowerLaw(reference=20.0)
    total = []
    places = (250.0, 500.0, 1000.0)
    for place in places:
        truth = one_target("CAR", 0.0, -900.0 + place)
        excess = np.mean(10 ** ((scans(video, 120, truth) * DB - NOISE * DB) / 10), axis=0) - 1.0
        cell = round(math.hypot(place, 30.0) / 6.0)
        rows = np.r_[-12:12]
        total.append(10 * math.log10(excess[rows, cell - 5 : cell + 6].sum()))
    # as seen from a beam whose width in metres grows with range the sum over the cells of a point is the same
    slant = np.hypot(places, 30.0)
    # 14 fluctuating centres, 120 scans: the mean power is good to about 0.4 dB, the difference of two to 0.6
    expected = law.decibels(slant) - law.decibels(slant)[0]
    np.testing.assert_allclose(np.array(total) - total[0], expected, atol=1.5)


@pytest.mark.parametrize(("swerling", "spread"), [(0, 0.0), (1, 1.0), (3, 0.5)])
def test_a_lone_centre_fluctuates_as_swerling_says(swerling: int, spread: float) -> None:
    site = radar()
    video = VideoSimulator(
        FIELD, site, 5, surface=uniform(site, SurfaceKind.WATER), law=PowerLaw(reference=35.0), swerling=swerling
    )
    truth = one_target("CAR", 0.0, -400.0, heading=0.0)
    brightest = scans(video, 150, truth)[:, np.r_[-3:3], 70:95].max(axis=(1, 2)) * DB
    power = 10 ** (brightest / 10)
    relative = float(np.var(power) / np.mean(power) ** 2)
    # the phases of the centres fluctuate in every case: variance rises with the case's own part
    low, high = {0: (0.02, 0.9), 1: (0.25, 1.9), 3: (0.12, 1.4)}[swerling]
    assert low < relative < high
    assert spread >= 0


def test_swerling_cases_are_ordered_and_others_refused() -> None:
    with pytest.raises(ValueError, match="swerling"):
        VideoSimulator(FIELD, radar(), 1, surface=uniform(radar()), swerling=2)
    with pytest.raises(ValueError, match="surface"):
        VideoSimulator(FIELD, radar(), 1, surface=np.zeros((3, 3), np.uint8))


def test_rows_outside_a_turn_are_refused() -> None:
    with pytest.raises(ValueError, match="turn"):
        quiet().sweeps(0, 500, 513, nothing)


def test_an_aircraft_is_as_large_as_its_extent_and_brighter_abeam() -> None:
    site = radar(4096, 512, 3.0)
    fine = dataclasses.replace(site, video=dataclasses.replace(site.video, beamwidth_rad=math.radians(0.18)))
    video = VideoSimulator(FIELD, fine, 2, surface=uniform(fine, SurfaceKind.WATER), law=PowerLaw(reference=25.0))
    extents, powers = {}, {}
    for name, heading in (("along", 0.0), ("across", math.pi / 2)):
        truth = one_target("B77W", 0.0, -400.0, heading=heading)
        mean = np.mean(10 ** ((scans(video, 8, truth) * DB - NOISE * DB) / 10), axis=0)
        seen = mean > 6.0
        seen[:, :100] = False  # near the radar the ground answers
        cells = np.nonzero(seen.any(axis=0))[0]
        extents[name] = (cells.max() - cells.min() + 1) * 3.0
        powers[name] = float((mean - 1.0)[seen].sum())
    kind = TYPES["B77W"]
    assert kind.length - 12 < extents["along"] < kind.length + 15
    assert extents["across"] < kind.width + 15
    assert powers["across"] > 1.2 * powers["along"]


def test_models_have_the_section_and_the_size_of_their_type() -> None:
    for kind in TYPES.values():
        table = centres(kind)
        assert table[:, 3].sum() == pytest.approx(kind.cross_section)
        assert np.ptp(table[:, 0]) == pytest.approx(kind.length, rel=0.12)
        assert np.ptp(table[:, 1]) == pytest.approx(kind.width, rel=0.05)
        assert table[:, 2].max() <= 1.15 * kind.height
        assert len(table) > (40 if kind.fuselage > 2.9 and kind.engines else 11)


def test_behind_a_building_echoes_are_weaker_in_front_not() -> None:
    video = whole_field()
    bare = dataclasses.replace(FIELD, features=())
    site = radar()
    opened = VideoSimulator(bare, site, 7, surface=np.where(uniform(site) == 9, 0, video_surface()).astype(np.uint8))
    # the terminal stands 420 to 470 m north of the radar, 15 m high, seen from 30 m: its shadow ends at 940 m
    for north, loss in ((-380.0, 18.0), (-520.0, 0.0), (180.0, 0.0)):
        truth = one_target("TRUCK", 0.0, north)
        cell = round(math.hypot(north + 900.0, 30.0) / 6.0)
        behind, free = (
            np.mean(10 ** (scans(one, 60, truth)[:, np.r_[-6:6], cell - 1 : cell + 2] * DB / 10))
            for one in (video, opened)
        )
        difference = 10 * math.log10(free / behind)
        if loss:
            assert 7.0 < difference < loss + 3.0
        else:
            assert abs(difference) < 3.0


def video_surface() -> NDArray[np.uint8]:
    from pipeline.airport.surfaces import surface_of_radar

    return surface_of_radar(dataclasses.replace(FIELD, features=FIELD.features[:3]), radar())


def test_the_top_of_the_scale_saturates() -> None:
    site = radar()
    loud = VideoSimulator(FIELD, site, 1, surface=uniform(site), law=PowerLaw(reference=90.0))
    assert scans(loud, 1, one_target("A332", 0.0, -700.0)).max() == 255


def test_rain_raises_the_noise_where_it_is_and_moves_on() -> None:
    site = radar()
    cell = RainCell(500.0, -900.0, 10.0, 0.0, 150.0, 12.0, 0.0, 20.0, 60.0)
    video = VideoSimulator(FIELD, site, 1, surface=uniform(site), law=PowerLaw(reference=0.0), rain=(cell,))
    east = site.video.azimuths // 4
    rows = slice(east - 10, east + 10)

    def level(scan: int, first: int) -> float:
        block = video.sweeps(scan, 0, site.video.azimuths, nothing)[rows, first : first + 12]
        return 10 * math.log10(np.mean(10 ** (block * DB / 10)))

    assert level(40, 144) > level(200, 144) + 8.0
    assert level(4, 84) < level(35, 136) - 3.0
