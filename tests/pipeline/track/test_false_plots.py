"""Where false plots recur, a track needs more to be believed; where they do not, it does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.airport.model import SurfaceKind
from pipeline.tables import Plots
from pipeline.tables.arrays import Floats
from pipeline.track.false_plots import REACH, FalsePlots, learnt_rate
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import RADAR, A, FlatZones, Target, line, make_tracker, run, scan_plots, split_scan


def density(made: FalsePlots, places: Floats) -> Floats:
    """False plots a square metre and turn, as far as learnt, at places (n, 2)."""
    cells = (places - (made.west, made.south)) / made.step - REACH
    return np.array([learnt_rate(made.rate, x, y) for x, y in cells]) / (made.scale * made.step**2)


GRASS = FlatZones(SurfaceKind.GRASS)


def test_the_density_is_that_of_the_plots_given() -> None:
    """One cell gets 0.25 plots a turn at one spot, the rest 40 plots a turn anywhere: the average over 400 turns."""
    rng = np.random.default_rng(1)
    made = FalsePlots.around(RADAR)
    spot = np.array([[333.0, -444.0]])
    for turn in range(400):
        made.turn(turn * A, A)
        if rng.random() < 0.25:
            made.learn(np.array([[*spot[0], 1.0]]))
        made.learn(np.column_stack([rng.uniform(-1000, 1000, (40, 2)), np.ones(40)]))
    everywhere = density(made, rng.uniform(-900, 900, (5000, 2)))
    assert everywhere.mean() == pytest.approx(40 / 2000**2, rel=0.15)
    assert 0.25 / 4 / 12**2 < density(made, spot)[0] < 0.6 / 12**2
    assert density(made, np.array([[2500.0, 0.0], [1e6, 0.0]])).tolist() == [0.0, 0.0]


def test_the_density_fades() -> None:
    made = FalsePlots.around(RADAR)
    made.turn(0, A)
    made.learn(np.array([[0.0, 0.0, 1.0]]))
    assert density(made, np.zeros((1, 2)))[0] == 0.0  # what is learnt counts from the next turn on
    made.turn(A, A)
    before = density(made, np.zeros((1, 2)))[0]
    assert before > 0.0
    made.turn(301 * A, A)
    assert density(made, np.zeros((1, 2)))[0] < 0.02 * before


def blinking(scans: int, zones: FlatZones) -> Tracker:
    """60 spots that answer with one cell in 35 of 100 turns, over 1 km x 1 km."""
    tracker = make_tracker(zones=zones)
    rng = np.random.default_rng(2)
    spots = [Target(line(*rng.uniform(200, 1200, 2), 0, 0), 3, 3, 0.35) for _ in range(60)]
    for scan in range(scans):
        plots = scan_plots(np.random.default_rng((3, scan)), spots, scan, sd=2.0)
        for sector in split_scan(plots.replace(cells=1), scan, 8):
            tracker.sector(sector)
    return tracker


def test_blinking_spots_on_grass_become_no_tracks() -> None:
    tracker = blinking(200, GRASS)
    assert tracker.counters.get("confirmed", 0) <= 2


def person(tracker: Tracker, **words: Any) -> int:
    """Turns until a target of one cell that is found in 7 of 10 turns is reported."""
    target = Target(detection=0.7, length=1, width=1, **words)
    for scan in range(40):
        plots: Plots = scan_plots(np.random.default_rng((9, scan)), [target], scan, sd=2.0)
        for sector in split_scan(plots.replace(cells=1), scan, 8):
            tracker.sector(sector)
        if len(tracker.tracks()):
            return scan
    return 99


def test_a_suitcase_and_a_person_on_the_pavement_are_reported_soon() -> None:
    assert person(make_tracker(), path=line(300, 40, 0, 0)) <= 10
    assert person(make_tracker(), path=line(300, 40, 0, -1.5)) <= 10


def test_a_car_on_grass_is_reported() -> None:
    tracker = run(make_tracker(zones=GRASS), [Target(line(300, 400, 7, 0), 5, 2, 0.9)], 10)
    assert len(tracker.tracks()) == 1


def test_what_is_as_long_as_an_aircraft_is_reported_wherever_it_stands() -> None:
    beside, roof = Target(line(500, 300, 0, 0), 30, 25), Target(line(1000, 1000, 0, 0), 30, 25)
    assert len(run(make_tracker(zones=GRASS), [beside, roof], 12).tracks()) == 2


def test_a_lost_track_is_not_shown_driving_through_a_building() -> None:
    """It is last seen 30 m before the walls (950 m east) and would go on into them."""
    target = Target(line(800, 1000, 12, 0), 6, 3, gone=10.0)
    tracker = run(make_tracker(), [target], 10)
    assert len(tracker.tracks()) == 1
    run(tracker, [target], 4, first=10)
    assert len(tracker.tracks()) == 0
    assert tracker.save()["store"]["rows"]["id"].tolist() == [1]
