"""A replay without a journal: a clock between two times that plays, pauses, and can be set to another time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

from app.contract import Refused, ReplayState

BEGIN = 1_795_778_400.0
"""2026-11-27 11:20:00 UTC."""

LENGTH_S = 1800.0
SPEEDS = (0.1, 64.0)


class FakeReplay:
    """Implements `app.contract.ReplayControl`. on_seek: called, in the thread that steers, when the time was set."""

    def __init__(
        self,
        begin: float = BEGIN,
        end: float = BEGIN + LENGTH_S,
        gaps: tuple[float, ...] = (BEGIN + 400.0, BEGIN + 1310.0),
        *,
        playing: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.begin = begin
        self.on_seek: list[Callable[[], None]] = []
        self._clock = clock
        self._lock = threading.RLock()
        self._stands = ReplayState("orly-2026-11-27.mcap", begin, end, begin, playing, 1.0, gaps)
        self._since = clock()

    def time(self) -> float:
        """UTC s of the recording."""
        return self.state().time

    def state(self) -> ReplayState:
        with self._lock:
            now = self._clock()
            stands = self._stands
            if stands.playing:
                at = min(stands.end, stands.time + (now - self._since) * stands.speed)
                self._stands = replace(stands, time=at, playing=at < stands.end)
            self._since = now
            return self._stands

    def steer(
        self, *, playing: bool | None = None, speed: float | None = None, time: float | None = None
    ) -> ReplayState:
        with self._lock:
            state = self.state()
            if speed is not None and not SPEEDS[0] <= speed <= SPEEDS[1]:
                raise Refused(f"speed {speed:g} is not in {SPEEDS[0]:g} .. {SPEEDS[1]:g}")
            if time is not None and not state.begin <= time <= state.end:
                raise Refused(f"time {time:.3f} is outside the recording ({state.begin:.3f} .. {state.end:.3f})")
            self._stands = replace(
                state,
                playing=state.playing if playing is None else playing,
                speed=state.speed if speed is None else speed,
                time=state.time if time is None else time,
            )
        if time is not None:
            for told in self.on_seek:
                told()
        return self._stands
