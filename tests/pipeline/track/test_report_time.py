"""Where no radar turns, the times of the reports themselves move the tracker's time."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.tables import TargetReports, TrackPhase
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, make_tracker


def report(tracker: Tracker, t: float, address: str, east: float) -> None:
    tracker.target_reports(TargetReports.build(1, time=T0 + t, address=address, east=east, north=-400.0, accuracy=3.0))


def test_reports_alone_move_the_time_forward_and_never_back() -> None:
    tracker = make_tracker(radars=())
    for t, expected in ((0.0, 0.0), (1.0, 1.0), (0.4, 1.0), (7.5, 7.5), (5.5, 7.5)):
        report(tracker, t, "a", 300.0)
        assert tracker.time == T0 + expected


def test_the_newest_report_of_a_batch_gives_the_time() -> None:
    tracker = make_tracker(radars=())
    batch = TargetReports.build(
        3, time=T0 + np.array([2.0, 3.0, 1.0]), address=np.array(["a", "b", "c"]), accuracy=3.0,
        east=np.array([300.0, 600.0, 900.0]), north=0.0,
    )  # fmt: skip
    assert tracker.target_reports(batch) == 3
    assert tracker.time == T0 + 3.0


@pytest.mark.parametrize(
    ("silence", "phases"),
    [
        (2, [TrackPhase.CONFIRMED, TrackPhase.CONFIRMED]),
        (8, [TrackPhase.COASTING, TrackPhase.CONFIRMED]),
        (22, [TrackPhase.CONFIRMED]),
    ],
)
def test_what_is_not_reported_any_more_coasts_and_ends_while_others_are(silence: int, phases: list[int]) -> None:
    tracker = make_tracker(radars=())
    for t in range(12):
        report(tracker, t, "gone", 300.0)
        report(tracker, t + 0.3, "stays", 900.0)
    for t in range(12, 12 + silence):
        report(tracker, t, "stays", 900.0)
    tracks = tracker.tracks()
    assert tracks.phase.tolist() == phases
    assert tracks.address[-1] == "stays"


def test_a_report_older_than_the_allowed_lag_behind_other_reports_is_late() -> None:
    tracker = make_tracker(radars=())
    report(tracker, 0.0, "a", 300.0)
    report(tracker, 20.0, "b", 900.0)
    report(tracker, 17.1, "b", 900.0)
    assert "report_late" not in tracker.counters
    report(tracker, 16.9, "b", 900.0)
    assert tracker.counters["report_late"] == 1
