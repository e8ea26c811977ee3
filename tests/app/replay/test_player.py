"""The player: play, pause, wind, at another pace; at the end and at damage it stands still and says so."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.contract import Refused, UnknownId
from app.journal.reader import open_journal
from app.replay.player import JournalPlayer, _Pace, journal_gaps
from app.replay.recorded import recorded_run
from app.replay.service import ReplayService
from pipeline.engine_records import OUTPUT
from pipeline.picture import AlertChange, Picture
from pipeline.tables import NodeEvents, TargetReports
from tests.app.replay.recording import Recording, clock_step, decoded, eventful, record, records, rewritten, shifted
from tests.pipeline.track.scene import T0
from tests.support.engines import minute
from tests.support.running import until

LENGTH = 24


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("day"), eventful(scans=LENGTH))


class Watched:
    """A player, and what its listeners hear: pictures, alert changes, and "anew" after every seek."""

    def __init__(self, path: Path, speed: float = 1.0, **words: Any) -> None:
        self.heard: list[Picture | str] = []
        self.changes: list[AlertChange] = []
        given = {"change": lambda run: run, "window": (None, None), **words}
        self.player = JournalPlayer(
            open_journal(path), speed=speed, begin_anew=lambda: self.heard.append("anew"), **given
        )
        self.player.listen(self.hear)

    def hear(self, picture: Picture, changes: tuple[AlertChange, ...]) -> None:
        self.heard.append(picture)
        self.changes.extend(changes)

    @property
    def pictures(self) -> list[Picture]:
        return [one for one in list(self.heard) if not isinstance(one, str)]

    def at(self) -> float:
        """Seconds of the recording shown now."""
        newest = self.player.newest
        return -1.0 if newest is None else newest.time - T0


@pytest.fixture
def watch() -> Iterator[Callable[..., Watched]]:
    made: list[Watched] = []

    def begin(path: Path, speed: float = 1.0, **words: Any) -> Watched:
        made.append(Watched(path, speed, **words))
        made[-1].player.start()
        return made[-1]

    yield begin
    for one in made:
        one.player.stop()
        assert not one.player.alive


def test_it_plays_every_picture_as_it_was_and_stands_still_at_the_end(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=64.0)
    until(lambda: not made.player.state().playing, "the end")
    shown = [one for one in (decoded(it) for it in records(day) if it.topic == OUTPUT) if one.time == one.time]
    pictures = made.pictures[: len(shown)]
    assert [one.time for one in pictures] == [one.time for one in shown]
    for one, other in zip(pictures, shown, strict=True):
        assert np.array_equal(one.tracks.state, other.tracks.state)
        assert (one.alerts, one.runways) == (other.alerts, other.runways)
    assert made.changes == [change for one in shown for change in one.changes]
    assert made.heard[0] == "anew"
    assert pictures[-1].sensors, "the health of the sensors as recorded"
    state = made.player.state()
    assert (state.time, state.playing, state.speed) == (state.end, False, 64.0)
    assert (state.begin, state.end) == (made.player.begin, open_journal(day).last_time())


def test_at_the_end_it_is_not_busy(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=64.0)
    until(lambda: not made.player.state().playing, "the end")
    before, cpu = len(made.heard), time.process_time()
    until(lambda: len(made.heard) >= before + 3, "the picture is sent again")
    assert time.process_time() - cpu < 0.6, "three pictures in 1.5 s"
    assert len({one.time for one in made.pictures[-3:]}) == 1
    made.player.steer(playing=True)
    until(lambda: made.at() < 5.0, "it plays from the begin")
    assert made.player.state().playing


def test_a_pause_holds_and_goes_on_from_there(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=16.0)
    until(lambda: made.at() > 3.0, "it plays")
    assert made.player.steer(playing=False).playing is False
    until(lambda: len({one.time for one in made.pictures[-3:]}) == 1 and len(made.pictures) > 3, "it stands still")
    held = made.at()
    assert made.player.state().time == pytest.approx(T0 + held, abs=0.3)
    made.player.steer(speed=0.1)
    made.player.steer(playing=True)
    before = len(made.pictures)
    until(lambda: made.at() > held, "it goes on")
    assert 0.0 < made.at() - held < 0.5, "the time it stood still is not made up for"
    assert len(made.pictures) > before


def test_winding_forward_and_back_shows_the_same_pictures(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=64.0)
    until(lambda: not made.player.state().playing, "the end")
    by_time = {one.time: one for one in made.pictures}
    for target in (T0 + 20.0, T0 + 7.3, T0 + 0.3):
        made.heard.clear()
        made.player.steer(time=target)
        assert made.player.state().time == target
        until(lambda: "anew" in made.heard[:-1], "it is there, though it stands still")
        first = made.heard[made.heard.index("anew") + 1]
        assert isinstance(first, Picture)
        assert abs(first.time - target) < 0.4
        assert np.array_equal(first.tracks.state, by_time[first.time].tracks.state)
        assert first.alerts == by_time[first.time].alerts


def test_a_seek_while_it_seeks_is_followed_and_goes_on_playing(
    day: Path, watch: Callable[..., Watched], monkeypatch: pytest.MonkeyPatch
) -> None:
    from app.replay.verify import ReplayEngine

    halfway, go = threading.Event(), threading.Event()
    step = ReplayEngine._step

    def slow(self: Any, record: Any) -> Any:
        if record.time > T0 + 15.0:
            halfway.set()
            assert go.wait(20)
        return step(self, record)

    made = watch(day, speed=1.0)
    until(lambda: made.at() > 0.0, "it plays")
    monkeypatch.setattr(ReplayEngine, "_step", slow)
    made.player.steer(time=T0 + 18.0)
    assert halfway.wait(20)
    made.player.steer(time=T0 + 4.0)
    go.set()
    until(lambda: 3.5 < made.at() < 8.0, "it is at the second place")
    assert made.player.state().playing
    held = made.at()
    until(lambda: made.at() > held, "it goes on")


def test_a_window_is_kept(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=64.0, window=(T0 + 12.0, T0 + 15.0))
    until(lambda: not made.player.state().playing, "the end")
    times = [one.time - T0 for one in made.pictures]
    assert 11.5 < times[0] < 12.1
    assert 14.5 < times[-1] <= 15.0
    with pytest.raises(Refused, match="is outside"):
        made.player.steer(time=T0 + 11.0)
    with pytest.raises(ValueError, match="nothing was recorded in this time"):
        Watched(day, window=(T0 + 100.0, T0 + 120.0))


@pytest.mark.parametrize("speed", [0.0, -1.0, 65.0, float("nan"), float("inf")])
def test_an_impossible_speed_is_refused(day: Path, speed: float) -> None:
    with pytest.raises(Refused, match="speed"):
        Watched(day, speed=speed)
    with pytest.raises(Refused, match="speed"):
        Watched(day).player.steer(speed=speed)


def test_gaps_and_restarts_are_listed_and_the_time_between_is_skipped(
    tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    first = Recording(tmp_path)
    envelopes = list(minute(scans=8))
    first.feed(envelopes[:40])
    first.overflow(envelopes[40:60])
    first.feed(envelopes[60:])
    first.close()
    second = Recording(tmp_path, begin=T0 + 5000.0)
    second.feed(shifted(minute(scans=4), 5000.0))
    second.close()
    gaps = journal_gaps(open_journal(tmp_path))
    assert len(gaps) == 2
    assert gaps[0] == pytest.approx(envelopes[59].arrival, abs=0.01)
    assert gaps[1] == pytest.approx(T0 + 5000.2, abs=0.1)
    made = watch(tmp_path, speed=16.0)
    until(lambda: not made.player.state().playing, "the end, 5000 s later")
    assert made.player.state().gaps == gaps
    assert made.at() > 5003.0


def test_a_clock_that_was_set_does_not_make_it_wait(tmp_path: Path, watch: Callable[..., Watched]) -> None:
    recording = Recording(tmp_path)
    recording.feed(minute(scans=4))
    for step in (3600.0, -1800.0):
        at = recording.recorder._arrival + step
        recording.feed(clock_step(step, at))
        recording.feed(shifted(list(minute(scans=8))[54:], at - T0 - 4.0))
    recording.close()
    made = watch(tmp_path, speed=16.0)
    until(lambda: not made.player.state().playing, "the end")
    assert made.pictures[-1].time == pytest.approx(T0 + 1800.0 + 12.0, abs=2.0)
    assert made.player.failed == ""


def test_a_damaged_journal_stands_still_with_a_reason(day: Path, tmp_path: Path, watch: Callable[..., Watched]) -> None:
    wrong = rewritten(
        day, tmp_path / "a.mcap",
        lambda one: one.data[:-2] if one.topic == "input" and one.time > T0 + 14.0 else one.data,
    )  # fmt: skip
    made = watch(wrong, speed=64.0)
    until(lambda: made.player.failed, "it says why")
    assert "the input at 2023-11-14T22:13:34" in made.player.failed
    assert made.player.alive
    assert made.player.state().playing is False
    assert 13.0 < made.at() < 14.2, "the last good picture stays"
    service = service_of(wrong, made.player)
    state = next(one for one in service.sensors() if one.id == "replay")
    assert (state.status, state.detail) == ("degraded", made.player.failed)
    before, cpu = len(made.heard), time.process_time()
    until(lambda: len(made.heard) >= before + 2, "the picture is sent again")
    assert time.process_time() - cpu < 0.6
    made.player.steer(time=T0 + 3.0)
    until(lambda: 2.0 < made.at() < 5.0, "another place is played")
    assert made.player.failed == ""


def service_of(path: Path, player: JournalPlayer) -> ReplayService:
    (file,) = open_journal(path).files
    return ReplayService(recorded_run(file.attachments(), str(path)), player)


def test_the_service_shows_and_refuses_to_change(day: Path, watch: Callable[..., Watched]) -> None:
    made = watch(day, speed=64.0)
    service = service_of(day, made.player)
    until(lambda: service.readiness().ready, "the first picture")
    assert service.settings.mode == "replay"
    assert service.replay is made.player
    assert [one.id for one in service.radars] == ["smr"]
    until(
        lambda: service.picture() is not None and {one.id for one in service.sensors()} >= {"smr", "replay"}, "it plays"
    )
    told = "this is the replay of a recording: what happened cannot be changed"
    for work in (
        lambda: service.acknowledge(41, "me"),
        lambda: service.set_runway("06/24", open=False, in_use=None, visibility=None),
        lambda: service.submit_sweeps("smr", b""),
        lambda: service.submit_node_events(NodeEvents.empty()),
        lambda: service.submit_target_reports(TargetReports.empty()),
        lambda: service.choose_parts("smr", {}),
        lambda: service.front_end("smr"),
    ):
        with pytest.raises(Refused, match=told):
            work()
    with pytest.raises(Refused, match="not part of a replay"):
        service.video("smr")
    with pytest.raises(UnknownId):
        service.video("nobody")


def test_the_pace_follows_speed_and_forgives_what_cannot_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 50.0
    monkeypatch.setattr("app.replay.player.clocks.monotonic", lambda: now)
    pace = _Pace(T0)
    assert pace.pause(T0 + 1.0, 1.0) == pytest.approx(1.0)
    assert pace.pause(T0 + 1.0, 2.0) == pytest.approx(0.5)
    now = 50.5
    assert pace.pause(T0 + 1.0, 2.0) == 0.0
    assert pace.pause(T0 + 2.0, 2.0) == pytest.approx(0.5)
    now = 60.0
    assert pace.pause(T0 + 2.0, 2.0) == 0.0
    assert pace.pause(T0 + 3.0, 2.0) == pytest.approx(0.5), "ten seconds late are forgiven"
    assert pace.pause(T0 + 4000.0, 1.0) < 5.0, "an hour without records is skipped"
