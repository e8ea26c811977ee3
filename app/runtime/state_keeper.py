"""Keeps what the detectors have learned over a restart: a file a radar, written now and then and at the end."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from concurrent.futures import TimeoutError as NoAnswer
from pathlib import Path

from app.runtime.radar_worker import RadarWorker
from app.runtime.state_file import read_state, write_state
from pipeline.chain import RadarChain
from pipeline.state import StateError

log = logging.getLogger(__name__)

ANSWER_S = 10.0
"""A radar's thread is between two blocks well within this."""

ROOM = 2
"""A file may be so many times as large as what the chain itself would save."""


class StateKeeper:
    """folder: where the files lie. scene: what a state belongs to besides radar, parts and map.

    interval_s: how often it is saved; max_age_s: an older file is not taken up. clock: UTC s.
    """

    def __init__(
        self,
        folder: Path,
        scene: str,
        interval_s: float,
        max_age_s: float,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.folder = folder
        self.scene = scene
        self.interval_s = interval_s
        self.max_age_s = max_age_s
        self._clock = clock
        self._counts: dict[str, dict[str, int]] = {}
        self._swept: dict[str, int] = {}
        self._failing: set[str] = set()
        self._workers: list[RadarWorker] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="state", daemon=True)

    def path(self, radar: str) -> Path:
        """The file of a radar."""
        return self.folder / f"{radar}.npz"

    def take_up(self, chain: RadarChain) -> bool:
        """Let a chain that has not begun resume what its radar's file holds; the log says why when it does not."""
        radar = chain.site.id
        counts = self._counting(radar)
        path = self.path(radar)
        most = ROOM * sum(one.nbytes for one in chain.save().values()) + 2**20
        try:
            chain.resume(read_state(path, self._clock(), self.max_age_s, self.scene, most))
        except FileNotFoundError:
            log.info("radar %s: nothing is saved in %s; the detector learns from the start", radar, path)
            return False
        except StateError as error:
            log.warning("radar %s: %s is not taken up, the detector learns from the start: %s", radar, path, error)
            return False
        counts["states_resumed"] = 1
        log.info("radar %s: the detector goes on with what it had learned (%s)", radar, path)
        return True

    def start(self, workers: list[RadarWorker]) -> None:
        """Begin to save."""
        self._workers = workers
        for worker in workers:
            self._counting(worker.site.id)
        self._thread.start()

    def stop(self) -> None:
        """End, after a last save of what the radars' threads, ended by now, have left."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(ANSWER_S + 5.0)
        self.save()

    def counters(self, radar: str) -> dict[str, int]:
        """How often a radar's state was saved, could not be saved, and was taken up."""
        return self._counts.get(radar, {}).copy()

    def _counting(self, radar: str) -> dict[str, int]:
        return self._counts.setdefault(radar, {"states_saved": 0, "state_saves_failed": 0, "states_resumed": 0})

    def save(self) -> None:
        """Save every chain that was swept since the last time. Never raises."""
        for worker in self._workers:
            try:
                self._save(worker)
            except Exception as error:
                self._failed(worker.site.id, error)

    def _save(self, worker: RadarWorker) -> None:
        radar = worker.site.id
        swept = worker.chain.counters["sweeps"]
        if swept == self._swept.get(radar, 0):
            return
        try:
            arrays = worker.ask(RadarChain.save).result(ANSWER_S)
        except (NoAnswer, CancelledError) as error:
            raise OSError("the radar's thread does not answer") from error
        write_state(self.path(radar), arrays, self._clock(), self.scene)
        self._swept[radar] = swept
        self._counts[radar]["states_saved"] += 1
        if radar in self._failing:
            self._failing.discard(radar)
            log.info("radar %s: what the detector has learned is saved again", radar)

    def _failed(self, radar: str, error: Exception) -> None:
        self._counts[radar]["state_saves_failed"] += 1
        if radar not in self._failing:
            self._failing.add(radar)
            log.error("radar %s: what the detector has learned cannot be saved: %s", radar, error)

    def _run(self) -> None:
        while not self._over.wait(self.interval_s):
            self.save()
