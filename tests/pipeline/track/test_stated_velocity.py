"""What a report says of its velocity, and how far that is believed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.filter import Prior
from pipeline.tables import TargetReports
from pipeline.track.stated_velocity import stated_velocity
from tests.pipeline.track.scene import T0, make_tracker


def stated(speed: list[float], course: list[float]) -> Prior:
    words = {"address": "aaaaaa", "east": 0.0, "north": 0.0, "accuracy": 3.0, "source": "s"}
    reports = TargetReports.build(len(speed), time=T0, speed=np.array(speed), course=np.array(course), **words)
    return stated_velocity(make_tracker()._core, reports)


def test_the_course_is_clockwise_from_north() -> None:
    prior = stated([10.0, 10.0, 20.0, 8.0], np.radians([0.0, 90.0, 210.0, 30.0]).tolist())
    wanted = [[0.0, 10.0], [10.0, 0.0], [-10.0, -17.3205], [4.0, 6.9282]]
    np.testing.assert_allclose(prior.velocity, wanted, atol=1e-4)
    assert prior.known.tolist() == [True] * 4


@pytest.mark.parametrize(
    ("speed", "variance"),
    [
        # 70 % right: (2 m/s + 5 % of the speed)^2; 30 % wrong: (15 m/s)^2 + twice the speed squared
        (0.0, 0.7 * 4.0 + 0.3 * 225.0),
        (10.0, 0.7 * 2.5**2 + 0.3 * 425.0),
        (80.0, 0.7 * 36.0 + 0.3 * (225.0 + 12800.0)),
    ],
)
def test_its_covariance_is_that_of_right_and_wrong_statements(speed: float, variance: float) -> None:
    prior = stated([speed], [1.0])
    np.testing.assert_allclose(prior.covariance, [[[variance, 0.0], [0.0, variance]]], rtol=1e-6)


@pytest.mark.parametrize(
    ("speed", "course", "known"),
    [
        (0.0, 1.0, True),
        (0.9, np.nan, True),  # nearly none, whichever way
        (1.0, np.nan, False),
        (1.1, np.nan, False),
        (-1.0, 1.0, False),
        (-1.0, np.nan, False),
        (299.0, 1.0, True),
        (300.0, 1.0, False),
        (301.0, 1.0, False),
        (np.nan, 1.0, False),
        (np.nan, np.nan, False),
        (np.inf, 1.0, False),
        (10.0, np.inf, False),
        (10.0, np.nan, False),
    ],
)
def test_what_cannot_be_is_not_known(speed: float, course: float, known: bool) -> None:
    prior = stated([20.0, speed, 30.0], [0.0, course, 0.0])
    assert prior.known.tolist() == [True, known, True]
    np.testing.assert_allclose(prior.velocity[[0, 2]], [[0.0, 20.0], [0.0, 30.0]])
    if not known:
        start = make_tracker()._core.settings.start.speed_sd ** 2
        np.testing.assert_array_equal(prior.velocity[1], [0.0, 0.0])
        np.testing.assert_allclose(prior.covariance[1], start * np.eye(2))


def test_of_no_course_the_slow_one_is_said_to_go_north() -> None:
    np.testing.assert_allclose(stated([0.5], [np.nan]).velocity, [[0.0, 0.5]])
