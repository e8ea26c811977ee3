"""Recorded reports through the tracker, on a recording made here."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.lab.evaluate import RecordedReports, Trial
from pipeline.lab.evaluate.reported_tracks import SAID, ReportedTracks, reports_of, said, visits
from pipeline.lab.simulate.recording import Recording
from pipeline.lab.simulate.traffic import Trajectory
from pipeline.tables import TargetReports

SECONDS = 40


def trajectory(address: str, east: float, north: float, speed: float, begins: float = 0.0) -> Trajectory:
    """Eastward from (east, north)."""
    time = np.arange(SECONDS, dtype=np.float64)
    same = np.ones(SECONDS)
    return Trajectory(
        address, "TEST1", begins + time, east + speed * time, north * same, 0.0 * same, np.pi / 2 * same, speed * same,
        same > 0,
    )  # fmt: skip


RECORD = Recording("TEST", 1.6e9, 100.0, (trajectory("aaaaa1", -300, 100, 15), trajectory("aaaaa2", 0, -400, 3, 5.0)))
REPORTS = RecordedReports(reports_of(RECORD), smoothed=True, name="made here")


def clock(step: float = 0.5) -> Callable[[], float]:
    """Each look is `step` s after the one before."""
    ticks = itertools.count()
    return lambda: next(ticks) * step


def trial(experiment: ReportedTracks, what: str) -> Trial:
    return experiment.trial(np.random.default_rng(1), SAID.index(what), clock())


def test_a_record_is_reported_once_a_second_in_order_of_time() -> None:
    reports = REPORTS.reports
    assert len(reports) == 2 * SECONDS
    assert (np.diff(reports.time) >= 0).all()
    assert reports.time[0] == 1.6e9
    slow = reports[reports.address == "aaaaa2"]
    assert (slow.time[0], slow.east[-1], slow.north[0]) == (1.6e9 + 5.0, 3.0 * (SECONDS - 1), -400.0)
    np.testing.assert_allclose(slow.speed, 3.0)
    assert (reports.source == "traffic-record").all()
    np.testing.assert_allclose(slow.course, np.pi / 2, rtol=1e-6)


def test_without_a_course_every_report_has_its_track_and_nothing_moves() -> None:
    found = trial(ReportedTracks(reports=REPORTS), "no course")
    assert (found["reports"], found["visits"], found["numbers"]) == (2 * SECONDS, 2, 2)
    assert found["identity_moved"] == found["report_implausible"] == 0
    # a track is told from its second or third report on
    assert found["without"] <= 6
    assert len(found["off"]) + found["without"] == 2 * SECONDS
    assert 0.5 < np.percentile(found["off"], 95) < 10
    assert found["hours"] == pytest.approx(44 / 3600)
    assert found["seconds"] == 0.5 * 45


def test_what_is_said_of_course_and_speed() -> None:
    chance, given = np.random.default_rng(1), REPORTS.reports
    assert said(given, "as recorded", chance) is given
    assert np.isnan(said(given, "no course", chance).course).all()
    np.testing.assert_allclose(said(given, "course reversed", chance).course, 1.5 * np.pi, rtol=1e-6)
    random = said(given, "course random", chance).course
    assert random.min() < 1
    assert 5 < random.max() < 2 * np.pi
    assert (said(given, "speed zero", chance).speed == 0).all()
    np.testing.assert_allclose(said(given, "speed doubled", chance).speed, 2 * given.speed)
    with pytest.raises(ValueError, match="sideways"):
        said(given, "sideways", chance)


def test_a_visit_ends_with_ten_silent_seconds() -> None:
    time = np.array([0.0, 10.0, 20.5, 0.0, 5.0, 7.0])
    address = np.array(["a", "a", "a", "b", "b", ""])
    reports = TargetReports.build(6, time=time, address=address, east=0.0, north=0.0)
    assert visits(reports[np.argsort(time, kind="stable")]) == 3
    assert visits(reports[:0]) == 0


def test_the_rows_tell_shares_and_moves_an_hour() -> None:
    experiment = ReportedTracks(reports=REPORTS)
    results = [trial(experiment, what) for what in SAID]
    results[1] = {**results[1], "identity_moved": np.array(1)}
    results[3] = {**results[3], "identity_moved": np.array(3), "report_implausible": np.array(8)}
    rows = {row.name: row for row in experiment.rows(results)}
    assert len(rows) == 6 * len(SAID)
    assert rows["course random: identity moves"].measured == pytest.approx(3 * 3600 / 44)
    assert rows["course random: identity moves"].wanted == pytest.approx(3600 / 44)
    assert rows["no course: identity moves"].wanted is None
    assert rows["course random: implausible reports"].measured == pytest.approx(10.0)
    assert rows["no course: numbers a visit"].measured == 1
    assert rows["no course: time a report"].measured == pytest.approx(0.5 * 45 / 80 * 1e6)
    assert not rows["no course: time a report"].repeatable
    assert len(experiment.figures(results)[0].lines) == len(SAID)


def test_far_high_and_late_reports_are_left_out_and_noise_is_added_to_smoothed_ones_only() -> None:
    far = replace(REPORTS, reports=REPORTS.reports.replace(east=REPORTS.reports.east + 20_000.0))
    high = replace(REPORTS, reports=REPORTS.reports.replace(altitude=900.0))
    for left_out in (far, high):
        with pytest.raises(ValueError, match="made here has no target reports near"):
            trial(ReportedTracks(reports=left_out), "no course")
    assert trial(replace(ReportedTracks(reports=REPORTS), longest_s=9.5), "no course")["reports"] == 15
    exact = replace(REPORTS, smoothed=False)
    assert np.percentile(trial(ReportedTracks(reports=exact), "no course")["off"], 95) < 0.1


def test_it_says_that_it_needs_a_recording_and_is_short_when_quick() -> None:
    with pytest.raises(ValueError, match="--file"):
        trial(ReportedTracks(), "no course")
    assert ReportedTracks().quick().longest_s == 600.0
