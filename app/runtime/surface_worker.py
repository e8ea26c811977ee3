"""The surface thread: what arrives goes into the engine in one order; pictures and alert changes come out."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any, Protocol

from app.contract import PictureListener, Refused
from app.runtime.host_clock import HostClock
from app.runtime.listeners import Listeners
from app.runtime.queues import Closed, Inbox
from pipeline.engine import Outcome, SurfaceEngine
from pipeline.inputs import ClockStep, Command, Envelope, Input, SensorHealth, Tick
from pipeline.picture import AlertChange, Picture, SensorState

log = logging.getLogger(__name__)

TICK_S = 0.25
"""The engine gets a tick this often, so that tracks coast and ages and health stay true though no sensor speaks."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """What waits for the thread. answer: where a command is answered; None for everything else."""

    envelope: Envelope
    answer: Future[Any] | None = None


def impaired_radars(sensors: tuple[SensorState, ...]) -> tuple[str, ...]:
    """The ids of the radars that are not ok."""
    return tuple(one.id for one in sensors if one.kind == "radar" and one.status != "ok")


class Recorder(Protocol):
    """What hears of everything that enters the engine and of everything that comes out, in order (`app.journal`)."""

    def before(self, envelope: Envelope, save: Callable[[], Any]) -> None:
        """`envelope` is about to enter. save: gives the engine's state before it."""

    def after(self, outcome: Outcome) -> None:
        """That is what came of it."""

    def sensors(self, states: tuple[SensorState, ...]) -> None:
        """The health of all sensors, as it goes out with the newest picture."""


class SurfaceWorker:
    """Owns the engine: nobody else touches it.

    sensors: asked for the health of all once a picture. timings: those of the radars. expect: hears of each picture,
    to tell the radars what comes. recorder: hears of all inputs and outcomes. impaired: of the health of all, the ids
    of those without which the picture is not whole.
    """

    def __init__(
        self,
        engine: SurfaceEngine,
        sensors: Callable[[], tuple[SensorState, ...]],
        limit: int,
        timings: Callable[[], dict[str, float]] = dict,
        expect: Callable[[Picture], None] = lambda _: None,
        clock: HostClock | None = None,
        recorder: Recorder | None = None,
        impaired: Callable[[tuple[SensorState, ...]], tuple[str, ...]] = impaired_radars,
    ) -> None:
        self.engine = engine
        self.inbox: Inbox[Waiting] = Inbox(limit)
        self.newest: Picture | None = None
        self.failures = 0
        self._clock = clock or HostClock()
        self._recorder = recorder
        self._sensors = sensors
        self._impaired = impaired
        self._timings = timings
        self._expect = expect
        self._listeners = Listeners()
        self._thread = threading.Thread(target=self._run, name="surface", daemon=True)
        self._degraded: tuple[str, ...] = ()
        self._ticked = 0.0
        self._stamping = threading.Lock()
        self._step_due = 0.0

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
        return self._listeners.add(listener)

    def offer(self, body: Input) -> bool:
        """Give the engine an input, stamped with the time of now. False, counted, when the queue is full."""
        return self._put(body)

    def ask(self, command: Command, timeout: float = 5.0) -> Any:
        """Have the engine carry out a command, and give its answer; why it could not is raised (KeyError, ValueError).

        Raises Refused when the thread does not run, takes no more, or does not answer in `timeout` seconds.
        """
        answer: Future[Any] = Future()
        if not self.alive:
            raise Refused("the service is starting or ending")
        if not self._put(command, answer):
            raise Refused("the queue for commands is full")
        try:
            return answer.result(timeout)
        except TimeoutError as error:
            if answer.cancel():
                raise Refused(f"no answer within {timeout:g} s; nothing was done") from error
            raise Refused(f"no answer within {timeout:g} s; it may still be done") from error

    def _put(self, body: Input, answer: Future[Any] | None = None) -> bool:
        """Queue an input; before the first that is stamped after a step of the host's clock, the step."""
        with self._stamping:
            now, step = self._clock.now_and_step()
            self._step_due += step
            if self._step_due and self.inbox.offer(Waiting(Envelope(now, ClockStep(self._step_due)))):
                self._step_due = 0.0
            if self._step_due:
                return False  # nothing may enter before the step; without room for it the next tick brings it
            return self.inbox.offer(Waiting(Envelope(now, body), answer))

    def _run(self) -> None:
        while True:
            try:
                waiting = self.inbox.take_all(TICK_S)
            except Closed:
                return
            # stamped here: the tick must not overtake what comes while this is worked on
            with self._stamping:
                taken, step = self._clock.now_and_step()
                step, self._step_due = step + self._step_due, 0.0
            sensors = self._health()
            outcomes = [outcome for one in waiting if (outcome := self._take(one)) is not None]
            outcomes += self._tick(taken, step)
            self._publish(outcomes, sensors)

    def _health(self) -> tuple[SensorState, ...] | None:
        """The state of all sensors; what the alert rules must know of it goes into the engine when it changes."""
        try:
            sensors = self._sensors()
        except Exception:
            self._failed("the sensors could not be asked")
            return None
        degraded = self._impaired(sensors)
        if degraded != self._degraded and self._step(Envelope(self._clock.now(), SensorHealth(degraded))) is not None:
            self._degraded = degraded
        return sensors

    def _tick(self, arrival: float, step: float) -> list[Outcome]:
        now, made = time.monotonic(), []
        if step:
            made.append(self._step(Envelope(arrival, ClockStep(step))))
        if now - self._ticked >= TICK_S:
            self._ticked = now
            made.append(self._step(Envelope(arrival, Tick())))
        return [one for one in made if one is not None]

    def _take(self, waiting: Waiting) -> Outcome | None:
        answer = waiting.answer
        if answer is None:
            return self._step(waiting.envelope)
        if not answer.set_running_or_notify_cancel():
            return None
        outcome = self._step(waiting.envelope)
        if outcome is None:
            answer.set_exception(Refused("the command failed; the log of the service says why"))
        elif outcome.refused is not None:
            answer.set_exception(outcome.refused)
        else:
            answer.set_result(outcome.answer)
        return outcome

    def _step(self, envelope: Envelope) -> Outcome | None:
        """Put one input into the engine; None, counted and logged, when that failed."""
        if isinstance(envelope.body, ClockStep):
            log.warning("the clock of this host was set by %+.1f s; the picture goes on with it", envelope.body.seconds)
        self._record(lambda recorder: recorder.before(envelope, self.engine.save))
        try:
            outcome = self.engine.step(envelope)
        except Exception:
            self._failed(f"the surface engine could not take a {type(envelope.body).__name__}")
            return None
        self._record(lambda recorder: recorder.after(outcome))
        return outcome

    def _record(self, tell: Callable[[Recorder], None]) -> None:
        """Tell the recorder; that it fails must not keep anything from the engine or the displays."""
        if self._recorder is None:
            return
        try:
            tell(self._recorder)
        except Exception:
            self._failed("the journal could not be told")

    def _publish(self, outcomes: list[Outcome], sensors: tuple[SensorState, ...] | None) -> None:
        """Send the newest picture on, with every alert change since the one before: of pictures the newest wins."""
        changes: tuple[AlertChange, ...] = tuple(change for one in outcomes for change in one.changes)
        newest = next((one.picture for one in reversed(outcomes) if one.picture is not None), None)
        if newest is None:
            return
        known = sensors if sensors is not None else (self.newest.sensors if self.newest is not None else ())
        picture = replace(newest, sensors=known, timings={**self._timings(), **newest.timings})
        self.newest = picture
        self._record(lambda recorder: recorder.sensors(known))
        try:
            self._expect(picture)
        except Exception:
            self._failed("the radars could not be told what to expect")
        self.failures += self._listeners.tell(picture, changes)

    def _failed(self, what: str) -> None:
        self.failures += 1
        log.exception(what)
