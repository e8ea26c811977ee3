"""Reports whose time stamps are early or late against the radar: one track a target, along its motion as without."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.tables import TargetReports, Tracks
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import Target, line, make_tracker
from tests.pipeline.track.sensors import antenna, by_address, off, play, report

SETTLED_S = 8.0
"""s that a source and its first targets have before they are judged."""

LATENCIES = (0.5, 1.0, -0.3)
"""s by which the position is older than the time stamp says; below zero newer."""


def landing(east: float = -1200.0, north: float = 300.0, begins: float = 0.0) -> Callable[[float], tuple[float, float]]:
    """Eastward at 70 m/s until 10 s after `begins`, then braking with 2 m/s^2 to 40 m/s, which it keeps."""

    def path(t: float) -> tuple[float, float]:
        s = t - begins
        brake = min(max(s - 10.0, 0.0), 15.0)
        return east + 70 * min(s, 10.0) + 70 * brake - brake**2 + 40 * max(s - 25.0, 0.0), north

    return path


@dataclass(frozen=True)
class Reported:
    """A target and what its reports are like. source: which sensor system sends them. phase: s after each second."""

    target: Target
    address: str
    latency: float = 0.0
    source: int = 0
    sd: float = 5.0
    phase: float = -0.3
    since: float = 0.0


@dataclass(frozen=True)
class Watched:
    """errors: m of the track of each address. numbers: those that each bore. tracks, tracker: at the end."""

    errors: dict[str, list[float]]
    numbers: dict[str, set[int]]
    tracks: Tracks
    tracker: Tracker


def watch(
    reported: Sequence[Reported], others: Sequence[Target] = (), seconds: float = 35.0, *, seed: int = 1,
    settled: float = SETTLED_S,
) -> Watched:  # fmt: skip
    """Radar and reports once a second; each address has one track, and nothing has two, once settled."""
    tracker = make_tracker()
    rng = np.random.default_rng((seed, 9))
    errors: dict[str, list[float]] = {one.address: [] for one in reported}
    numbers: dict[str, set[int]] = {one.address: set() for one in reported}

    def heard(t: float) -> TargetReports:
        made = [
            report(
                one.target, t + one.phase, one.address, rng=rng, sd=one.sd, latency=one.latency, source=one.source,
            )
            for one in reported if one.since <= t
        ]  # fmt: skip
        return TargetReports.concatenate(made)

    targets = [one.target for one in reported] + list(others)
    tracks = tracker.tracks()
    for t, tracks in play(tracker, [antenna()], targets, seconds, reports=heard, seed=seed):
        for one in reported:
            mine = by_address(tracks, one.address)
            numbers[one.address] |= set(mine.id.tolist())
            begin = max(one.since, one.target.born)
            if t >= begin + settled:
                assert len(mine) == 1, f"{len(mine)} tracks of {one.address} at {t} s"
                errors[one.address].append(off(mine, one.target))
        if all(t >= max(one.since, one.target.born) + settled for one in reported):
            assert len(tracks) == len(targets), f"{len(tracks)} tracks of {len(targets)} targets at {t} s"
    return Watched(errors, numbers, tracks, tracker)


@pytest.mark.parametrize("sd", [5.0, 10.0])
@pytest.mark.parametrize("latency", LATENCIES)
def test_a_landing_aircraft_is_one_track_although_its_reports_are_late(latency: float, sd: float) -> None:
    """At 70 m/s, 0.5 s are 35 m along the track."""
    for seed in range(4):
        aircraft = Reported(Target(landing(), 38, 30, 0.95), "39abcd", latency, sd=sd)
        seen = watch([aircraft], seed=seed)
        assert len(seen.numbers["39abcd"]) == 1
        assert np.percentile(seen.errors["39abcd"], 95) < 15
        assert not seen.tracker.counters.get("identity_moved")


@pytest.mark.parametrize("latency", LATENCIES)
def test_an_arrival_known_by_reports_keeps_its_number_when_the_radar_comes_in(latency: float) -> None:
    """The radar sees it from the threshold on; until then its reports alone know it."""
    for seed in range(4):
        target = Target(landing(-2000.0), 38, 30, 0.95)
        seen_by_radar = replace(target, hidden=((0.0, 8.0),))
        seen = watch([Reported(seen_by_radar, "39abcd", latency)], seed=seed, settled=16.0, seconds=38.0)
        assert len(seen.numbers["39abcd"]) == 1
        assert np.percentile(seen.errors["39abcd"], 95) < 15


@pytest.mark.parametrize("latency", LATENCIES)
def test_reports_that_begin_late_name_the_radar_track_of_a_fast_target(latency: float) -> None:
    """No second track is shown for longer than it takes to see that both move alike."""
    for seed in range(4):
        aircraft = Reported(Target(landing(), 38, 30, 0.95), "39abcd", latency, since=12.0)
        seen = watch([aircraft], seed=seed)
        assert np.percentile(seen.errors["39abcd"], 95) < 15
        assert seen.tracks.id.tolist() == [1]


@pytest.mark.parametrize("latency", [0.5, 1.0])
def test_several_aircraft_of_a_late_source_are_a_track_each(latency: float) -> None:
    """Landings one after the other, a taxiing and a standing aircraft."""
    fleet = [
        Reported(Target(landing(), 38, 30, 0.95), "aaaaa1", latency),
        Reported(Target(landing(-1200, 300, begins=20.0), 45, 40, 0.95, born=20.0), "aaaaa2", latency, since=20.0),
        Reported(Target(line(900, -300, -12, 3), 38, 30, 0.95), "aaaaa3", latency),
        Reported(Target(line(-400, -500, 0, 0), 38, 30, 0.95), "aaaaa4", latency),
        Reported(Target(line(-600, 700, 15, -15), 38, 30, 0.95), "aaaaa5", latency),
    ]
    for seed in range(3):
        seen = watch(fleet, seed=seed, seconds=45.0)
        for one in fleet:
            assert len(seen.numbers[one.address]) == 1, one.address
            assert np.percentile(seen.errors[one.address], 95) < 15, one.address


@pytest.mark.parametrize("latency", [0.5, 1.0])
def test_a_source_in_time_stays_right_beside_a_late_one(latency: float) -> None:
    """Vehicles whose beacons are in time are not shifted by what the aircraft's source is late by."""
    pair = [
        Reported(Target(landing(), 38, 30, 0.95), "aaaaa1", latency),
        Reported(Target(line(-600, 700, 25, -25), 38, 30, 0.95), "aaaaa2", latency),
    ]
    prompt = [
        Reported(Target(line(-800, -400, 25, 0), 6, 3, 0.95), "bbbbb1", source=1, sd=3.0),
        Reported(Target(line(800, -500, -20, 0), 6, 3, 0.95, hidden=((12.0, 99.0),)), "bbbbb2", source=1, sd=3.0),
    ]
    for seed in range(3):
        seen = watch(pair + prompt, seed=seed)
        for one in pair + prompt:
            assert len(seen.numbers[one.address]) == 1, one.address
            limit = 8 if one.source else 15
            assert np.percentile(seen.errors[one.address], 95) < limit, one.address


@pytest.mark.parametrize("behind", [True, False])
def test_a_car_near_a_late_aircraft_is_not_taken_for_its_echo(behind: bool) -> None:
    """60 m behind or 40 m ahead of an aircraft at 40 m/s whose reports are 20 m late: both stay what they are."""
    aircraft = Target(line(-700, 300, 40, 0), 38, 30, 0.95)
    car = Target(line(-760 if behind else -660, 300, 40, 0), 6, 3, 0.95)
    for seed in range(4):
        seen = watch([Reported(aircraft, "39abcd", 0.5)], [car], seed=seed)
        assert np.percentile(seen.errors["39abcd"], 95) < 15
        assert len(seen.numbers["39abcd"]) == 1
