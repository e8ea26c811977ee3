"""Plays a journal: the engine runs on the recorded inputs at the pace that a person asks for."""

from __future__ import annotations

import logging
import math
import threading
import time as clocks
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from app.contract import PictureListener, Refused, ReplayState
from app.journal.names import GAP, JournalError
from app.journal.output import seconds
from app.journal.reader import Journal, Record
from app.journal.times import utc_text
from app.replay.recorded import RecordedRun
from app.replay.verify import ReplayEngine
from app.runtime.listeners import Listeners
from pipeline.engine_records import CODEC, SENSORS, SNAPSHOT, Shown
from pipeline.picture import AlertChange, Picture, SensorState

log = logging.getLogger(__name__)

SLOWEST, FASTEST = 0.1, 64.0
"""Times the recorded pace."""

STILL_S = 0.5
"""While it stands still the picture is sent again this often, so that the displays do not take the feed for lost."""

LONGEST_PAUSE_S = 3.0
"""A longer time without any record is skipped: no service ran, or its clock was set. Ticks come every 0.25 s."""

CATCH_UP_S = 1.0
"""An engine that is further behind the pace asked for goes on from where it is, and does not catch up."""

END_S = 10.0
"""At the end the thread is waited for so long, as it may hold files open."""

COMPILING_END_S = 0.3
"""The same before the first picture: it may be compiling kernels, for a minute."""


@dataclass
class _Wanted:
    """What was asked for. time: seek to this, UTC s of the recording; None: go on."""

    playing: bool
    speed: float
    time: float | None = None


class JournalPlayer:
    """Steers and runs the replay of one journal in a thread of its own. All public methods: from any thread.

    change: other settings. window: from, until; UTC s of the recording, None for its begin and end.
    begin_anew: called after a seek, before the first picture of the new place. own: see `ReplayEngine`.
    """

    def __init__(
        self,
        journal: Journal,
        change: Callable[[RecordedRun], RecordedRun],
        window: tuple[float | None, float | None],
        speed: float = 1.0,
        begin_anew: Callable[[], None] = lambda: None,
        own: frozenset[str] = frozenset(),
    ) -> None:
        first, last = journal.first_time(), journal.last_time()
        if first is None or last is None:
            raise JournalError(f"{journal.name}: holds no record")
        self.journal = journal
        self.begin = first if window[0] is None else max(first, window[0])
        self.end = last if window[1] is None else min(last, window[1])
        if self.begin > self.end:
            raise JournalError(f"{journal.name}: nothing was recorded in this time")
        self.newest: Picture | None = None
        self.begin_anew = begin_anew
        self.failed = ""
        self.note = ""
        self._change, self._own = change, own
        self._wanted = _Wanted(True, _speed(speed), self.begin)
        self._condition = threading.Condition()
        self._listeners = Listeners()
        self._ending = False
        self._time = self.begin
        self._gaps = journal_gaps(journal)
        self._sensors: tuple[SensorState, ...] = ()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)

    def start(self) -> None:
        """Begin to play."""
        self._thread.start()

    def stop(self) -> None:
        """End."""
        with self._condition:
            self._ending = True
            self._condition.notify_all()
        if self._thread.is_alive():
            self._thread.join(END_S if self.newest is not None else COMPILING_END_S)

    @property
    def alive(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    @property
    def sensors(self) -> tuple[SensorState, ...]:
        """The health of the sensors as it was recorded."""
        return self._sensors

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every picture; returns the function that ends it."""
        return self._listeners.add(listener)

    def state(self) -> ReplayState:
        """Where it stands."""
        with self._condition:
            wanted = self._wanted
            at = self._time if wanted.time is None else wanted.time
            return ReplayState(self.journal.name, self.begin, self.end, at, wanted.playing, wanted.speed, self._gaps)

    def steer(
        self, *, playing: bool | None = None, speed: float | None = None, time: float | None = None
    ) -> ReplayState:
        """Play or pause, at another pace, from another time. Raises Refused."""
        if time is not None and not self.begin <= time <= self.end:
            raise Refused(
                f"the recording goes from {utc_text(self.begin)} to {utc_text(self.end)}, {utc_text(time)} is outside"
            )
        with self._condition:
            wanted = self._wanted
            if playing is not None:
                wanted.playing = playing
            if speed is not None:
                wanted.speed = _speed(speed)
            if time is not None:
                wanted.time = time
            elif playing and (self.failed or self._time >= self.end):
                wanted.time = self.begin
            self._condition.notify_all()
        return self.state()

    def _run(self) -> None:
        while not self._ending:
            try:
                self._play()
            except Exception as error:
                if not isinstance(error, JournalError):
                    log.exception("the replay failed")
                with self._condition:
                    self._wanted.playing = False
                    self.failed = str(error) or type(error).__name__
                log.error("the replay stands still: %s", error)
                self._stand_still()

    def _play(self) -> None:
        """From the place asked for until another is asked for, or the end."""
        with self._condition:
            target, self._wanted.time = self._wanted.time, None
        target = self._time if target is None else target
        self.failed = ""
        pace, there = _Pace(target), False
        for shown, changes, at in self._shown(target):
            if there and not self._wait_until(at, pace):
                return
            self._time, there = at, True  # the first picture is shown at once, also when it stands still
            self._publish(shown, changes)
        with self._condition:
            if self._asked_elsewhere():
                return
            self._time = self.end
            self._wanted.playing = False
        self._stand_still()

    def _shown(self, target: float) -> Iterator[tuple[Shown, tuple[AlertChange, ...], float]]:
        """The picture at `target` at once, then all that follow; fast forward from the snapshot before it."""
        self._sensors, self.note = (), ""
        replay = ReplayEngine(self.journal, self._change, self._own)
        newest: Shown | None = None
        reached = False
        for one in replay.replayed(max(target, self.journal.first_snapshot()), self.end):
            if self._asked_elsewhere():
                return
            if isinstance(one, Record):
                self._take(one, replay)
                continue
            made, at = one.made, one.record.time
            if at >= target and not reached:
                reached = True
                self.begin_anew()
                if newest is not None:
                    yield newest, (), target
            if made is not None and made.time == made.time:
                newest = made
                if reached:
                    yield made, made.changes, at
        if newest is not None and not reached:
            self.begin_anew()
            yield newest, (), target

    def _take(self, record: Record, replay: ReplayEngine) -> None:
        if record.topic == SNAPSHOT and replay.lost:
            told = len(replay.counts.begun_empty)
            replay.restore(record)
            for self.note in replay.counts.begun_empty[told:]:
                log.warning("%s", self.note)
        elif record.topic == SENSORS:
            states = CODEC.decode(record.data)
            if isinstance(states, tuple) and all(isinstance(one, SensorState) for one in states):
                self._sensors = states

    def _publish(self, shown: Shown, changes: tuple[AlertChange, ...]) -> None:
        picture = Picture(shown.time, shown.tracks, shown.alerts, shown.runways, self._sensors)
        self._send(picture, changes)

    def _send(self, picture: Picture, changes: tuple[AlertChange, ...] = ()) -> None:
        self.newest = picture
        self._listeners.tell(picture, changes)

    def _wait_until(self, at: float, pace: _Pace) -> bool:
        """Wait for the moment at which the recording reaches `at`; False when something else is asked for."""
        while True:
            with self._condition:
                if self._ending or self._wanted.time is not None:
                    return False
                if self._wanted.playing:
                    pause = pace.pause(at, self._wanted.speed)
                    if pause <= 0.0:
                        return True
                    self._condition.wait(pause)
                    continue
            self._again(STILL_S)
            pace.stand(self._time)

    def _stand_still(self) -> None:
        while not self._asked_elsewhere():
            self._again(STILL_S)

    def _again(self, seconds: float) -> None:
        """Wait, at most `seconds`, and send the picture again."""
        with self._condition:
            self._condition.wait(seconds)
        if self.newest is not None and not self._asked_elsewhere():
            self._send(replace(self.newest))

    def _asked_elsewhere(self) -> bool:
        return self._ending or self._wanted.time is not None


class _Pace:
    """When the recording reaches what time, on this host's steady clock."""

    def __init__(self, at: float) -> None:
        self._recorded, self._steady, self._speed, self._newest = at, clocks.monotonic(), 0.0, at

    def stand(self, at: float) -> None:
        """It stands still at this time of the recording."""
        self._recorded, self._steady = at, clocks.monotonic()

    def pause(self, at: float, speed: float) -> float:
        """Seconds until the recording reaches `at`."""
        now = clocks.monotonic()
        if speed != self._speed:
            if self._speed:
                self._recorded += (now - self._steady) * self._speed
                self._steady = now
            self._speed = speed
        if at - self._newest > LONGEST_PAUSE_S:
            self._recorded += at - self._newest
        self._newest = at
        due = self._steady + (at - self._recorded) / speed
        if now - due > CATCH_UP_S:
            self._recorded, self._steady = at, now
        return max(due - now, 0.0)


def journal_gaps(journal: Journal) -> tuple[float, ...]:
    """UTC s at which records are missing, or the service was started anew."""
    found, run = [], ""
    for file in journal.files:
        for chunk in file.chunks:
            if not chunk.messages:
                continue
            begin = seconds(chunk.messages[0][1])
            if run and chunk.run != run:
                found.append(begin)
            run = chunk.run
            found += [seconds(at) for channel, at, _ in chunk.messages if file.topic(channel) == GAP]
    return tuple(found)


def _speed(speed: Any) -> float:
    if not (math.isfinite(speed) and SLOWEST <= speed <= FASTEST):
        raise Refused(f"the speed must lie between {SLOWEST:g} and {FASTEST:g} times the recorded pace")
    return float(speed)
