"""The clocks of all sources of the service: what is done to the times that come in, and what is said of it."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.runtime.host_clock import HostClock
from app.settings import ClockSettings
from pipeline.picture import SensorState
from pipeline.sites import RadarSite
from pipeline.tables import NodeEvents, Sweeps, TargetReports
from pipeline.timing.radar_clock import RadarClock
from pipeline.timing.source_clock import ClockRules, SourceClock, Verdict

REFUSED_TOLD_S = 30.0
"""A source is called degraded for so long after it was refused something."""

WORDS_EVERY_S = 2.0
"""The figures in the words change at most this often: every new word is stored and sent."""

Rows = TypeVar("Rows", NodeEvents, TargetReports)


def rules_of(settings: ClockSettings) -> ClockRules:
    """The settings as the core takes them."""
    return ClockRules(settings.mode, settings.max_offset_s, settings.max_latency_s)


class RadarTimes:
    """Corrects the times of one radar's blocks. Any thread may call."""

    def __init__(self, site: RadarSite, settings: ClockSettings, host: HostClock) -> None:
        self._radar = RadarClock(rules_of(settings), site.video.period_s, site.video.azimuths)
        self._azimuths = site.video.azimuths
        self._host = host
        self._lock = threading.Lock()

    def correct(self, block: Sweeps) -> Sweeps:
        """The block with times near its arrival."""
        arrival = block.arrival if np.isfinite(block.arrival) else self._host.now()
        rows = block.scan * self._azimuths + block.row.astype(np.int64)
        with self._lock:
            return replace(block, time=self._radar.take(block.time, rows, arrival), arrival=arrival)

    def words(self) -> str:
        """What is wrong with the radar's clock; empty when nothing is."""
        with self._lock:
            return self._radar.words(self._host.now())

    def shown(self, state: SensorState) -> SensorState:
        """The radar's state with what is known of its clock."""
        with self._lock:
            offset, spread, rebased = self._radar.offset, self._radar.spread, self._radar.rebased
        return _shown(state, offset, spread, {"time_rebased": rebased})


class FeedTimes:
    """Judges the times of reports or events. Any thread may call.

    word: what one row is called, for a person. names: of the senders whose rows tell who sent them; empty: the rows
    come from one source.
    """

    def __init__(
        self,
        word: str,
        settings: ClockSettings,
        names: Sequence[str] = (),
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._word, self._names, self._steady = word, tuple(names), steady
        self._clocks = [SourceClock(rules_of(settings)) for _ in self._names or ("",)]
        self._refused: Counter[str] = Counter()
        self._lately = 0
        self._told: tuple[float, str, str] = (-np.inf, "", "")
        self._words: tuple[float, str] = (-np.inf, "")
        self._lock = threading.Lock()

    def judge(self, table: Rows, arrival: float) -> tuple[Rows, dict[str, int], str]:
        """The rows to take, with their times; rows refused by reason; and why, for the sender."""
        if not len(table):
            return table, {}, ""
        with self._lock:
            sender = np.zeros(len(table), np.int32)
            if isinstance(table, NodeEvents):
                sender = np.clip(table.node, 0, len(self._clocks) - 1)
            times, ok = table.time.copy(), np.ones(len(table), np.bool_)
            refused: Counter[str] = Counter()
            answer = ""
            for one in np.unique(sender).tolist():
                rows = np.flatnonzero(sender == one)
                verdict = self._clocks[one].take(table.time[rows], arrival)
                times[rows], ok[rows] = verdict.time, verdict.ok
                refused.update(verdict.refused)
                if verdict.answer and not answer:
                    answer = f"{self._names[one]}: {verdict.answer}" if self._names else verdict.answer
                    self._tell(one, verdict)
            self._count(refused)
        return table[ok].replace(time=times[ok], arrival=arrival), dict(refused), answer

    def words(self) -> str:
        """What was refused lately, for a person; empty when nothing was."""
        with self._lock:
            return self._current_words()

    def shown(self, state: SensorState) -> SensorState:
        """A source's state with its clock, and degraded while rows are refused."""
        with self._lock:
            offsets = [(abs(one.offset), one) for one in self._clocks if one.offset is not None]
            worst = max(offsets, key=lambda pair: pair[0])[1] if offsets else None
            words = self._current_words()
            counts = {f"refused_{name}": n for name, n in sorted(self._refused.items())}
            counts["clock_steps"] = sum(one.steps for one in self._clocks)
        if words:
            detail = "; ".join(one for one in (state.detail, words) if one)
            state = replace(state, status="degraded", detail=detail)
        if worst is None:
            return _shown(state, None, None, counts)
        return _shown(state, worst.offset, worst.spread, counts)

    @property
    def heard(self) -> bool:
        """Something was refused since the start."""
        return bool(self._refused)

    def _tell(self, sender: int, verdict: Verdict) -> None:
        who = f"{self._names[sender]} " if self._names else ""
        self._told = (self._steady(), who, verdict.words)

    def _count(self, refused: Counter[str]) -> None:
        count = sum(refused.values())
        if count:
            self._refused.update(refused)
            self._lately += count

    def _current_words(self) -> str:
        now = self._steady()
        at, who, why = self._told
        if now - at >= REFUSED_TOLD_S:
            self._lately, self._words = 0, (-np.inf, "")
        elif now - self._words[0] >= WORDS_EVERY_S:
            cause, _, rest = why.partition(": ")
            many = f"{self._lately:,} {self._word}{'s' if self._lately > 1 else ''}"
            self._words = (now, f"{who}{many} {cause} refused{': ' if rest else ''}{rest}")
        return self._words[1]


def _shown(state: SensorState, offset: float | None, spread: float | None, counts: dict[str, int]) -> SensorState:
    return replace(
        state,
        counters={**state.counters, **counts},
        clock_offset_s=None if offset is None else round(offset, 3),
        clock_spread_s=None if spread is None or offset is None else round(spread, 3),
    )
