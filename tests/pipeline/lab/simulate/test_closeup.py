"""Close-up video: it is where it says, as bright as it says, and the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.lab.simulate.closeup import CLOSEUP_TYPES, Closeup, Posed, closeup
from pipeline.tables import VideoFormat

VIDEO = VideoFormat()


def looks(kind: str, range_m: float, snr_db: float, many: int) -> list[Closeup]:
    chance = np.random.default_rng(3)
    return [
        closeup(
            chance,
            [Posed.at(CLOSEUP_TYPES[kind], range_m, chance.uniform(0, 2 * np.pi), chance.uniform(0, 2 * np.pi))],
            snr_db,
        )
        for _ in range(many)
    ]


def test_the_same_seed_gives_the_same_video() -> None:
    for one, other in zip(looks("A320", 300.0, 22.0, 2), looks("A320", 300.0, 22.0, 2), strict=True):
        np.testing.assert_array_equal(one.amplitude, other.amplitude)


@pytest.mark.parametrize("range_m", [100.0, 400.0, 1500.0])
def test_the_echo_lies_where_the_truth_says(range_m: float) -> None:
    for look in looks("B734", range_m, 25.0, 4):
        target = look.targets[0]
        rows, cells = np.indices(look.amplitude.shape)
        azimuth = (look.first_row + rows + 0.5) * VIDEO.azimuth_step_rad
        distance = VIDEO.first_range_m + (look.first_cell + cells) * VIDEO.range_step_m
        weight = look.power[0] * distance
        east, north = ((weight * distance * side(azimuth)).sum() / weight.sum() for side in (np.sin, np.cos))
        assert np.hypot(east - target.east, north - target.north) < 8.0
        corners = np.concatenate(look.outlines[0])
        assert (corners >= 0).all()
        assert (corners < look.amplitude.shape).all()
        brightest = np.unravel_index(look.power[0].argmax(), look.power[0].shape)
        assert np.abs(corners - brightest).min() <= max(3.0, 8.0 / (range_m * VIDEO.azimuth_step_rad))


@pytest.mark.parametrize("kind", ["CAR", "AT72", "A320"])
def test_mean_power_in_the_outline_and_of_the_clutter(kind: str) -> None:
    inside, outside = [], []
    for look in looks(kind, 500.0, 20.0, 60):
        power = 10 ** ((look.amplitude.astype(float) - look.clutter_level) * VIDEO.db_per_step / 10)
        inside.append((power * look.power[0]).sum() / look.power[0].sum())
        outside.append(power[look.power[0] < 1e-3].mean())
        # what speckles about the expected power has that power as its mean
        assert inside[-1] > 0
    expected = [float((one.power[0] ** 2).sum() / one.power[0].sum()) for one in looks(kind, 500.0, 20.0, 60)]
    log_mean = 10 ** (10 * np.euler_gamma / np.log(10) / 10)
    assert np.mean(outside) == pytest.approx(log_mean, rel=0.05)
    assert np.mean(inside) == pytest.approx(log_mean * (1 + np.mean(expected)), rel=0.25)


def test_clutter_has_the_stated_log_mean_and_follows_the_beam() -> None:
    look = looks("CAR", 400.0, 20.0, 1)[0]
    frames = np.concatenate([one.amplitude[:10].astype(float) for one in looks("CAR", 400.0, 20.0, 60)], axis=1)
    assert frames.mean() == pytest.approx(look.clutter_level, abs=1.0)
    assert frames.std() * VIDEO.db_per_step == pytest.approx(5.57, abs=0.3)
    # correlation of the power at one row of a Gaussian beam: the square of that of the field
    power = 10 ** (frames * VIDEO.db_per_step / 10)
    a = VIDEO.azimuth_step_rad / VIDEO.beamwidth_rad
    measured = np.corrcoef(power[:-1].ravel(), power[1:].ravel())[0, 1]
    assert measured == pytest.approx(np.exp(-2 * np.log(2) * a * a), abs=0.08)


def test_what_cannot_be_shown_is_refused() -> None:
    chance = np.random.default_rng(0)
    car = CLOSEUP_TYPES["CAR"]
    with pytest.raises(ValueError, match="needs a target"):
        closeup(chance, [], 20.0)
    with pytest.raises(ValueError, match="surrounds"):
        closeup(chance, [Posed(car, 0.5, 0.5, 0.0)], 20.0)
    with pytest.raises(ValueError, match="outside"):
        closeup(chance, [Posed(car, 0.0, 5000.0, 0.0)], 20.0)


def test_across_north() -> None:
    look = closeup(np.random.default_rng(0), [Posed.at(CLOSEUP_TYPES["A320"], 300.0, 0.0, 1.0)], 20.0)
    assert look.first_row > 4000
    assert look.first_row + len(look.amplitude) > 4096
    corners = np.concatenate(look.outlines[0])
    assert (corners[:, 0] > 0).all()
    assert (corners[:, 0] < len(look.amplitude)).all()
