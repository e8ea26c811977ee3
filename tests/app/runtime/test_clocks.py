"""What the shell does with the clocks of its sources: words, states, and several senders in one message."""

import numpy as np
import pytest

from app.contract import RefusedRow
from app.runtime.clocks import (
    MOST_SENDERS,
    REFUSED_TOLD_S,
    SENDER_KEPT_S,
    SENDER_SHOWN_S,
    WORDS_EVERY_S,
    FeedTimes,
    RadarTimes,
)
from app.runtime.host_clock import HostClock
from app.settings_sources import ClockSettings
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
    good, refused = feed.judge(reports(3600.0, -0.2, 3601.0), NOW)
    assert good.time.tolist() == [NOW - 0.2]
    assert good.arrival.tolist() == [NOW]
    assert refused == (
        RefusedRow(0, "ahead", "time is 3,600 s ahead of this host: local time?"),
        RefusedRow(2, "ahead", "time is 3,601 s ahead of this host: local time?"),
    )
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
    good, refused = feed.judge(events, NOW)
    assert good.node.tolist() == [0, 0, 1]
    assert good.time.tolist() == pytest.approx([NOW, NOW - 0.1, NOW])
    assert refused == (RefusedRow(1, "ahead", "B2: time is 18 s ahead of this host: GPS time?"),)
    assert feed.words() == "B2 1 event ahead 18 s refused: GPS time?"


def addressed(address: list[str], *offsets: float, at: float = NOW) -> TargetReports:
    return TargetReports.build(len(offsets), time=at + np.array(offsets), east=0.0, north=0.0, address=address)


def test_a_wrong_clock_of_one_address_does_not_move_the_times_of_the_others() -> None:
    feed = FeedTimes("report", ClockSettings())
    for second in range(30):
        now = NOW + second
        good, refused = feed.judge(addressed(["39abcd", "39ffff", ""], -0.1, 4.5, -0.2, at=now), now)
        assert refused == ()
        assert good.time.tolist() == pytest.approx([now - 0.1, now, now - 0.2])
    assert feed.shown(state()).clock_offset_s == 4.5


def test_who_was_refused_is_said_or_how_many() -> None:
    steady = Steady()
    feed = FeedTimes("report", ClockSettings(), steady=steady)
    _, refused = feed.judge(addressed(["39ffff", "39abcd", "39ffff"], 18.0, 0.0, 18.0), NOW)
    told = "39ffff: time is 18 s ahead of this host: GPS time?"
    assert refused == (RefusedRow(0, "ahead", told), RefusedRow(2, "ahead", told))
    assert feed.words() == "39ffff 2 reports ahead 18 s refused: GPS time?"
    steady.now += WORDS_EVERY_S
    feed.judge(addressed(["39abcd"], 18.0), NOW)
    assert feed.words() == "3 reports of 2 senders ahead 18 s refused: GPS time?"
    for _ in range(20):
        steady.now += WORDS_EVERY_S
        feed.judge(addressed(["39ffff", "39abcd"], 3600.0, 0.0), NOW)
    assert feed.words() == "39ffff 22 reports ahead 3,600 s refused: local time?", "39abcd is long since in order"


def test_addresses_that_are_gone_are_forgotten_and_made_up_ones_do_not_fill_the_memory() -> None:
    steady = Steady()
    feed = FeedTimes("report", ClockSettings(), steady=steady)
    feed.judge(addressed(["39ffff"], 4.5), NOW)
    for first in range(0, MOST_SENDERS + 2000, 1000):
        feed.judge(addressed([f"{first + i:06x}" for i in range(1000)], *[0.0] * 1000), NOW)
        assert len(feed._senders) <= MOST_SENDERS
    feed.judge(addressed(["39ffff"], 4.5), NOW)
    steady.now += SENDER_KEPT_S + 1.0
    assert feed.shown(state()).clock_offset_s is None
    feed.judge(addressed(["39ffff"], 4.5), NOW)
    steady.now += SENDER_SHOWN_S + 1.0
    feed.judge(addressed(["39abcd"], 0.0), NOW)
    assert feed.shown(state()).clock_offset_s == 0.0, "what is shown is of those that still speak"
    events = FeedTimes("event", ClockSettings(), ["A1"], steady=steady)
    events.judge(NodeEvents.build(1, node=0, time=NOW - 0.5), NOW)
    steady.now += SENDER_KEPT_S + 1.0
    assert events.shown(state()).clock_offset_s == -0.5, "a node is rarely passed"


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
