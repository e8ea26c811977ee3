"""Runs the radars' chains on recorded sweeps again: the same plots, or those of other parts."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

from app.assembly import FRONT_END, build_parts, chain_of, parts_of, radar_site
from app.journal.names import JournalError
from app.journal.reader import Record
from app.replay.recorded import RecordedRun
from pipeline import catalogue, parts
from pipeline.airport.surfaces import surface_of_radar
from pipeline.chain import RadarChain
from pipeline.engine_records import CHAIN, CODEC, SWEEPS, ChainBlock, ChainState
from pipeline.state import StateError
from pipeline.tables import Plots, SectorPlots, TableError

log = logging.getLogger(__name__)

MOST_WAITING = 4096
"""Sectors kept for the engine's inputs to come: more than any queue between radar and engine holds."""


class VideoReplay:
    """The chains of one run, fed with its records.

    own: verbs whose recorded parts give way to those of the settings; without any, chains are as they were recorded
    and go on from their recorded state.
    """

    def __init__(self, run: RecordedRun, own: frozenset[str] = frozenset()) -> None:
        self._run, self._own = run, own
        self._chains: dict[int, RadarChain] = {}
        self._surfaces: dict[int, Any] = {}
        self._made: dict[tuple[int, int, float], list[SectorPlots]] = {}

    def take(self, record: Record) -> None:
        """Take a record of sweeps or of a chain's state; other topics are ignored. Raises JournalError."""
        if record.topic not in (SWEEPS, CHAIN):
            return
        try:
            body = CODEC.decode(record.data)
            if isinstance(body, ChainState):
                self._restore(body)
            elif isinstance(body, ChainBlock):
                self._work(body)
        except (StateError, TableError, parts.PartError, IndexError, KeyError, ValueError) as error:
            raise JournalError(f"the record of topic {record.topic} at {record.time:.3f}: {error}") from error

    def sector(self, recorded: SectorPlots) -> SectorPlots | None:
        """What the chain makes of the block that `recorded` was made of; None when that block is not known.

        Chains with own parts are not flushed where the recorded ones were: nothing then comes of a recorded flush.
        """
        waiting = self._made.get(key(recorded))
        if waiting:
            return waiting.pop(0)
        if waiting is None or not self._own:
            return None
        return replace(recorded, plots=Plots.empty(), closed_to=recorded.closed_from)

    def forget(self) -> None:
        """Records are missing: recorded chains wait for their next recorded state; those with own parts go on."""
        self._made.clear()
        if not self._own:
            self._chains.clear()

    def _restore(self, state: ChainState) -> None:
        as_recorded = {verb: self._part(verb, state, frozenset()) for verb in FRONT_END}
        chosen = {verb: self._part(verb, state, self._own) for verb in FRONT_END}
        running = self._chains.get(state.radar)
        if self._own and running is not None and parts_of(running) == chosen:
            return  # other parts than the recorded ones: their own state goes on
        chain = self._chain(state.radar, as_recorded)
        chain.restore_whole(state.state)
        if self._own:  # what the recorded detector had learned is of use to the same one with other parts behind it
            other = self._chain(state.radar, chosen)
            other.take_over(chain)
            chain = other
        self._chains[state.radar] = chain

    def _part(self, verb: str, state: ChainState, own: frozenset[str]) -> Any:
        if verb in own:
            return build_parts(self._run.settings, (verb,))[verb]
        settings = dict(state.parts[verb])
        return parts.build(verb, settings.pop("name"), settings)

    def _chain(self, radar: int, chosen: dict[str, Any]) -> RadarChain:
        site = radar_site(self._run.settings.radars[radar], self._run.airport)
        if radar not in self._surfaces:
            self._surfaces[radar] = surface_of_radar(self._run.airport, site)
        chain = chain_of(site, radar, chosen, self._surfaces[radar])
        log.info("radar %s: %s", site.id, ", ".join(catalogue.name_of(one) for one in chosen.values()))
        return chain

    def _work(self, body: ChainBlock) -> None:
        chain = self._chains.get(body.block.radar)
        if chain is None:
            return  # its state comes with the next snapshot
        if body.expected is not None:
            chain.expect(*body.expected)
        try:
            made = chain.process(body.block)
        except Exception:
            # the live chain failed at the same place, and went on
            log.debug("a block of scan %d could not be worked on", body.block.scan, exc_info=True)
            return
        self._made.setdefault(key(made), []).append(made)
        while len(self._made) > MOST_WAITING:
            self._made.pop(next(iter(self._made)))


def key(sector: SectorPlots) -> tuple[int, int, float]:
    """What a sector of the same block has in common, whatever parts made it."""
    return sector.radar, sector.scan, sector.time
