"""The head of the panel beside the 3D scene."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from app.contract import ReplayState
from app.view3d import View3D
from app.view3d.panel import status
from tests.app.view3d.pictures import picture, tracks
from tests.support.fake_replay import BEGIN, FakeReplay
from tests.support.running import until
from tests.support.small_airport import small_airport


def stands(playing: bool, speed: float = 1.0) -> ReplayState:
    return ReplayState("a.mcap", 0.0, 2000.0, 1000.0, playing, speed)


def test_a_replay_shows_date_and_time_of_what_is_shown() -> None:
    shown = status(small_airport(), "replay", picture(tracks([1])), 0.1, stands(True, 4.0))
    assert "REPLAY 1970-01-01 00:16:40 UTC" in shown
    assert "not live, 4 times the recorded pace" in shown
    assert "REPLAY 1970-01-01 00:16:40 UTC" in status(small_airport(), "replay", None, None, stands(False))
    assert "REPLAY" not in status(small_airport(), "live", picture(tracks([1])), 0.1)


def test_a_paused_replay_is_not_a_lost_feed() -> None:
    of = small_airport(), "replay", picture(tracks([1])), 60.0
    paused = status(*of, stands(False))
    assert "FEED LOST" not in paused
    assert "paused" in paused
    assert "FEED LOST" in status(*of, stands(True))
    assert "FEED LOST" in status(*of)


def test_a_slow_replay_has_more_time_to_the_next_picture() -> None:
    of = small_airport(), "replay", picture(tracks([1]))
    assert "FEED LOST" not in status(*of, 20.0, stands(True, 0.1))
    assert "FEED LOST" in status(*of, 40.0, stands(True, 0.1))
    assert "FEED LOST" in status(*of, 4.0, stands(True, 16.0))


@pytest.fixture
def replay() -> FakeReplay:
    return FakeReplay(playing=False)


@pytest.fixture
def view(replay: FakeReplay) -> Iterator[View3D]:
    made = View3D(small_airport(), "replay", period_s=0.05, replay=replay)
    made.start()
    assert made.ready.wait(30)
    yield made
    made.stop()


def test_the_view_asks_where_the_replay_stands_and_counts_the_age_from_the_end_of_a_pause(
    view: View3D, replay: FakeReplay, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.view3d.view.IDLE_S", 0.1)
    view.update(picture(tracks([1])))
    until(lambda: view.counters().get("shown", 0) >= 1, "the picture is shown")
    view._arrived -= 60.0
    until(lambda: time.monotonic() - view._arrived < 30.0, "the age counts from now while it is paused")
    assert "paused" in view._status.content
    replay.steer(playing=True, time=BEGIN + 5)
    until(lambda: "times the recorded pace" in view._status.content, "it is said that it goes on")
    assert "FEED LOST" not in view._status.content
