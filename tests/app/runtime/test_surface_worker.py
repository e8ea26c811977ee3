"""Commands to the surface thread are answered or refused with words, never left hanging."""

from __future__ import annotations

import threading
from typing import Any, cast

import pytest

from app.contract import Refused
from app.runtime.surface_worker import SurfaceWorker
from pipeline.engine import SurfaceEngine
from pipeline.picture import Picture
from pipeline.tables import Tracks


class Engine:
    """As much of an engine as the thread needs."""

    time = 0.0
    sensors_degraded = False

    def look(self) -> tuple[Picture, tuple[()]]:
        return Picture(0.0, Tracks.empty()), ()


def worker(limit: int = 4) -> SurfaceWorker:
    return SurfaceWorker(cast(SurfaceEngine, Engine()), lambda: (), limit)


def test_a_command_before_the_start_is_refused_at_once() -> None:
    with pytest.raises(Refused, match="starting"):
        worker().ask(lambda _: 1)


def test_a_command_is_answered_and_its_fault_raised() -> None:
    made = worker()
    made.start()

    def fail(_: Any) -> None:
        raise KeyError("runway")

    assert made.ask(lambda _: 7) == 7
    with pytest.raises(KeyError):
        made.ask(fail)
    made.stop()


def test_a_command_that_gets_no_turn_is_taken_back() -> None:
    made = worker()
    made.start()
    busy, go = threading.Event(), threading.Event()
    done: list[int] = []

    def hold(_: Any) -> None:
        busy.set()
        go.wait(20)

    holding = threading.Thread(target=lambda: made.ask(hold, 20))
    holding.start()
    assert busy.wait(10)
    with pytest.raises(Refused, match="nothing was done"):
        made.ask(lambda _: done.append(1), timeout=0.05)
    go.set()
    holding.join(20)
    made.stop()
    assert done == []
