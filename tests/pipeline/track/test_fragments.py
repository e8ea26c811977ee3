"""An aircraft half in the shadow of a building is seen as nose, wing and tail: that is one track."""

from __future__ import annotations

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.tables import TargetReports, Tracks
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, FlatZones, Target, line, make_tracker, scan_plots, split_scan

APRON = FlatZones(SurfaceKind.APRON)


def pieces(east: float, north: float, detection: float = 0.7) -> list[Target]:
    """Nose, wing and tail of an aircraft that stands heading north."""
    return [Target(line(east, north + off, 0, 0), 4, 3, detection) for off in (-16, 0, 16)]


def feed(tracker: Tracker, targets: list[Target], scans: int, name: tuple[float, float] | None = None) -> Tracks:
    for scan in range(scans):
        for sector in split_scan(scan_plots(np.random.default_rng((4, scan)), targets, scan, sd=1.5), scan, 8):
            tracker.sector(sector)
        if name is not None:
            at = {"time": T0 + scan + 0.99, "address": "3944e0", "east": name[0], "north": name[1], "category": 1}
            tracker.target_reports(TargetReports.build(1, **at, callsign="AFR16PL", speed=0.0))
    return tracker.tracks()


def test_nose_wing_and_tail_on_the_apron_become_one_track_in_the_middle() -> None:
    tracker = make_tracker(zones=APRON)
    tracks = feed(tracker, pieces(400, 300), 40)
    assert len(tracks) == 1
    assert np.hypot(*(tracks.state[0, :2] - (400, 300))) < 8
    assert tracker.counters["fragments_joined"] >= 2
    number, confirmed = int(tracks.id[0]), tracker.counters["confirmed"]
    tracks = feed(tracker, pieces(400, 300), 1)
    for scan in range(40, 90):
        plots = scan_plots(np.random.default_rng((4, scan)), pieces(400, 300), scan, sd=1.5)
        for sector in split_scan(plots, scan, 8):
            tracker.sector(sector)
        assert len(tracker.tracks()) == 1
    assert tracker.tracks().id.tolist() == [number]
    assert tracker.counters["confirmed"] == confirmed  # its fragments start nothing any more


def test_the_fragments_of_a_named_aircraft_are_its_own_anywhere() -> None:
    tracks = feed(make_tracker(), pieces(400, 300), 30, name=(400.0, 300.0))
    assert tracks.callsign.tolist() == ["AFR16PL"]


def test_small_things_apart_on_a_taxiway_stay_apart() -> None:
    assert len(feed(make_tracker(), pieces(400, 300, 0.95), 30)) == 3


def test_two_aircraft_side_by_side_stay_two() -> None:
    tracks = feed(make_tracker(zones=APRON), pieces(400, 300) + pieces(445, 300), 60)
    assert len(tracks) == 2
    assert sorted(np.round(tracks.state[:, 0] / 45).tolist()) == [9, 10]


def test_a_car_that_passes_behind_a_standing_aircraft_stays_itself() -> None:
    aircraft, car = Target(line(400, 300, 0, 0), 36, 30), Target(line(300, 272, 6, 0), 5, 2, 0.95)
    assert len(feed(make_tracker(zones=APRON), [aircraft, car], 30)) == 2


def test_a_second_track_on_a_landing_aircraft_is_soon_gone() -> None:
    """Its reports lag 35 m behind for a while, so that the radar's plots begin a track of their own."""
    target = Target(line(-2500, 200, 72, 0), 38, 30)
    tracker, counts = make_tracker(), []
    for scan in range(30):
        late = 35.0 if scan < 12 else 0.0
        at = {"time": T0 + scan + 0.01, "address": "3944e0", "callsign": "TVF19YP", "category": 1, "on_ground": False}
        place = {"east": -2500 + 72 * (scan + 0.01) - late, "north": 200.0, "speed": 72.0, "course": np.pi / 2}
        tracker.target_reports(TargetReports.build(1, **at, **place, altitude=20.0))
        for sector in split_scan(scan_plots(np.random.default_rng((4, scan)), [target], scan), scan, 8):
            tracker.sector(sector)
        counts.append(len(tracker.tracks()))
    assert max(counts[16:]) == 1
    assert tracker.tracks().callsign.tolist() == ["TVF19YP"]
