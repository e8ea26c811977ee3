"""The clocks of all sources of the service: corrects or refuses the times that come in, and says what was done."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from app.contract import RefusedRow
from app.runtime.host_clock import HostClock
from app.settings_sources import ClockSettings
from pipeline.picture import SensorState
from pipeline.sites import RadarSite
from pipeline.tables import NodeEvents, Sweeps, TargetReports
from pipeline.timing.radar_clock import RadarClock
from pipeline.timing.source_clock import ClockRules, SourceClock

REFUSED_TOLD_S = 30.0
"""A source stays degraded this long after a row of it was refused."""

WORDS_EVERY_S = 2.0
"""The text of a status changes at most this often: every change is stored and sent to all clients."""

SENDER_KEPT_S = 60.0
"""The clock of an address is forgotten when it has not been heard for so long: twice what its estimate looks back."""

SENDER_SHOWN_S = 10.0
"""Of addresses heard within so long the clock that is furthest off is shown: a standing aircraft reports every 5 s."""

MOST_SENDERS = 4096
"""Addresses whose clocks are kept; made-up ones must not fill the memory. Several times what a busy airport hears."""

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

    @property
    def late(self) -> bool:
        """The radar's video comes too late to be of use."""
        with self._lock:
            return self._radar.late

    def shown(self, state: SensorState) -> SensorState:
        """The radar's state with what is known of its clock."""
        with self._lock:
            offset, spread, rebased = self._radar.offset, self._radar.spread, self._radar.rebased
        return _shown(state, offset, spread, {"time_rebased": rebased})


@dataclass(slots=True)
class _Sender:
    """One sender's clock. heard, refused_at: steady s of its newest row, and of its newest refused row. refused: rows
    refused since it was last in order for REFUSED_TOLD_S.
    """

    clock: SourceClock
    heard: float = 0.0
    refused_at: float = -np.inf
    refused: int = 0


class FeedTimes:
    """Judges the times of reports or events. Any thread may call.

    Each sender has a clock of its own, so that a wrong one harms nobody else: each node, and each address that reports;
    reports without an address count as those of one sender. word: what one row is called, for a person. names: of the
    nodes, in the order of the `node` column.
    """

    def __init__(
        self,
        word: str,
        settings: ClockSettings,
        names: Sequence[str] = (),
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._word, self._names, self._steady = word, tuple(names), steady
        self._rules = rules_of(settings)
        self._senders: dict[str, _Sender] = {}
        self._forgotten_steps = 0
        self._refused: Counter[str] = Counter()
        self._told: tuple[float, str] = (-np.inf, "")
        self._words: tuple[float, str] = (-np.inf, "")
        self._lock = threading.Lock()

    def judge(self, table: Rows, arrival: float) -> tuple[Rows, tuple[RefusedRow, ...]]:
        """The rows to take, with their times; and those refused, with the reason for their sender."""
        if not len(table):
            return table, ()
        with self._lock:
            times, ok = table.time.copy(), np.ones(len(table), np.bool_)
            refused: list[RefusedRow] = []
            for name, rows in self._by_sender(table):
                sender = self._sender(name)
                verdict = sender.clock.take(table.time[rows], arrival)
                times[rows], ok[rows] = verdict.time, verdict.ok
                if verdict.refused:
                    who = f"{name}: " if name else ""
                    refused += [RefusedRow(int(rows[k]), reason, who + why) for k, reason, why in verdict.refused]
                    sender.refused_at = sender.heard
                    sender.refused += len(verdict.refused)
                    self._told = (self._steady(), verdict.words)
            self._refused.update(one.reason for one in refused)
            self._forget()
        return table[ok].replace(time=times[ok], arrival=arrival), tuple(sorted(refused))

    def words(self) -> str:
        """What was refused lately, for a person; empty when nothing was."""
        with self._lock:
            return self._current_words()

    def shown(self, state: SensorState) -> SensorState:
        """A source's state with its clock that is furthest off, and degraded while rows are refused."""
        with self._lock:
            self._forget()
            clocks = [one.clock for one in self._senders.values()]
            newest = max((one.heard for one in self._senders.values()), default=0.0)
            shown = [one.clock for one in self._senders.values() if self._names or newest - one.heard <= SENDER_SHOWN_S]
            worst = max(shown, key=lambda one: abs(one.offset or 0.0), default=None)
            words = self._current_words()
            counts = {f"refused_{name}": n for name, n in sorted(self._refused.items())}
            counts["clock_steps"] = self._forgotten_steps + sum(one.steps for one in clocks)
        if words:
            detail = "; ".join(one for one in (state.detail, words) if one)
            state = replace(state, status="degraded", detail=detail)
        if worst is None:
            return _shown(state, None, None, counts)
        return _shown(state, worst.offset, worst.spread, counts)

    @property
    def has_refused(self) -> bool:
        """Something was refused since the start."""
        return bool(self._refused)

    def _by_sender(self, table: Rows) -> list[tuple[str, NDArray[np.intp]]]:
        """Name and rows of each sender."""
        if isinstance(table, NodeEvents):
            senders = np.clip(table.node, 0, max(len(self._names) - 1, 0))
        else:
            senders = table.address
        order = np.argsort(senders, kind="stable")
        begins = np.flatnonzero(np.r_[True, senders[order][1:] != senders[order][:-1]])
        parts = np.split(order, begins[1:])
        return [(self._name(senders[rows[0]]), rows) for rows in parts]

    def _name(self, sender: object) -> str:
        if isinstance(sender, str):
            return str(sender)
        return self._names[int(sender)] if self._names else ""  # type: ignore[call-overload]

    def _sender(self, name: str) -> _Sender:
        """The sender, the one heard last at the end."""
        one = self._senders.pop(name, None) or _Sender(SourceClock(self._rules))
        one.heard = self._steady()
        if one.heard - one.refused_at >= REFUSED_TOLD_S:
            one.refused = 0
        self._senders[name] = one
        return one

    def _forget(self) -> None:
        """Forget addresses that are gone; nodes stay, however rarely they are passed."""
        limit = self._steady() - SENDER_KEPT_S
        while not self._names and self._senders:
            name, oldest = next(iter(self._senders.items()))
            if oldest.heard >= limit and len(self._senders) <= MOST_SENDERS:
                return
            self._forgotten_steps += oldest.clock.steps
            del self._senders[name]

    def _current_words(self) -> str:
        now = self._steady()
        at, why = self._told
        if now - at >= REFUSED_TOLD_S:
            self._words = (-np.inf, "")
        elif now - self._words[0] >= WORDS_EVERY_S:
            self._words = (now, self._who_and_how_many(now, why))
        return self._words[1]

    def _who_and_how_many(self, now: float, why: str) -> str:
        told = {name: one for name, one in self._senders.items() if now - one.refused_at < REFUSED_TOLD_S}
        cause, _, rest = why.partition(": ")
        count = sum(one.refused for one in told.values())
        who = f"{next(iter(told))} ".lstrip() if len(told) == 1 else ""
        of = f" of {len(told):,} senders" if len(told) > 1 else ""
        return f"{who}{count:,} {self._word}{'s' if count > 1 else ''}{of} {cause} refused{': ' if rest else ''}{rest}"


def _shown(state: SensorState, offset: float | None, spread: float | None, counts: dict[str, int]) -> SensorState:
    return replace(
        state,
        counters={**state.counters, **counts},
        clock_offset_s=None if offset is None else round(offset, 3),
        clock_spread_s=None if spread is None or offset is None else round(spread, 3),
    )
