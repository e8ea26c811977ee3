"""Commands to the surface thread are answered or refused with words; what enters the engine, enters it in one order."""

from __future__ import annotations

import threading
from typing import Any, cast

import pytest

from app.contract import Refused
from app.runtime.host_clock import HostClock
from app.runtime.surface_worker import SurfaceWorker
from pipeline.engine import Outcome, SurfaceEngine
from pipeline.inputs import Acknowledge, Envelope, SensorHealth, SetRunway, Tick
from pipeline.picture import AlertChange, Picture, SensorState
from pipeline.tables import TargetReports, Tracks
from tests.support.running import until


class Engine:
    """As much of an engine as the thread needs. hold: an acknowledgement waits for it."""

    def __init__(self) -> None:
        self.taken: list[Any] = []
        self.busy, self.go = threading.Event(), threading.Event()

    def step(self, envelope: Envelope) -> Outcome:
        self.taken.append(envelope.body)
        match envelope.body:
            case SetRunway(runway="06/24"):
                return Outcome(Picture(1.0, Tracks.empty()), answer="set")
            case SetRunway():
                return Outcome(refused=KeyError("runway"))
            case Acknowledge():
                self.busy.set()
                assert self.go.wait(20)
                return Outcome()
            case TargetReports():
                raise RuntimeError("broken")
            case Tick():
                return Outcome(Picture(1.0, Tracks.empty()), (cast(AlertChange, "a change"),))
        return Outcome()

    def save(self) -> dict[str, Any]:
        return {}

    def of(self, kind: type[Any]) -> list[Any]:
        return [one for one in self.taken if isinstance(one, kind)]


def worker(limit: int = 4, sensors: Any = tuple, **words: Any) -> tuple[SurfaceWorker, Engine]:
    engine = Engine()
    return SurfaceWorker(cast(SurfaceEngine, engine), sensors, limit, **words), engine


def test_a_command_before_the_start_is_refused_at_once() -> None:
    made, _ = worker()
    with pytest.raises(Refused, match="starting"):
        made.ask(SetRunway("06/24"))


def test_a_command_is_answered_and_its_fault_raised() -> None:
    made, _ = worker()
    made.start()
    assert made.ask(SetRunway("06/24")) == "set"
    with pytest.raises(KeyError):
        made.ask(SetRunway("13/31"))
    made.stop()


def test_a_command_that_gets_no_turn_is_taken_back() -> None:
    made, engine = worker()
    made.start()
    holding = threading.Thread(target=lambda: made.ask(Acknowledge(1, "tower"), 20))
    holding.start()
    assert engine.busy.wait(10)
    with pytest.raises(Refused, match="nothing was done"):
        made.ask(SetRunway("06/24"), timeout=0.05)
    engine.go.set()
    holding.join(20)
    made.stop()
    assert not engine.of(SetRunway)


def test_an_input_that_the_engine_cannot_take_is_counted_and_the_thread_goes_on() -> None:
    made, engine = worker()
    made.start()
    made.offer(TargetReports.empty())
    until(lambda: made.failures == 1, "the failure is counted")
    ticks = len(engine.of(Tick))
    until(lambda: len(engine.of(Tick)) > ticks, "time goes on")
    made.stop()


class Broken:
    """A recorder that fails at everything."""

    def before(self, envelope: Envelope, save: Any) -> None:
        raise MemoryError("no room for a snapshot")

    def after(self, outcome: Outcome) -> None:
        raise ValueError("cannot be encoded")

    def sensors(self, states: tuple[SensorState, ...]) -> None:
        raise OSError("no disk")


def test_a_recorder_that_fails_keeps_nothing_from_engine_and_displays() -> None:
    made, engine = worker(recorder=Broken())
    heard: list[Any] = []
    made.listen(lambda picture, changes: heard.append((picture, changes)))
    made.start()
    assert made.ask(SetRunway("06/24")) == "set"
    until(lambda: len(engine.of(Tick)) >= 2 and len(heard) >= 2, "pictures go on")
    made.stop()
    assert made.failures > 0


def test_no_alert_change_is_lost_where_only_the_newest_picture_is_sent() -> None:
    made, engine = worker()
    heard: list[Any] = []
    made.listen(lambda _picture, changes: heard.extend(changes))
    made.start()
    until(lambda: len(engine.of(Tick)) >= 3, "three ticks passed")
    made.stop()
    assert len(heard) == len(engine.of(Tick))


def test_the_engine_hears_when_the_health_of_a_radar_changes_and_only_then() -> None:
    status = ["ok"]
    made, engine = worker(sensors=lambda: (SensorState("smr-1", "radar", status[0], None),))
    made.start()
    until(lambda: len(engine.of(Tick)) >= 2, "ticks pass")
    assert engine.of(SensorHealth) == []
    status[0] = "silent"
    until(lambda: engine.of(SensorHealth) == [SensorHealth(("smr-1",))], "the engine knows")
    status[0] = "ok"
    until(lambda: len(engine.of(SensorHealth)) == 2, "the engine knows that it is well again")
    made.stop()
    assert engine.of(SensorHealth)[1] == SensorHealth(())


def test_a_tick_does_not_overtake_what_came_while_the_thread_was_busy() -> None:
    now = [1000.0]
    made, engine = worker(16, clock=HostClock(lambda: now[0], lambda: now[0]))
    arrivals: list[tuple[float, type[Any]]] = []
    plain = engine.step

    def slow(envelope: Envelope) -> Outcome:
        arrivals.append((envelope.arrival, type(envelope.body)))
        if len(arrivals) == 1:
            assert made.offer(SensorHealth(("came meanwhile",)))
            now[0] += 5.0
        return plain(envelope)

    engine.step = slow  # type: ignore[method-assign]
    assert made.offer(SensorHealth(("first",)))
    made.start()
    until(lambda: any(kind is Tick and at >= 1005.0 for at, kind in arrivals), "ticks go on")
    made.stop()
    assert [at for at, _ in arrivals] == sorted(at for at, _ in arrivals)
