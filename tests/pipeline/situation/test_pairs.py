"""Which pairs of tracks are one airframe seen twice."""

from __future__ import annotations

from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.contracts.alert import Situation, SituationSettings
from pipeline.picture import RunwayState
from pipeline.situation.observe import observe
from pipeline.situation.pairs import Pair, watch_pairs
from tests.pipeline.alert.scene import Mover, small_airport, tracks_at

AIRPORT = small_airport()
FRAMES, HOLDS = RunwayFrames.build(AIRPORT), HoldFrames.build(AIRPORT)
Pairs = dict[tuple[int, int], Pair]


def two(first: float, second: float, speeds: tuple[float, float] = (70.0, 68.0)) -> Situation:
    """Two aircraft on the centreline, at these distances east of its middle."""
    movers = [
        Mover(id, [(0.0, east, 0.0), (1.0, east + speed, 0.0)])
        for id, east, speed in zip((9, 4), (first, second), speeds, strict=True)
    ]
    return observe(AIRPORT, FRAMES, HOLDS, tracks_at(movers, 0.0), 0.0, (RunwayState("09/27"),), SituationSettings())


FINAL, APART = two(-3000.0, -2900.0), two(-3000.0, -2500.0)


def test_two_that_come_in_together_for_a_while_are_one_airframe() -> None:
    pairs: Pairs = {}
    found = [watch_pairs(pairs, FINAL, float(clock)) for clock in range(7)]
    assert found == [frozenset()] * 5 + [frozenset({(4, 9)})] * 2


def test_an_arrival_that_comes_down_on_a_departure_is_not_one_airframe_with_it() -> None:
    pairs: Pairs = {}
    on_top = two(-1570.0, -1470.0)
    assert on_top.arrival[0].tolist() == [True, False]
    assert on_top.rolling[0].tolist() == [False, True]
    assert not any(watch_pairs(pairs, on_top, float(clock)) for clock in range(20))


def test_too_far_apart_or_of_too_different_speed_is_not_together() -> None:
    for scene in (APART, two(-3000.0, -2900.0, (70.0, 65.0))):
        pairs: Pairs = {}
        assert not any(watch_pairs(pairs, scene, float(clock)) for clock in range(20))


def test_an_interruption_begins_anew_and_what_is_known_is_kept_for_a_while() -> None:
    pairs: Pairs = {}
    for clock, scene in enumerate([FINAL] * 4 + [APART] * 3 + [FINAL] * 5):
        assert not watch_pairs(pairs, scene, float(clock))
    assert watch_pairs(pairs, FINAL, 12.0)
    assert watch_pairs(pairs, APART, 32.0)
    assert not watch_pairs(pairs, APART, 32.5)
    assert not pairs
