"""What a look without a plot does to a track, and when a plot is too old or too new for the turn of its radar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.lifecycle.m_of_n import MOfN
from pipeline.tables import SectorPlots
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import RADAR, T0, A, Target, line, make_plots, make_tracker, run

PLACE = np.array([300.0, -400.0])


def seen_in(scans: list[int], total: int, tracker: Tracker) -> Tracker:
    """A standing target that the radar detects in these turns only."""
    hidden = tuple((float(k), k + 1.0) for k in range(total) if k not in scans)
    return run(tracker, [Target(line(*PLACE, 0, 0), 6, 3, hidden=hidden)], total, sd=1.0)


def test_the_history_holds_hits_and_misses_in_the_order_of_the_looks() -> None:
    store = seen_in([0, 1, 3, 4, 7], 9, make_tracker()).save()["store"]
    radar, node, report = (
        {name: column[:, k].tolist() for name, column in store["evidence"].items()} for k in range(3)
    )
    assert [f"{one:b}" for one in radar["history"]] == ["110110010"]
    assert (radar["looks"], store["rows"]["hits"].tolist(), radar["misses"]) == ([9], [5], [1])
    for other in (node, report):
        assert (other["history"], other["looks"], other["misses"], other["score"]) == ([0], [0], [0], [0.0])


def test_what_is_seen_in_every_second_turn_is_not_four_of_six() -> None:
    """Three of six looks: each such track ends unconfirmed, for its misses are looks, too."""
    tracker = seen_in(list(range(0, 24, 2)), 24, make_tracker(lifecycle=MOfN()))
    assert "confirmed" not in tracker.counters


@pytest.mark.parametrize(("scans", "confirmed"), [([0, 1, 3, 5], 1), ([0, 1, 3], 0), ([0, 1, 2, 3], 1)])
def test_four_of_six_looks_confirm_whatever_misses_lie_between(scans: list[int], confirmed: int) -> None:
    tracker = seen_in(scans, 6, make_tracker(lifecycle=MOfN()))
    assert tracker.counters.get("confirmed", 0) == confirmed


def with_period(period: float) -> Tracker:
    """A tracker whose radar has turned ten times and sees a standing target."""
    tracker = make_tracker(radars=(replace(RADAR, video=replace(RADAR.video, period_s=period)),))
    share = np.arctan2(*PLACE) % (2 * np.pi) / (2 * np.pi)
    for turn in range(10):
        plots = make_plots(T0 + (turn + share) * period, [PLACE], 2.0)
        tracker.sector(SectorPlots(0, turn, T0 + (turn + 1) * period, turn * A, (turn + 1) * A, plots))
    return tracker


@pytest.mark.parametrize("period", [0.5, 1.0, 2.5])
@pytest.mark.parametrize(("turns", "refused"), [(0.05, False), (0.45, False), (0.55, True), (2.0, True)])
def test_a_plot_may_be_newer_than_its_sector_by_half_a_turn(period: float, turns: float, refused: bool) -> None:
    tracker = with_period(period)
    sector = T0 + 11 * period
    plots = make_plots(sector + turns * period, [[-600.0, -400.0]], 2.0)
    tracker.sector(SectorPlots(0, 10, sector, 10 * A, 11 * A, plots))
    assert tracker.counters.get("plot_future", 0) == refused


@pytest.mark.parametrize("period", [0.5, 1.0, 2.5])
@pytest.mark.parametrize(("beyond", "refused"), [(-0.1, False), (0.1, True)])
def test_a_plot_may_be_older_than_its_sector_by_a_turn_and_the_allowed_lag(
    period: float, beyond: float, refused: bool
) -> None:
    tracker = with_period(period)
    sector = T0 + 11 * period
    plots = make_plots(sector - 3.0 - period - beyond, [[-600.0, -400.0]], 2.0)
    tracker.sector(SectorPlots(0, 10, sector, 10 * A, 11 * A, plots))
    assert tracker.counters.get("plot_late", 0) == refused
