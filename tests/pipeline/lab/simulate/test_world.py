from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from app.airports import load_airport
from app.demo.traffic import load_recording
from pipeline.airport.model import Airport
from pipeline.lab.simulate.incidents import approaches, script
from pipeline.lab.simulate.paths import Movement, Paths
from pipeline.lab.simulate.scenes import synthetic_world
from pipeline.lab.simulate.vehicles import distances, lap, service_roads, taxi_runs
from pipeline.lab.simulate.world import World, build_world
from pipeline.tables import TargetClass
from tests.pipeline.lab.simulate.field import airport as field

START = 1_700_000_000.0


@cache
def orly() -> tuple[Airport, World]:
    airport, _ = load_airport("LFPO")
    return airport, build_world(airport, load_recording("LFPO", airport), start=START)


def straight(start: float, seconds: int, name: str = "A320") -> Movement:
    n = seconds + 1
    t = np.arange(n, dtype=float)
    return Movement(
        name, "TST1", "abc123", start, 10 * t, 0 * t, 0 * t, 0 * t + math.pi / 2, 0 * t + 10, np.ones(n, bool),
        np.ones(n, bool), simulated=False,
    )  # fmt: skip


def test_truth_is_interpolated_and_only_of_what_is_there() -> None:
    paths = Paths([straight(5.0, 20)], 100.0)
    assert len(paths.at(4.99)) == 0
    assert len(paths.at(25.0)) == 0
    assert float(paths.at(8.25).east[0]) == pytest.approx(32.5)


def test_at_the_seam_targets_vanish_and_appear_and_never_jump_under_one_id() -> None:
    paths = Paths([straight(0.0, 100), straight(30.0, 40), straight(90.0, 30)], 100.0)
    last: dict[int, float] = {}
    seen: set[int] = set()
    for time in np.arange(50.0, 350.0, 0.25):
        truth = paths.at(float(time))
        now = dict(zip(truth.id.tolist(), truth.east.tolist(), strict=True))
        for id in now.keys() & last.keys():
            assert abs(now[id] - last[id]) < 5.0
        assert not (now.keys() - last.keys()) & seen
        seen |= now.keys()
        last = now
    # one that passes the end of the loop goes on in the next turn
    assert len(paths.at(115.0)) == 2


def test_the_whole_demonstration_loops_without_a_jump() -> None:
    _, world = orly()
    seam = START - world.offset + world.paths.length
    before, after = world.truth(seam - 0.05), world.truth(seam + 0.05)
    _, a, b = np.intersect1d(before.id, after.id, return_indices=True)
    moved = np.hypot(after.east[b] - before.east[a], after.north[b] - before.north[a])
    assert np.all(moved <= 0.1 * before.speed[a] + 0.5)
    assert len(after) > 15


def test_nothing_moves_faster_than_its_kind_can() -> None:
    _, world = orly()
    for second in range(0, 3600, 7):
        now, then = world.truth(START + second), world.truth(START + second + 0.5)
        _, a, b = np.intersect1d(now.id, then.id, return_indices=True)
        pace = np.hypot(then.east[b] - now.east[a], then.north[b] - now.north[a]) / 0.5
        aircraft = now.category[a] == TargetClass.AIRCRAFT
        assert pace[~aircraft].max(initial=0.0) < 16.0
        assert now.speed[a][~aircraft].max(initial=0.0) < 16.0
        assert pace[aircraft].max(initial=0.0) < 125.0


def test_there_is_real_traffic_simulated_vehicles_and_standing_aircraft() -> None:
    _, world = orly()
    truth = world.truth(START + 60.0)
    vehicles = truth.category == TargetClass.VEHICLE
    assert 10 <= np.sum(vehicles) <= 20
    assert truth.simulated[vehicles].all()
    recorded = ~truth.simulated
    assert np.sum(recorded) >= 8
    assert np.sum(~vehicles & (truth.speed == 0) & ~truth.reporting) >= 5
    assert world.runways == {"06/24": "06", "07/25": "07"}


def test_an_incident_in_every_period_each_with_an_aircraft_that_needs_the_runway() -> None:
    airport, world = orly()
    found = world.incident_times(START, START + 600.0)
    periods = [int((one.nominal - world.offset - 45.0) % 3600.0 // 90.0) for _, one in found]
    assert periods[:6] == [0, 1, 2, 3, 4, 5]
    for time, incident in found:
        assert min((time - START - 45.0) % 90.0, (START + 45.0 - time) % 90.0) <= 30.0
        hold = next(one for one in airport.holding_positions if one.id == incident.hold)
        runway = airport.runway(incident.runway)
        assert hold.runway == runway.id
        into = np.array([math.sin(hold.heading), math.cos(hold.heading)])

        def vehicle(at: float, callsign: str = incident.vehicle.callsign) -> np.ndarray:
            truth = world.truth(at)
            (row,) = np.flatnonzero(truth.callsign == callsign)
            assert truth.simulated[row]
            return np.array([truth.east[row], truth.north[row]])

        here = np.array([hold.position.x, hold.position.y])
        assert (vehicle(time - 2.0) - here) @ into < -3.0
        assert abs((vehicle(time) - here) @ into) < 1.0
        assert (vehicle(time + 2.0) - here) @ into > 3.0
        # it does reach the runway
        last = max(range(60), key=lambda s: float((vehicle(time + s) - here) @ into) if s < 35 else -1.0)
        from shapely.geometry import Point

        assert runway.strip.covers(Point(vehicle(time + last)))
        use = incident.use
        truth = world.truth(time)
        end = runway.end(use.end)
        forward = (truth.east - end.threshold.x) * math.sin(end.heading)
        forward += (truth.north - end.threshold.y) * math.cos(end.heading)
        across = (truth.east - end.threshold.x) * math.cos(end.heading)
        across -= (truth.north - end.threshold.y) * math.sin(end.heading)
        aligned = np.cos(truth.heading - end.heading) > 0.97
        aircraft = (truth.category == TargetClass.AIRCRAFT) & aligned & (np.abs(across) < 250.0) & (truth.speed > 14.0)
        on_final = (forward < 0) & (-forward / np.maximum(truth.speed, 1.0) < 62.0)
        rolling = (forward >= 0) & truth.on_ground
        assert np.any(aircraft & (on_final | rolling))


def test_the_first_incident_meets_a_recorded_arrival_after_45_seconds() -> None:
    _, world = orly()
    (time, first), *_ = world.incident_times(START, START + 120.0)
    assert time == pytest.approx(START + 45.0)
    assert first.arrival is None
    assert 25.0 <= first.use.to_threshold <= 45.0


def test_incidents_repeat_with_the_loop() -> None:
    _, world = orly()
    first = [one.hold for _, one in world.incident_times(START, START + 900.0)]
    again = [one.hold for _, one in world.incident_times(START + 7200.0, START + 8100.0)]
    assert first == again


def test_without_recorded_traffic_the_arrival_is_simulated_and_goes_around() -> None:
    airport = field()
    (one,) = script([], airport, 90.0, 45.0, 90.0)
    assert one.arrival is not None
    assert one.arrival.simulated
    assert one.arrival.altitude.min() > 20.0
    assert not one.arrival.on_ground.any()
    assert len(approaches(airport)) == 1


def test_an_airport_without_holds_has_no_incident() -> None:
    airport = field()
    bare = Airport(airport.icao, "", airport.frame, airport.runways, (), airport.features, airport.graph)
    assert script([], bare, 3600.0, 45.0, 90.0) == []


def test_vehicles_keep_off_the_runways() -> None:
    airport = field()
    for road in service_roads(airport) + taxi_runs(airport, np.random.default_rng(1), 3):
        assert all(road.distance(one.strip) > 50.0 for one in airport.runways)


def test_a_drive_begins_and_ends_at_rest_and_keeps_the_limits() -> None:
    run = distances(200.0, 8.0, 1.5)
    assert (run[0], run[-1]) == (0.0, 200.0)
    pace = np.diff(run)
    assert pace.max() <= 8.0 + 1e-9
    assert np.abs(np.diff(pace)).max() <= 1.5 + 1e-9


def test_laps_fill_the_loop_exactly_and_close() -> None:
    airport = field()
    (road,) = service_roads(airport)
    east, north, _, _ = lap(road, 1000, np.random.default_rng(2), 8.0, back=False)
    assert len(east) == 1000
    assert math.hypot(east[0] - east[-1], north[0] - north[-1]) < 12.0


def test_round_after_round_the_speed_is_that_of_the_positions() -> None:
    (road,) = service_roads(field())
    east, north, heading, pace = lap(road, 1000, np.random.default_rng(2), 8.0, back=False)
    assert 2 * road.length < 1000 * 8.0  # more than one round
    moved = np.hypot(np.diff(east), np.diff(north))
    # a chord over a corner is shorter than the way
    assert np.abs((pace[1:] + pace[:-1]) / 2 - moved).max() < 4.0
    straight = moved > 6.0
    course = np.arctan2(np.diff(east), np.diff(north))
    turned = np.angle(np.exp(1j * (course - heading[:-1])))[straight]
    assert np.percentile(np.abs(turned), 90) < 0.2


@pytest.mark.parametrize("count", [50, 300])
def test_synthetic_worlds_have_the_wanted_size_and_move(count: int) -> None:
    airport, _ = orly()
    world = synthetic_world(airport, count, 3, start=START)
    now, then = world.truth(START + 10.0), world.truth(START + 40.0)
    assert len(now) == count
    assert len(set(now.address.tolist())) == count
    assert np.mean(np.hypot(then.east - now.east, then.north - now.north) > 20.0) > 0.4
    same = synthetic_world(airport, count, 3, start=START).truth(START + 10.0)
    np.testing.assert_array_equal(now.east, same.east)
