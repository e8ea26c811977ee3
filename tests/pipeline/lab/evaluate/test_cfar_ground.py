"""The ground is what it says: its laws, its means, its map; and intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from pipeline.airport.model import SurfaceKind
from pipeline.lab.evaluate.cfar_law import Law, swerling3_draw, swerling3_survival
from pipeline.lab.evaluate.ground import ASPHALT, STRONG, SURFACES, WEAK, Ground, Rain, _draw
from pipeline.lab.evaluate.statistics import mean_interval, rms_interval, wilson

LAWS = [Law(), Law("weibull", 1.2), Law("weibull", 1.6), Law("k", 1.0), Law("k", 5.0)]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_counted_false_alarms_agree_with_the_exact_probability(law: Law) -> None:
    scene = Ground.homogeneous(law=law).build()
    chance = np.random.default_rng(7)
    mean = scene.mean_db(0)
    limit = int(np.floor((scene.asphalt_db + law.decibels(np.array(1e-3))) / scene.video.db_per_step))
    expected = float(scene.exceedance(np.array(limit), np.array(scene.asphalt_db)))
    scans = 8
    counted = sum(int((scene.amplitude(chance, mean) > limit).sum()) for _ in range(scans))
    tries = scans * mean.size
    assert 5e-4 < expected < 2e-3
    assert binom.cdf(counted, tries, expected) > 1e-4
    assert binom.sf(counted - 1, tries, expected) > 1e-4


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_mean_power_and_survival_are_of_one_law(law: Law) -> None:
    decibels = np.arange(-40.0, 25.0, 0.5)
    survival = law.survival(decibels)
    assert (np.diff(survival) <= 0).all()
    good = (survival < 1 - 1e-6) & (survival > 1e-12)
    np.testing.assert_allclose(law.decibels(survival[good]), decibels[good], atol=2e-3)
    drawn = law.decibels((np.arange(2_000_000) + 0.5) / 2_000_000)
    assert np.mean(10 ** (drawn / 10)) == pytest.approx(1.0, abs=2e-3)


def test_weibull_of_shape_2_is_rayleigh() -> None:
    decibels = np.arange(-30.0, 14.0)
    np.testing.assert_allclose(Law("weibull", 2.0).survival(decibels), Law().survival(decibels), rtol=1e-9)
    assert Law().log_mean_db == pytest.approx(-2.507, abs=2e-3)


@pytest.mark.parametrize("snr", [-5.0, 10.0, 20.0])
def test_swerling_3_in_clutter_is_what_is_drawn(snr: float) -> None:
    chance = np.random.default_rng(3)
    n = 200_000
    drawn = swerling3_draw(chance, np.full(n, 12.0), np.full(n, 12.0 + snr))
    for limit in (15.0, 20.0, 30.0):
        expected = float(swerling3_survival(np.array(limit), np.array(12.0), np.array(12.0 + snr)))
        counted = int((drawn > limit).sum())
        assert binom.cdf(counted, n, expected) > 1e-4
        assert binom.sf(counted - 1, n, expected) > 1e-4
    assert np.mean(10 ** (drawn / 10)) == pytest.approx(10**1.2 * (1 + 10 ** (snr / 10)), rel=0.02)


@pytest.mark.parametrize("ground", [Ground.heterogeneous(4), Ground.held_out(4)], ids=["development", "held out"])
def test_levels_texture_and_map(ground: Ground) -> None:
    scene = ground.build()
    assert set(np.unique(scene.kind)) == set(range(len(SURFACES)))
    still = replace(ground, wind_db=0.0).build().mean_db(0)
    for kind in range(len(SURFACES)):
        here = still[scene.kind == kind] - scene.nominal_db(kind)
        assert here.mean() == pytest.approx(0.0, abs=0.2)
        assert here.std() == pytest.approx(ground.texture_db[kind], rel=0.1)
    grass = scene.surface == SurfaceKind.GRASS
    wrong = grass != np.isin(scene.kind, (WEAK, STRONG))
    assert 0.005 < wrong.mean() < 0.1


def test_gusts_move_the_grass_slowly_and_nothing_else() -> None:
    scene = Ground.heterogeneous(1).build()
    first, second, later = (scene.mean_db(scan) for scan in (0, 1, 60))
    asphalt, grass = scene.kind == ASPHALT, scene.kind == WEAK
    np.testing.assert_array_equal(first[asphalt], later[asphalt])
    assert np.abs(second - first)[grass].max() < 0.5
    assert np.abs(later - first)[grass].max() > 0.5


def test_the_kernel_draws_what_the_slow_way_draws() -> None:
    chance = np.random.default_rng(8)
    mean = chance.uniform(-5.0, 80.0, (40, 70)).astype(np.float32)
    bits = chance.integers(0, 2**32, mean.shape, np.uint32)
    bits[:5] |= np.uint32(0xFFFF0000)
    main, tail = Law("weibull", 1.4).quantiles
    made = np.empty(mean.shape, np.uint8)
    _draw(mean, bits, main, tail, np.float32(3.2), made)
    place = bits >> 16
    value = np.where(place == 65535, tail[bits & 65535], main[place])
    np.testing.assert_array_equal(made, np.clip(np.rint((mean + value) * np.float32(3.2)), 0, 255))


def test_speckle_of_a_beam_is_correlated_in_azimuth_with_the_same_law() -> None:
    ground = replace(Ground.homogeneous(), beam_rows=3)
    scene = ground.build()
    chance = np.random.default_rng(2)
    power = 10 ** (scene.amplitude(chance, scene.mean_db(0)) * scene.video.db_per_step / 10)
    neighbours = np.corrcoef(power[1:].ravel(), power[:-1].ravel())[0, 1]
    assert neighbours == pytest.approx((2 / 3) ** 2, abs=0.05)
    assert 10 * np.log10(power.mean()) == pytest.approx(scene.asphalt_db, abs=0.1)
    assert scene.video.beamwidth_rad == pytest.approx(3 * scene.video.azimuth_step_rad)


def test_rain_swells_adds_its_power_and_passes() -> None:
    scene = Ground.homogeneous().build()
    rain = Rain(rate=16.0, begin=10)
    dry = scene.mean_db(0)
    np.testing.assert_array_equal(scene.mean_db(10, rain), dry)
    np.testing.assert_array_equal(scene.mean_db(10 + rain.scans, rain), dry)
    height = scene.mean_db(10 + rain.ramp + 20, rain) - dry
    assert height.max() == pytest.approx(10 * np.log10(1 + 10**1.3 + 10**0.3), abs=0.1)
    assert height.min() == pytest.approx(10 * np.log10(1 + 10**0.3), abs=0.5)
    lighter = scene.mean_db(50, Rain(rate=4.0, begin=10)) - dry
    assert lighter.max() < height.max()


def test_the_same_seed_makes_the_same_scene_and_video() -> None:
    made = [Ground.held_out(3).build() for _ in range(2)]
    video = [one.amplitude(np.random.default_rng(5), one.mean_db(9)) for one in made]
    np.testing.assert_array_equal(*video)
    np.testing.assert_array_equal(made[0].surface, made[1].surface)
    assert (Ground.held_out(4).build().kind != made[0].kind).any()


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="azimuths"):
        Ground(azimuths=4)
    with pytest.raises(ValueError, match="texture_db"):
        Ground(wind_db=-1.0)
    with pytest.raises(ValueError, match="family"):
        Law("normal")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="shape"):
        Law("k", 0.0)
    with pytest.raises(ValueError, match="rate"):
        Rain(rate=0.0)


def test_intervals() -> None:
    low, high = wilson(90, 100)
    assert (low, high) == (pytest.approx(0.8256, abs=1e-4), pytest.approx(0.9448, abs=1e-4))
    assert wilson(0, 10)[0] == 0.0
    assert wilson(10, 10)[1] == 1.0
    with pytest.raises(ValueError, match="hits"):
        wilson(1, 0)
    chance = np.random.default_rng(1)
    inside = mean_inside = 0
    for _ in range(300):
        values = chance.normal(0, 2.0, 60)
        below, above = rms_interval(values, draws=200)
        inside += below <= 2.0 <= above
        below, above = mean_interval(values)
        mean_inside += below <= 0 <= above
    assert inside / 300 > 0.87
    assert mean_inside / 300 > 0.91
    assert rms_interval(values) == rms_interval(values)
    assert mean_interval(np.array([3.0])) == (3.0, 3.0)
    for wrong in (rms_interval, mean_interval):
        with pytest.raises(ValueError, match="no"):
            wrong(np.array([]))
