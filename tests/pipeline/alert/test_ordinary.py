"""What happens at every airport all day must not raise anything."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.alert.monitor import AlertMonitor
from pipeline.picture import RunwayState
from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import Mover, arrival, departure, monitor, parked, play

SEEDS = [None, 1, 2, 3]


@pytest.fixture
def watch() -> AlertMonitor:
    return monitor()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("visibility", ["normal", "low"])
def test_landing_and_vacating_ahead_of_the_next_arrival(seed: int | None, visibility: str) -> None:
    watch = monitor(runways=(RunwayState("09/27", in_use="09", visibility=visibility),))
    played = play(watch, [arrival(1, 60), arrival(2, 160)], 0, 220, noise=seed)
    assert played.changes == []


@pytest.mark.parametrize("seed", SEEDS)
def test_line_up_and_departure(watch: AlertMonitor, seed: int | None) -> None:
    assert play(watch, [departure(2, 100)], 0, 160, noise=seed).changes == []


@pytest.mark.parametrize("seed", SEEDS)
def test_departure_ahead_of_an_arrival_at_ordinary_spacing(watch: AlertMonitor, seed: int | None) -> None:
    played = play(watch, [departure(2, 100), arrival(1, 160)], 0, 240, noise=seed)
    assert played.changes == []


@pytest.mark.parametrize("seed", SEEDS)
def test_crossing_behind_a_departure(watch: AlertMonitor, seed: int | None) -> None:
    crossing = Mover(3, [(0, 0, -200), (120, 0, -120), (150, 0, 200), (200, 0, 300)])
    rolled_past = departure(2, 75)
    assert play(watch, [rolled_past, crossing], 0, 190, noise=seed).changes == []


@pytest.mark.parametrize("seed", SEEDS)
def test_taxiing_parallel_to_the_runway_while_others_land(watch: AlertMonitor, seed: int | None) -> None:
    taxi = Mover(3, [(0, -1500, -180), (150, 1500, -180), (200, 1500, -250)])
    truck = Mover(4, [(0, 1500, -140), (150, -1500, -140)], TargetClass.VEHICLE)
    assert play(watch, [arrival(1, 60), taxi, truck], 0, 150, noise=seed).changes == []


@pytest.mark.parametrize("seed", SEEDS)
def test_waiting_at_the_holding_position(watch: AlertMonitor, seed: int | None) -> None:
    waiting = Mover(3, [(0, 0, -300), (25, 0, -120), (29, 0, -112), (200, 0, -112)])
    van = Mover(4, [(0, 1400, -300), (25, 1400, -105), (28, 1400, -98), (200, 1400, -98)], TargetClass.VEHICLE)
    played = play(watch, [arrival(1, 60), arrival(5, 150), waiting, van], 0, 190, noise=seed)
    assert played.changes == []


def test_a_tow_pair_on_the_runway_is_no_conflict_with_itself(watch: AlertMonitor) -> None:
    tug = Mover(3, [(0, -1000, 0), (50, 0, 0)], TargetClass.VEHICLE)
    towed = Mover(4, [(0, -1030, 0), (50, -30, 0)])
    assert play(watch, [tug, towed], 0, 50).changes == []


def test_one_landing_aircraft_seen_as_two_tracks(watch: AlertMonitor) -> None:
    twin = arrival(7, 60, address="")
    twin.path = [(t, e - 25, n + 5) for t, e, n in twin.path]
    assert play(watch, [arrival(1, 60), twin], 0, 130).changes == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("lag", [0.9, 1.5])
def test_one_landing_aircraft_with_two_transponders(watch: AlertMonitor, seed: int | None, lag: float) -> None:
    # the second one lies behind: through final, braking and the turn off, where the two velocities differ
    twin = arrival(7, 60 + lag, address="39ffff", callsign="")
    assert play(watch, [arrival(1, 60), twin], 5, 130, noise=seed).changes == []


def echo(born: float, speed: float, **extra: Any) -> Mover:
    """A track that begins 90 m ahead of an arrival which touches down at 60 s."""
    return Mover(9, [(61, -1270, 5), (71, -1270 + 10 * speed, 5)], TargetClass.UNKNOWN, {"born": born, **extra})


@pytest.mark.parametrize(
    ("other", "silent_until"),
    [
        (echo(61.0, 45.0), 63.0),
        (echo(50.0, 45.0), 60.0),
        (echo(61.0, 45.0, callsign="AFR9"), 60.0),
        (echo(61.0, 0.0), 60.0),
    ],
    ids=["young", "older", "named", "standing"],
)
def test_only_a_young_unnamed_track_that_moves_with_an_aircraft_may_be_its_echo(
    watch: AlertMonitor, other: Mover, silent_until: float
) -> None:
    lands = Mover(1, [(0, -5630, 0), (100, 1370, 0)], extra={"callsign": "AFR1", "address": "390001"})
    times = [one.time for one in play(watch, [lands, other], 0, 68).changes if one.operation == "raise"]
    assert times
    assert silent_until < min(times) <= silent_until + 2


def test_a_go_around_high_above_an_occupied_runway(watch: AlertMonitor) -> None:
    over = Mover(1, [(0, -5700, 0), (100, 1300, 0)], extra={"altitude": 500.0})
    assert play(watch, [over, parked(3, 0, 0)], 0, 90).changes == []


def test_overflight_across_the_runway(watch: AlertMonitor) -> None:
    across = Mover(1, [(0, 0, -4000), (100, 0, 4000)])
    assert play(watch, [across, parked(3, 300, 0)], 0, 100).changes == []


def test_a_tentative_track_on_the_runway_is_nothing_yet(watch: AlertMonitor) -> None:
    echo = parked(3, 0, 0, TargetClass.UNKNOWN, phase=0)
    assert play(watch, [arrival(1, 60), echo], 0, 130).changes == []


@pytest.mark.parametrize("extra", [{"hits": 2}, {"speed_sd": 40.0}])
def test_a_new_or_wild_track_does_not_count_as_rolling(watch: AlertMonitor, extra: dict[str, float]) -> None:
    wild = Mover(7, [(0, -1000, 0), (20, 400, 5)], TargetClass.UNKNOWN, dict(extra))
    assert play(watch, [wild, parked(3, 800, 0)], 0, 15).changes == []


def test_a_vague_track_near_the_edge_of_the_area(watch: AlertMonitor) -> None:
    vague = parked(3, 0, -78, TargetClass.UNKNOWN, sd=15.0)
    assert play(watch, [arrival(1, 60), vague], 0, 90).changes == []
