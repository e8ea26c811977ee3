"""What the shell does with the clocks of its sources: words, states, and several senders in one message."""

import numpy as np
import pytest

from app.runtime.clocks import REFUSED_TOLD_S, WORDS_EVERY_S, FeedTimes, RadarTimes
from app.runtime.host_clock import HostClock
from app.settings import ClockSettings
from pipeline.picture import SensorState
from pipeline.tables import NodeEvents, TargetReports
from tests.app.runtime.small_radar import small_site, turn

NOW = 1.8e9


class Steady:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def reports(*offsets: float) -> TargetReports:
    return TargetReports.build(len(offsets), time=NOW + np.array(offsets), east=0.0, north=0.0)


def state() -> SensorState:
    return SensorState("reports", "report", "ok", NOW, counters={"taken": 1})


def test_refused_reports_make_their_source_degraded_for_a_while() -> None:
    steady = Steady()
    feed = FeedTimes("report", ClockSettings(), steady=steady)
    good, refused, why = feed.judge(reports(3600.0, -0.2, 3601.0), NOW)
    assert good.time.tolist() == [NOW - 0.2]
    assert good.arrival.tolist() == [NOW]
    assert refused == {"ahead": 2}
    assert why == "time is 3,600 s ahead of this host: local time?"
    shown = feed.shown(state())
    assert (shown.status, shown.detail) == ("degraded", "2 reports ahead 3,600 s refused: local time?")
    assert shown.counters == {"taken": 1, "refused_ahead": 2, "clock_steps": 0}
    assert shown.clock_offset_s == -0.2
    feed.judge(reports(3600.0), NOW)
    assert feed.words().startswith("2 "), "the figures do not change at every word"
    steady.now += WORDS_EVERY_S
    assert feed.words().startswith("3 ")
    steady.now += REFUSED_TOLD_S
    assert (feed.shown(state()).status, feed.words()) == ("ok", "")
    feed.judge(reports(-9.0), NOW)
    assert feed.words() == "1 report behind 9.0 s refused"


def test_each_node_has_its_own_clock() -> None:
    feed = FeedTimes("event", ClockSettings(), ["A1", "B2"])
    events = NodeEvents.build(4, node=[0, 1, 0, 1], time=NOW + np.array([0.7, 18.0, 0.6, 0.0]))
    good, refused, why = feed.judge(events, NOW)
    assert good.node.tolist() == [0, 0, 1]
    assert good.time.tolist() == pytest.approx([NOW, NOW - 0.1, NOW])
    assert refused == {"ahead": 1}
    assert why == "B2: time is 18 s ahead of this host: GPS time?"
    assert feed.words() == "B2 1 event ahead 18 s refused: GPS time?"


def test_a_radar_of_another_year_is_corrected_and_said() -> None:
    host = HostClock(lambda: NOW, lambda: 0.0)
    times = RadarTimes(small_site(), ClockSettings(), host)
    blocks = [times.correct(block) for block in turn(0)]
    assert all(abs(block.time[-1] - NOW) < 0.6 for block in blocks)
    assert all(block.arrival == NOW for block in blocks)
    assert "3 years behind" in times.words() and times.words().endswith(": corrected")  # noqa: PT018
    shown = times.shown(SensorState("smr-1", "radar", "ok", NOW))
    assert shown.clock_offset_s == pytest.approx(1.7e9 - NOW, abs=1.0)
    assert shown.counters["time_rebased"] == 1
