"""One thread a radar: blocks of sweeps in, the plots of sectors out."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from app.runtime.cuts import Cuts
from app.runtime.queues import BlockQueue, Closed
from pipeline.chain import RadarChain
from pipeline.sites import RadarSite
from pipeline.tables import SectorPlots, Sweeps

log = logging.getLogger(__name__)

Result = TypeVar("Result")


@dataclass
class Turn:
    """What one turn cost and gave. seconds: of each stage."""

    scan: int = -1
    plots: int = 0
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass
class Successor:
    """A chain that is to take over. done: told whether it did. newest: the scan of the newest block since it waits;
    None before the first. learned: scans in which it learned beside the running one; the rest of the first is none."""

    chain: RadarChain
    done: Callable[[bool], None]
    newest: int | None = None
    learned: int = 0


class RadarWorker:
    """Runs a chain on the blocks put into its queue and hands each sector on.

    Only its thread touches the chain: what others want of it goes through `ask` and `succeed`. record: hears of every
    block just before the chain works on it.
    """

    def __init__(
        self,
        site: RadarSite,
        chain: RadarChain,
        limit: int,
        deliver: Callable[[SectorPlots], bool],
        record: Callable[[RadarChain, Sweeps], None] = lambda _chain, _block: None,
    ) -> None:
        self.site = site
        self.chain = chain
        self.queue = BlockQueue(limit)
        self.cuts = Cuts()
        self.turn = Turn()
        self.last_heard: float | None = None
        self.last_time: float | None = None
        self.failures = 0
        self.undelivered = 0
        self.successions = 0
        self.scans_left: int | None = None
        self._deliver = deliver
        self._record = record
        self._turning = Turn()
        self._successor: Successor | None = None
        self._orders: deque[Callable[[], None]] = deque()
        self._expected: tuple[ArrayLike, ...] | None = None
        self._given: tuple[ArrayLike, ...] | None = None
        self._thread = threading.Thread(target=self._run, name=f"radar-{site.id}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def put(self, block: Sweeps) -> None:
        """Take a block; never waits."""
        self.last_heard = time.monotonic()
        self.queue.put(block)

    def expect(self, east: ArrayLike, north: ArrayLike, heading: ArrayLike, sd: ArrayLike) -> None:
        """What tracks expect of the blocks to come (`RadarChain.expect`); never waits. Of several the newest counts."""
        self._expected = (east, north, heading, sd)

    def stop(self) -> None:
        """End, leaving what waits."""
        self.queue.close()
        if self._thread.is_alive():
            self._thread.join(5.0)

    def ask(self, work: Callable[[RadarChain], Result]) -> Future[Result]:
        """Do `work` with the chain between two blocks; in the caller's thread when the radar's does not run."""
        answer: Future[Result] = Future()

        def order() -> None:
            if not answer.set_running_or_notify_cancel():
                return
            try:
                answer.set_result(work(self.chain))
            except Exception as error:
                answer.set_exception(error)

        if self.alive:
            self._orders.append(order)
            self.queue.wake()
        else:
            order()
        return answer

    def succeed(self, chain: RadarChain | None, done: Callable[[bool], None]) -> None:
        """Have `chain` take over, and `done` told when it has, or cannot; None: the one that learns is forgotten.

        A chain with the same detector takes over at once, with what that has learned. Another first learns beside the
        running one for as many turns as it detects nothing in. Until it is done a later call takes its place.
        """

        def order() -> None:
            self._successor = None if chain is None else Successor(chain, done)
            self.scans_left = None
            if chain is None:
                return
            at_once = chain.detects_like(self.chain) or self.last_time is None or not chain.scans_to_learn
            if at_once:
                self._take_over(self._successor)
            else:
                self.scans_left = chain.scans_to_learn

        if self.alive:
            self._orders.append(order)
            self.queue.wake()
        else:
            order()

    @property
    def alive(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    @property
    def status(self) -> str:
        """The health word of SensorState."""
        if self.last_heard is None:
            return "waiting"
        if time.monotonic() - self.last_heard > 3 * self.site.video.period_s or not self.alive:
            return "silent"
        return "degraded" if self.cuts.lately() else "ok"

    def counters(self) -> dict[str, int]:
        """What was worked on and what was not."""
        return {
            **self.chain.counters,
            "queue_dropped_blocks": self.queue.dropped_blocks,
            "queue_dropped_sweeps": self.queue.dropped_sweeps,
            "sectors_undelivered": self.undelivered,
            "block_failures": self.failures,
            "parts_changed": self.successions,
        }

    def _run(self) -> None:
        while True:
            try:
                block = self.queue.get()
            except Closed:
                return
            while self._orders:
                self._attempt(self._orders.popleft())
            if block is not None:
                self._work(block)

    def _work(self, block: Sweeps) -> None:
        self._attempt(lambda: self._bring_up(block))
        try:
            self._give_expected()
            self._recorded(block)
            sector = self.chain.process(block)
        except Exception:
            self.failures += 1
            log.exception("radar %s: a block of scan %d could not be worked on", self.site.id, block.scan)
            return
        if len(block):
            self.last_time = float(block.time[-1])
        self._account(block.scan, sector)
        self._hand_on(sector)

    def _recorded(self, block: Sweeps) -> None:
        try:
            self._record(self.chain, block)
        except Exception:
            self.failures += 1
            log.exception("radar %s: a block of scan %d could not be recorded", self.site.id, block.scan)

    def _give_expected(self) -> None:
        """Between two blocks only: what is recorded of it must be what the whole block is worked on with."""
        expected = self._expected
        if expected is not None and expected is not self._given:
            self._given = expected
            self.chain.expect(*expected)

    def _attempt(self, work: Callable[[], Any]) -> None:
        try:
            work()
        except Exception:
            self.failures += 1
            failed, self._successor, self.scans_left = self._successor, None, None
            log.exception("radar %s: other parts could not take over; those that ran stay", self.site.id)
            if failed is not None:
                failed.done(False)

    def _bring_up(self, block: Sweeps) -> None:
        """Let the successor learn from the block, or take over when it has learned enough."""
        successor = self._successor
        if successor is None or not len(block):
            return
        wanted = successor.chain.scans_to_learn
        if successor.newest is None:
            successor.newest = block.scan
        elif block.scan > successor.newest and successor.learned == wanted:
            self._take_over(successor)
            return
        elif block.scan > successor.newest:
            # turns in which nothing was received teach nothing
            successor.newest, successor.learned = block.scan, successor.learned + 1
        self.scans_left = wanted - max(successor.learned - 1, 0)
        if successor.learned:
            successor.chain.learn(block)

    def _take_over(self, successor: Successor | None) -> None:
        if successor is None:
            return
        if self.last_time is not None:
            self._hand_on(self.chain.flush())
        successor.chain.take_over(self.chain)
        self.chain = successor.chain
        self._given = None
        self.successions += 1
        self._successor, self.scans_left = None, None
        successor.done(True)

    def _hand_on(self, sector: SectorPlots) -> None:
        if not self._deliver(sector):
            self.undelivered += 1

    def _account(self, scan: int, sector: SectorPlots) -> None:
        self.cuts.note({**self.chain.counters, "queue_dropped_sweeps": self.queue.dropped_sweeps})
        if scan != self._turning.scan:
            self.turn, self._turning = self._turning, Turn(scan)
        self._turning.plots += len(sector.plots)
        for stage, seconds in self.chain.timings.items():
            self._turning.seconds[stage] = self._turning.seconds.get(stage, 0.0) + seconds
