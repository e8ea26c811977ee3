"""Radar input that cannot be true: dropped, counted by reason, and the picture stays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.tables import SectorPlots
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, A, make_plots, make_tracker, run, scan_plots, split_scan
from tests.pipeline.track.test_radar import MIXED


class TestBadInput:
    def fed(self) -> Tracker:
        return run(make_tracker(), MIXED, 8)

    @pytest.mark.parametrize("column", ["time", "east", "north", "azimuth", "range", "covariance"])
    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_plots_that_are_no_numbers(self, column: str, value: float) -> None:
        tracker = self.fed()
        plots = make_plots(T0 + 8.5, [[-10.0, -900.0]], 2.0).replace(**{column: value})
        tracker.sector(SectorPlots(0, 8, T0 + 9, 8 * A, 9 * A, plots))
        assert tracker.counters["plot_invalid"] == 1
        assert np.isfinite(tracker.tracks().state).all()

    @pytest.mark.parametrize("cov", [0.0, -4.0, 1e12])
    def test_covariances_that_are_none(self, cov: float) -> None:
        tracker = self.fed()
        plots = make_plots(T0 + 8.5, [[-10.0, -900.0]], 2.0).replace(covariance=cov * np.eye(2))
        tracker.sector(SectorPlots(0, 8, T0 + 9, 8 * A, 9 * A, plots))
        assert tracker.counters["plot_invalid"] == 1

    @pytest.mark.parametrize(("shift", "reason"), [(-60.0, "plot_late"), (60.0, "plot_future")])
    def test_plots_of_another_time(self, shift: float, reason: str) -> None:
        tracker = self.fed()
        plots = make_plots(T0 + 8.5 + shift, [[-10.0, -900.0]], 2.0)
        tracker.sector(SectorPlots(0, 8, T0 + 9, 8 * A, 9 * A, plots))
        assert tracker.counters[reason] == 1

    @pytest.mark.parametrize(
        ("radar", "time", "reason"),
        [(7, 9.0, "sector_unknown_radar"), (0, np.nan, "sector_invalid"), (0, -3600.0, "sector_late")],
    )
    def test_sectors_that_cannot_be_taken(self, radar: int, time: float, reason: str) -> None:
        tracker = self.fed()
        before = tracker.tracks()
        tracker.sector(SectorPlots(radar, 8, T0 + time, 8 * A, 9 * A, make_plots(T0 + time, [[0.0, 900.0]], 2.0)))
        assert tracker.counters[reason] == 1
        np.testing.assert_array_equal(tracker.tracks().state, before.state)

    def test_a_sector_twice_counts_once(self) -> None:
        tracker = self.fed()
        sector = split_scan(scan_plots(np.random.default_rng(0), MIXED, 8), 8, 1)[0]
        tracker.sector(sector)
        before = tracker.tracks()
        tracker.sector(split_scan(scan_plots(np.random.default_rng(0), MIXED, 7), 7, 1)[0])
        assert tracker.counters["sector_late"] == 1
        np.testing.assert_array_equal(tracker.tracks().state, before.state)

    def test_a_radar_that_counts_its_turns_anew_goes_on(self) -> None:
        tracker = self.fed()
        ids = set(tracker.tracks().id.tolist())
        for scan in range(8, 16):
            for sector in split_scan(scan_plots(np.random.default_rng(scan), MIXED, scan), scan, 4):
                back = 8 * A
                tracker.sector(
                    SectorPlots(
                        0, scan - 8, sector.time, sector.closed_from - back, sector.closed_to - back, sector.plots
                    )
                )
        assert tracker.counters["radar_restarted"] == 1
        assert set(tracker.tracks().id.tolist()) == ids

    @pytest.mark.parametrize(
        ("time", "reason"), [(np.nan, "time_invalid"), (np.inf, "time_invalid"), (0.0, "time_backwards")]
    )
    def test_time_that_cannot_be(self, time: float, reason: str) -> None:
        tracker = self.fed()
        tracker.advance(time)
        assert tracker.counters[reason] == 1
        assert len(tracker.tracks()) == len(MIXED)

    def test_an_older_recording_may_follow_once_nothing_is_held(self) -> None:
        tracker = make_tracker()
        tracker.advance(T0 + 1e8)
        run(tracker, MIXED, 8)
        assert len(tracker.tracks()) == len(MIXED)
        tracker.advance(T0 + 100)
        run(tracker, MIXED, 8)
        assert len(tracker.tracks()) == len(MIXED)

    def test_a_flood_of_plots_is_worked_off(self) -> None:
        rng = np.random.default_rng(0)
        tracker = make_tracker(capacity=500)
        for scan in range(3):
            spots = rng.uniform(-400, 400, (3000, 2))
            azimuth = np.arctan2(*spots.T) % (2 * np.pi)
            plots = make_plots(T0 + scan + azimuth / (2 * np.pi), spots, 2.0)
            tracker.sector(SectorPlots(0, scan, T0 + scan + 1, scan * A, (scan + 1) * A, plots))
        assert tracker.counters["no_room"] > 0
        assert len(tracker.tracks()) <= 500
