"""The surface thread: sectors, events, reports and commands in, pictures and alert changes out."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from app.contract import PictureListener, Refused
from app.runtime.queues import Closed, Inbox
from pipeline.engine import SurfaceEngine
from pipeline.picture import AlertChange, Picture, SensorState
from pipeline.tables import NodeEvents, SectorPlots, TargetReports

log = logging.getLogger(__name__)

IDLE_S = 0.25
"""Without input a picture is made this often, so that ages, coasting and health stay true."""

SILENCE_S = 1.0
"""When no sensor has spoken for so long, time passes without them; what they say next may be as old as the jitter."""

JITTER_S = 0.5


@dataclass(frozen=True, slots=True)
class Command:
    """Work on the engine asked for by another thread, answered through a future."""

    work: Callable[[SurfaceEngine], Any]
    answer: Future[Any]


class SurfaceWorker:
    """Owns the engine: nobody else touches it.

    Called once a picture: `sensors` for their health, `timings` for those of the radars, and `expect` with the picture,
    to tell the radars what comes.
    """

    def __init__(
        self,
        engine: SurfaceEngine,
        sensors: Callable[[], tuple[SensorState, ...]],
        limit: int,
        timings: Callable[[], dict[str, float]] = dict,
        expect: Callable[[Picture], None] = lambda _: None,
    ) -> None:
        self.engine = engine
        self.inbox: Inbox[SectorPlots | NodeEvents | TargetReports | Command] = Inbox(limit)
        self.newest: Picture | None = None
        self.failures = 0
        self._sensors = sensors
        self._timings = timings
        self._expect = expect
        self._listeners: list[PictureListener] = []
        self._listening = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="surface", daemon=True)
        self._heard: tuple[float, float] | None = None
        self._pending: list[AlertChange] = []

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Work off what waits, then end."""
        self.inbox.close()
        if self._thread.is_alive():
            self._thread.join(10.0)

    @property
    def alive(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every picture; returns the function that ends it."""
        with self._listening:
            self._listeners.append(listener)

        def end() -> None:
            with self._listening:
                if listener in self._listeners:
                    self._listeners.remove(listener)

        return end

    def ask(self, work: Callable[[SurfaceEngine], Any], timeout: float = 5.0) -> Any:
        """Do `work` in the surface thread and give its result; its exception is raised here.

        Raises Refused when the thread does not run, takes no more, or does not answer in `timeout` seconds.
        """
        answer: Future[Any] = Future()
        if not self.alive:
            raise Refused("the service is starting or ending")
        if not self.inbox.offer(Command(work, answer)):
            raise Refused("the queue for commands is full")
        try:
            return answer.result(timeout)
        except TimeoutError as error:
            if answer.cancel():
                raise Refused(f"no answer within {timeout:g} s; nothing was done") from error
            raise Refused(f"no answer within {timeout:g} s; it may still be done") from error

    def record_change(self, change: AlertChange) -> None:
        """A change made by a command (an acknowledgement): goes out with the next picture. Surface thread only."""
        self._pending.append(change)

    def _run(self) -> None:
        while True:
            try:
                items = self.inbox.take_all(IDLE_S)
            except Closed:
                return
            for item in items:
                self._take(item)
            self._let_time_pass(any(not isinstance(item, Command) for item in items))
            self._look()

    def _take(self, item: SectorPlots | NodeEvents | TargetReports | Command) -> None:
        try:
            if isinstance(item, Command):
                self._answer(item)
            elif isinstance(item, SectorPlots):
                self.engine.sector(item)
            elif isinstance(item, NodeEvents):
                self.engine.node_events(item)
            else:
                self.engine.target_reports(item)
        except Exception:
            self.failures += 1
            log.exception("the surface engine could not take a %s", type(item).__name__)

    def _answer(self, command: Command) -> None:
        if not command.answer.set_running_or_notify_cancel():
            return
        try:
            command.answer.set_result(command.work(self.engine))
        except Exception as error:
            command.answer.set_exception(error)

    def _let_time_pass(self, heard: bool) -> None:
        """The engine's time comes with the data; only when all sensors are silent does this clock take over."""
        now = time.monotonic()
        if heard or self._heard is None:
            self._heard = (now, self.engine.time) if self.engine.time else None
        elif now - self._heard[0] > SILENCE_S:
            self.engine.advance(self._heard[1] + now - self._heard[0] - JITTER_S)

    def _look(self) -> None:
        try:
            sensors = self._sensors()
            self.engine.sensors_degraded = any(s.kind == "radar" and s.status != "ok" for s in sensors)
            picture, changes = self.engine.look()
        except Exception:
            self.failures += 1
            log.exception("no picture could be made")
            return
        now = picture.time or time.time()
        picture = replace(picture, time=now, sensors=sensors, timings={**self._timings(), **picture.timings})
        self.newest = picture
        try:
            self._expect(picture)
        except Exception:
            self.failures += 1
            log.exception("the radars could not be told what to expect")
        changes = (*self._pending, *changes)
        self._pending.clear()
        with self._listening:
            listeners = tuple(self._listeners)
        for listener in listeners:
            try:
                listener(picture, changes)
            except Exception:
                self.failures += 1
                log.exception("a listener failed")
