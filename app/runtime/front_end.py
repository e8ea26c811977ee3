"""Changing the parts of a radar's chain while it runs."""

from __future__ import annotations

import difflib
import logging
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import TimeoutError as NoAnswer
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.assembly import FRONT_END, chain_of, parts_of
from app.contract import FrontEnd, Refused, WrongParts
from app.runtime.radar_worker import RadarWorker
from pipeline import catalogue, parts
from pipeline.chain import RadarChain

log = logging.getLogger(__name__)

BUSY_S = 60.0
"""How long a change waits for another that is being compiled."""

MOST_CHANGES = 2
"""One that is being made and one that waits; each holds a thread of those that answer all requests."""

ANSWER_S = 2.0
"""A radar's thread is between two blocks well within this; a later answer still counts."""


class FrontEndSwitch:
    """One radar's parts: what runs, what learns to take over, and how to change it. Any thread may call.

    index: the radar's place in the engine. surface: what `RadarChain` takes. compile: called with parts before they are
    built, so that their kernels lie in the cache. changed: hears of each verb's part once others have taken over.
    """

    def __init__(
        self,
        worker: RadarWorker,
        index: int,
        surface: NDArray[np.uint8] | None,
        compile: Callable[[Mapping[str, Mapping[str, Any]]], None],
        changed: Callable[[dict[str, Any]], None] = lambda _: None,
    ) -> None:
        self._worker = worker
        self._index = index
        self._surface = surface
        self._compile = compile
        self._changed = changed
        self._next: dict[str, Any] | None = None
        self._changing = threading.Lock()
        self._room = threading.BoundedSemaphore(MOST_CHANGES)

    @property
    def names(self) -> dict[str, str]:
        """The name of the part of each verb."""
        return {verb: catalogue.name_of(part) for verb, part in parts_of(self._worker.chain).items()}

    @property
    def learning(self) -> str:
        """What learns to take over, in words; empty when nothing does."""
        coming, left = self._next, self._worker.scans_left
        if coming is None or left is None:
            return ""
        running = parts_of(self._worker.chain)
        new = [f"{verb} {catalogue.name_of(part)}" for verb, part in coming.items() if part != running[verb]]
        return f"{' and '.join(new)} learning, {left} {'turn' if left == 1 else 'turns'} to go"

    def state(self) -> FrontEnd:
        """What runs, what comes, and what it costs."""
        worker, coming = self._worker, self._next
        turn = worker.turn
        return FrontEnd(
            radar=worker.site.id,
            running=_described(parts_of(worker.chain)),
            next=None if coming is None else _described(coming),
            scans_left=worker.scans_left if coming is not None else None,
            plots_a_scan=turn.plots,
            ms_a_turn={stage: round(1e3 * seconds, 3) for stage, seconds in turn.seconds.items()},
            cut=worker.cuts.lately(),
        )

    def choose(self, wanted: Mapping[str, Mapping[str, Any]]) -> FrontEnd:
        """Build and compile a chain with these parts, and have it take over. Raises WrongParts, Refused."""
        new = _built(wanted)
        if not self._room.acquire(blocking=False):
            raise Refused("other changes of the parts are under way")
        try:
            if not self._changing.acquire(timeout=BUSY_S):
                raise Refused("another change of the parts is under way")
            try:
                coming = self._next  # before what runs: what takes over in between is then in either
                running = parts_of(self._worker.chain)
                self._change(running, {**(coming or running), **new})
            finally:
                self._changing.release()
        finally:
            self._room.release()
        return self.state()

    def _change(self, running: dict[str, Any], made: dict[str, Any]) -> None:
        worker = self._worker
        if made == running:
            if self._next is not None:
                log.info("radar %s: %s stays", worker.site.id, _words(running))
            self._next = None
            worker.succeed(None, lambda _: None)
        elif made != self._next:
            chain = self._compiled(made)
            self._next, running = made, parts_of(worker.chain)
            worker.succeed(chain, lambda well: self._ended(well, running, made))
        try:
            worker.ask(lambda _: None).result(ANSWER_S)
        except NoAnswer:
            log.warning("radar %s: its thread is busy; the change comes later", worker.site.id)
        if self._next is not None:
            log.info("radar %s: %s, in place of %s", worker.site.id, self.learning, _words(running))

    def _compiled(self, made: dict[str, Any]) -> RadarChain:
        try:
            self._compile(_described(made))
            chain = chain_of(self._worker.site, self._index, made, self._surface, time.perf_counter)
            chain.warm()
        except (ValueError, MemoryError, OverflowError) as error:
            raise WrongParts(f"these parts do not fit radar {self._worker.site.id}: {error}") from error
        return chain

    def _ended(self, well: bool, before: dict[str, Any], made: dict[str, Any]) -> None:
        if self._next is made:
            self._next = None
        if well:
            changed = [verb for verb in made if made[verb] != before[verb]]
            new, old = ({verb: which[verb] for verb in changed} for which in (made, before))
            settings = "; ".join(map(repr, new.values()))
            log.info("radar %s: %s in place of %s: %s", self._worker.site.id, _words(new), _words(old), settings)
            self._changed(_described(made))


def _built(wanted: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    made = {}
    for verb, choice in wanted.items():
        if verb not in FRONT_END:
            close = difflib.get_close_matches(verb, FRONT_END, n=1, cutoff=0.4)
            hint = f"did you mean {close[0]!r}?" if close else f"there are: {', '.join(FRONT_END)}"
            raise WrongParts(f"no part of a radar is called {verb!r}; {hint}")
        try:
            settings = {name: value for name, value in choice.items() if name != "name"}
            made[verb] = parts.build(verb, str(choice["name"]), settings)
        except parts.PartError as error:
            raise WrongParts(f"{verb}: {error}") from error
    return made


def _described(made: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {verb: catalogue.chosen(part) for verb, part in made.items()}


def _words(made: Mapping[str, Any]) -> str:
    return ", ".join(f"{verb} {catalogue.name_of(part)}" for verb, part in made.items())
