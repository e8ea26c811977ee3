"""Radars that look at one area: who sees what, when, and how it is handed on."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.lab.simulate.several_radars import (
    EPOCH,
    HALF_EAST_M,
    LANE_M,
    SHADOWS,
    Antenna,
    Looking,
    Shadow,
    Targets,
    behind,
    interleaved,
    make_antennas,
    make_targets,
    observe,
    sectors,
)

PERIODS = (1.0, 0.5, 2.5)
SECONDS = 20.0
SHARP = Looking(detection=1.0, noise_m=1e-3, false_plots=0.0)


def scene(seed: int) -> tuple[np.random.Generator, tuple[Antenna, ...], Targets]:
    chance = np.random.default_rng(seed)
    return chance, make_antennas(chance, PERIODS), make_targets(chance, 4, SECONDS)


def test_targets_keep_their_lanes_inside_the_area() -> None:
    _, _, targets = scene(1)
    np.testing.assert_array_equal(np.diff(targets.start[:, 1]), LANE_M)
    for time in (EPOCH, EPOCH + SECONDS):
        assert (np.abs(targets.place(time)[:, 0]) <= HALF_EAST_M).all()
    assert sorted(set(np.abs(targets.velocity[:, 0]))) == [0.0, 4.0, 25.0]
    assert not targets.velocity[:, 1].any()
    np.testing.assert_allclose(targets.place(EPOCH + 2.0) - targets.start, 2.0 * targets.velocity)


def test_a_radar_sees_every_target_once_a_turn_where_it_is_then() -> None:
    chance, antennas, targets = scene(2)
    for antenna, period in zip(antennas, PERIODS, strict=True):
        seen = observe(chance, antenna, targets, SECONDS, SHARP)
        assert EPOCH <= seen.plots.time.min() <= seen.plots.time.max() < EPOCH + SECONDS
        for target in range(len(targets.start)):
            plots = seen.plots[seen.target == target]
            assert abs(len(plots) - SECONDS / period) <= 1
            np.testing.assert_allclose(np.diff(plots.time), period, atol=0.05 * period)
            true = targets.place(plots.time[:, None])[:, target]
            np.testing.assert_allclose(np.stack([plots.east, plots.north], axis=1), true, atol=0.02)
            turned = antenna.phase + (plots.time - EPOCH) / period
            np.testing.assert_allclose(turned, plots.scan + plots.azimuth / (2 * np.pi), atol=1e-5)


def test_every_radar_reaches_every_target() -> None:
    chance, antennas, targets = scene(3)
    for antenna in antennas:
        video = antenna.site.video
        assert observe(chance, antenna, targets, SECONDS, SHARP).plots.range.max() < video.ranges * video.range_step_m


def test_antennas_stand_elsewhere_and_do_not_turn_together() -> None:
    _, antennas, _ = scene(4)
    assert len({(one.site.east, one.site.north) for one in antennas}) == 3
    assert len({one.phase for one in antennas}) == 3
    assert all(one.begin(0) <= EPOCH < one.begin(1) for one in antennas)


def test_misses_noise_and_false_plots_are_as_asked() -> None:
    chance = np.random.default_rng(5)
    (antenna,) = make_antennas(chance, (0.5,))
    targets = make_targets(chance, 4, 100.0)
    seen = observe(chance, antenna, targets, 100.0, Looking(detection=0.8, noise_m=2.0, false_plots=3.0))
    real = seen.target >= 0
    assert real.sum() == pytest.approx(0.8 * 12 * 200, rel=0.05)
    assert (~real).sum() == pytest.approx(3.0 * 200, rel=0.15)
    north = targets.start[seen.target[real], 1]
    assert np.std(seen.plots.north[real] - north) == pytest.approx(2.0, rel=0.05)
    np.testing.assert_array_equal(seen.plots.covariance, np.broadcast_to(4.0 * np.eye(2), (len(real), 2, 2)))


@pytest.mark.parametrize("seed", range(3))
def test_buildings_hide_all_targets_from_all_radars_but_the_first(seed: int) -> None:
    chance, antennas, targets = scene(seed)
    assert SHADOWS[0] is None
    for antenna, shadow in zip(antennas[1:], SHADOWS[1:], strict=True):
        assert shadow is not None
        clear = observe(chance, antenna, targets, SECONDS, Looking())
        blocked = behind(clear, targets, antenna.site, shadow)
        assert (clear.target >= 0).sum() > 50
        assert (blocked.target == -1).all()
        np.testing.assert_array_equal(blocked.plots.time, clear.plots.time[clear.target == -1])


def test_a_shadow_has_a_beginning_and_two_sides() -> None:
    chance = np.random.default_rng(6)
    (antenna,) = make_antennas(chance, (1.0,))
    site = antenna.site
    away = np.array([[0.0, -200.0], [0.0, -500.0], [400.0, -500.0], [-400.0, -500.0]])
    place = away + np.array([site.east, site.north])
    targets = Targets(place, np.zeros_like(place))
    seen = observe(chance, antenna, targets, 10.0, SHARP)
    left = behind(seen, targets, site, Shadow(np.pi - 0.1, np.pi + 0.1, 300.0))
    assert set(seen.target) == {0, 1, 2, 3}
    assert set(left.target) == {0, 2, 3}


def test_sectors_follow_one_another_and_hold_every_plot_once() -> None:
    chance, antennas, targets = scene(7)
    for radar, (antenna, period) in enumerate(zip(antennas, PERIODS, strict=True)):
        seen = observe(chance, antenna, targets, SECONDS, Looking())
        made = list(sectors(radar, antenna, seen, SECONDS, 8))
        assert {one.radar for one in made} == {radar}
        assert made[0].time > EPOCH >= made[0].time - period / 8
        assert made[-1].time <= EPOCH + SECONDS < made[-1].time + period / 8
        for one, after in pairwise(made):
            assert one.closed_to == after.closed_from == one.closed_from + 512
            assert after.time - one.time == pytest.approx(period / 8, abs=1e-6)
        for one in made:
            row = one.plots.scan * 4096 + one.plots.azimuth / (2 * np.pi) * 4096
            assert ((row >= one.closed_from) & (row < one.closed_to)).all()
            assert (one.plots.time <= one.time + 1e-6).all()
            assert one.scan == one.closed_from // 4096
        handed = np.concatenate([one.plots.time for one in made])
        np.testing.assert_array_equal(handed, seen.plots.time[seen.plots.time < made[-1].time])


def test_unequal_sectors_are_refused() -> None:
    chance, antennas, targets = scene(8)
    seen = observe(chance, antennas[0], targets, 5.0, SHARP)
    with pytest.raises(ValueError, match="3 equal sectors"):
        list(sectors(0, antennas[0], seen, 5.0, 3))


def test_sectors_of_all_radars_come_in_order_of_time() -> None:
    chance, antennas, targets = scene(9)
    seen = [observe(chance, one, targets, SECONDS, Looking()) for one in antennas]
    made = interleaved(antennas, seen, SECONDS, 4)
    assert (np.diff([one.time for one in made]) >= 0).all()
    radars = [one.radar for one in made]
    for radar, period in enumerate(PERIODS):
        assert abs(radars.count(radar) - 4 * SECONDS / period) <= 1
    assert set(radars[:20]) == {0, 1, 2}
