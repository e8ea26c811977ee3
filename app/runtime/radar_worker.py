"""One thread a radar: blocks of sweeps in, the plots of sectors out."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from app.runtime.queues import BlockQueue, Closed
from pipeline.chain import RadarChain
from pipeline.sites import RadarSite
from pipeline.tables import SectorPlots, Sweeps

log = logging.getLogger(__name__)


class RadarWorker:
    """Runs a chain on the blocks put into its queue and hands each sector on."""

    def __init__(self, site: RadarSite, chain: RadarChain, limit: int, deliver: Callable[[SectorPlots], bool]) -> None:
        self.site = site
        self.chain = chain
        self.queue = BlockQueue(limit)
        self.last_heard: float | None = None
        self.last_time: float | None = None
        self.failures = 0
        self.undelivered = 0
        self._deliver = deliver
        self._thread = threading.Thread(target=self._run, name=f"radar-{site.id}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def put(self, block: Sweeps) -> None:
        """Take a block; never waits."""
        self.last_heard = time.monotonic()
        self.queue.put(block)

    def stop(self) -> None:
        """End, leaving what waits."""
        self.queue.close()
        if self._thread.is_alive():
            self._thread.join(5.0)

    @property
    def alive(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    @property
    def status(self) -> str:
        """The health word of SensorState."""
        if self.last_heard is None:
            return "waiting"
        if time.monotonic() - self.last_heard > 3 * self.site.video.period_s:
            return "silent"
        return "ok" if self.alive else "silent"

    def counters(self) -> dict[str, int]:
        """What was worked on and what was not."""
        return {
            **self.chain.counters,
            "queue_dropped_blocks": self.queue.dropped_blocks,
            "queue_dropped_sweeps": self.queue.dropped_sweeps,
            "sectors_undelivered": self.undelivered,
            "block_failures": self.failures,
        }

    def _run(self) -> None:
        while True:
            try:
                block = self.queue.get()
            except Closed:
                return
            try:
                sector = self.chain.process(block)
            except Exception:
                self.failures += 1
                log.exception("radar %s: a block of scan %d could not be worked on", self.site.id, block.scan)
                continue
            if len(block):
                self.last_time = float(block.time[-1])
            if not self._deliver(sector):
                self.undelivered += 1
