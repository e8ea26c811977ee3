"""Course and speed of a report are measurements with a doubt: wrong ones cost a target neither number nor place.

Operational multilateration sends a course that is noise, and vehicles send zero speed while they drive.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.tables import TargetReports, TrackPhase
from tests.pipeline.track.scene import T0, Target, line, make_tracker, truth_at
from tests.pipeline.track.sensors import Antenna, antenna, by_address, play, report

SPEEDS = (5.0, 15.0, 40.0, 70.0)
SECONDS = 30
SETTLED_S = 5.0
"""s after the first report, from which on the position is judged."""

Said = Callable[[np.random.Generator, float, float], tuple[float, float]]
SAID: dict[str, Said] = {
    "reversed": lambda rng, speed, course: (speed, course + np.pi),
    "across": lambda rng, speed, course: (speed, course + np.pi / 2),
    "random": lambda rng, speed, course: (speed, rng.uniform(0, 2 * np.pi)),
    "north": lambda rng, speed, course: (speed, 0.0),
    "speed zero": lambda rng, speed, course: (0.0, course),
    "speed doubled": lambda rng, speed, course: (2 * speed, course),
    "speed doubled, reversed": lambda rng, speed, course: (2 * speed, course + np.pi),
}
"""What the fields of speed, m/s, and course, rad, say of a target."""


def true(rng: np.random.Generator, speed: float, course: float) -> tuple[float, float]:
    return speed, course


def unsaid(rng: np.random.Generator, speed: float, course: float) -> tuple[float, float]:
    return float("nan"), float("nan")


def moving(speed: float, course: float) -> Target:
    """Through (300, 400) in the middle of its time, a vehicle in its extent."""
    east, north = np.sin(course), np.cos(course)
    along = speed * SECONDS / 2
    return Target(line(300 - along * east, 400 - along * north, speed * east, speed * north), 8, 4, 0.95)


def follow(
    speed: float, said: Said, sd: float, *, antennas: tuple[Antenna, ...] = (), seed: int = 1
) -> tuple[set[int], list[float], dict[str, int]]:
    """Reports once a second: the numbers that its address bore, m from the truth half a second after each, counters."""
    rng = np.random.default_rng((seed, int(speed), int(sd)))
    course = float(rng.uniform(0, 2 * np.pi))
    target = moving(speed, course)
    tracker = make_tracker(radars=[one.site for one in antennas])
    numbers, errors = set(), []

    def heard(t: float) -> TargetReports:
        fast, track = said(rng, speed, course)
        return report(target, t - 0.2, "39abcd", rng=rng, sd=sd, speed=fast, course=track % (2 * np.pi))

    for t, _ in play(tracker, antennas, [target], SECONDS, reports=heard, seed=seed):
        tracks = tracker.tracks(T0 + t + 0.5)
        mine = by_address(tracks, "39abcd")
        numbers |= set(mine.id.tolist())
        if t >= SETTLED_S:
            assert len(tracks) == len(mine) == 1, f"{len(tracks)} tracks, {len(mine)} with the address, at {t} s"
            assert mine.phase[0] == TrackPhase.CONFIRMED
            errors.append(float(np.hypot(*(truth_at(target, T0 + t + 0.5)[0] - mine.state[0, :2]))))
    return numbers, errors, dict(tracker.counters)


def keeps_its_reports(counters: dict[str, int]) -> bool:
    return not any(counters.get(name) for name in ("report_implausible", "identity_moved"))


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("wrong", SAID)
def test_by_reports_alone_a_wrong_course_or_speed_costs_neither_number_nor_place(wrong: str, speed: float) -> None:
    for seed in range(3):
        numbers, errors, counters = follow(speed, SAID[wrong], 3.0, seed=seed)
        assert len(numbers) == 1
        assert keeps_its_reports(counters), counters
        assert np.percentile(errors, 95) < 15


@pytest.mark.parametrize("wrong", SAID)
def test_coarse_reports_with_a_wrong_course_are_followed_as_well_as_those_without_one(wrong: str) -> None:
    """10 m of noise in each coordinate: the place is as good as noise lets it be, whatever the course says."""
    told, plain = [], []
    for speed in SPEEDS:
        for seed in range(3):
            numbers, errors, counters = follow(speed, SAID[wrong], 10.0, seed=seed)
            assert len(numbers) == 1
            assert keeps_its_reports(counters), counters
            told += errors
            plain += follow(speed, unsaid, 10.0, seed=seed)[1]
    assert np.percentile(told, 95) < 1.25 * np.percentile(plain, 95) + 2


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("wrong", SAID)
def test_with_a_radar_echo_a_wrong_course_or_speed_costs_neither_number_nor_place(wrong: str, speed: float) -> None:
    radar = antenna()
    for seed in range(3):
        numbers, errors, counters = follow(speed, SAID[wrong], 5.0, antennas=(radar,), seed=seed)
        assert len(numbers) == 1
        assert not counters.get("identity_moved")
        assert not counters.get("report_implausible")
        assert np.percentile(errors, 95) < 12


@pytest.mark.parametrize("speed", SPEEDS)
def test_a_true_course_is_followed_from_the_beginning(speed: float) -> None:
    for seed in range(3):
        numbers, errors, counters = follow(speed, true, 3.0, seed=seed)
        assert len(numbers) == 1
        assert keeps_its_reports(counters), counters
        assert np.percentile(errors, 95) < 12
