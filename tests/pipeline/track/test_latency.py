"""How late the positions of a source are, learnt from what a radar says of the same targets."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.tables import TargetReports
from pipeline.tables.arrays import Floats
from pipeline.track import latency
from pipeline.track.latency import FIRST_SD_S, Latencies, latency_noise, lateness, source_keys, with_latency

NOW = 1000.0


def known(latencies: Latencies, key: str = "a", time: float = NOW) -> tuple[float, float]:
    mean, sd = latencies.of([key], np.array([time]))
    return float(mean[0]), float(sd[0])


def test_of_an_unknown_source_it_is_none_give_or_take_half_a_second() -> None:
    assert known(Latencies()) == (0.0, FIRST_SD_S)
    mean, sd = Latencies().of([], np.empty(0))
    assert len(mean) == len(sd) == 0


def test_it_is_the_mean_of_what_was_learnt_weighed_by_variance() -> None:
    latencies = Latencies()
    latencies.learn("a", NOW, 0.8, 0.25)
    assert known(latencies) == pytest.approx((0.4, math.sqrt(0.125)))
    latencies.learn("a", NOW, 0.8, 0.125)  # beyond what is known
    assert known(latencies) == pytest.approx((0.8, math.sqrt(0.0625)))
    assert known(latencies, "b") == (0.0, FIRST_SD_S)


def test_what_is_known_becomes_less_sure_with_time_up_to_what_is_known_of_any() -> None:
    latencies = Latencies()
    latencies.learn("a", NOW, 0.8, 0.0001)
    mean, sd = known(latencies)
    assert known(latencies, time=NOW + 100.0) == pytest.approx((mean, math.sqrt(sd**2 + 0.04)))
    assert known(latencies, time=NOW + 1e6) == pytest.approx((mean, FIRST_SD_S))
    assert known(latencies, time=NOW - 50.0) == pytest.approx((mean, sd))


@pytest.mark.parametrize("late", [5.0, -5.0])
def test_no_more_than_two_seconds_are_believed(late: float) -> None:
    latencies = Latencies()
    latencies.learn("a", NOW, late, 1e-9)
    assert known(latencies)[0] == math.copysign(2.0, late)


@pytest.mark.parametrize(("key", "late"), [("", 0.5), ("a", math.nan), ("a", math.inf)])
def test_nothing_is_learnt_of_nobody_or_from_no_number(key: str, late: float) -> None:
    latencies = Latencies()
    latencies.learn(key, NOW, late, 0.1)
    assert latencies.known == {}


def test_the_source_heard_longest_ago_is_forgotten_for_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latency, "MOST_SOURCES", 2)
    latencies = Latencies()
    for key in ("a", "b", "a", "c"):
        latencies.learn(key, NOW, 0.1, 0.1)
    assert list(latencies.known) == ["a", "c"]


def test_when_the_clock_is_set_all_times_move() -> None:
    latencies, other = Latencies(), Latencies()
    latencies.learn("a", NOW, 0.8, 0.01)
    other.learn("a", NOW + 7.0, 0.8, 0.01)
    latencies.shift(7.0)
    assert latencies == other


def test_the_source_is_what_the_report_names_or_its_address() -> None:
    reports = TargetReports.build(3, time=0.0, east=0.0, north=0.0, address=["abc", "abc", ""], source=["mlat", "", ""])
    assert source_keys(reports) == ["mlat", "abc", ""]


def target(speed: float, course: float) -> Floats:
    way = math.radians(course)
    return np.array([[100.0, 200.0, speed * math.sin(way), speed * math.cos(way)]])


COVARIANCE = np.array([[[4.0, 1.0, 0.3, 0.1], [1.0, 9.0, 0.2, 0.4], [0.3, 0.2, 1.0, 0.5], [0.1, 0.4, 0.5, 2.0]]])


@pytest.mark.parametrize("course", [0.0, 60.0, 200.0])
@pytest.mark.parametrize("late", [0.7, -0.4])
def test_a_position_behind_its_target_is_late_by_the_time_it_took(course: float, late: float) -> None:
    mean = target(20.0, course)
    along = mean[0, 2:] / 20.0
    across = np.array([along[1], -along[0]])
    noise = np.array([[[2.0, 0.5], [0.5, 3.0]]])
    found, variance = lateness(mean, COVARIANCE, mean[:, :2] - 20.0 * late * along + 5.0 * across, noise)
    assert found == pytest.approx(late)
    assert variance == pytest.approx(along @ (COVARIANCE[0, :2, :2] + noise[0]) @ along / 400.0)


def test_the_slow_and_those_of_unsure_speed_tell_nothing() -> None:
    noise = np.eye(2)[None]
    for speed, speed_sd, tells in ((7.9, 0.1, False), (8.0, 0.1, True), (10.0, 2.9, True), (10.0, 3.1, False)):
        covariance = np.diag([1.0, 1.0, speed_sd**2, speed_sd**2])[None]
        found, variance = lateness(target(speed, 90.0), covariance, np.zeros((1, 2)), noise)
        assert np.isfinite(found).tolist() == np.isfinite(variance).tolist() == [tells]
    found, _ = lateness(np.zeros((1, 4)), np.eye(4)[None], np.zeros((1, 2)), noise)
    assert np.isnan(found).all()


def test_an_unsure_latency_is_a_doubt_of_the_position_along_the_motion() -> None:
    mean, covariance = np.repeat(target(20.0, 60.0), 2, axis=0), np.repeat(COVARIANCE, 2, axis=0)
    before = covariance.copy()
    sd = np.array([0.5, 0.0])
    velocity = mean[0, 2:]
    more = 0.25 * (np.outer(velocity, velocity) + COVARIANCE[0, 2:, 2:])
    assert latency_noise(mean, covariance, sd) == pytest.approx(np.array([more, np.zeros((2, 2))]))
    made = with_latency(mean, covariance, sd)
    before[0, :2, :2] += more
    assert made == pytest.approx(before)
    assert (covariance == np.repeat(COVARIANCE, 2, axis=0)).all()
    assert with_latency(mean, covariance, np.zeros(2)) is covariance
