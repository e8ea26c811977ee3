"""Runs the radars' chains on recorded sweeps again: the same plots, or those of other parts."""

from __future__ import annotations

import logging
from typing import Any

from app.assembly import FRONT_END, build_parts, chain_of, radar_site
from app.journal.names import JournalError
from app.journal.reader import Record
from app.replay.recorded import RecordedRun
from pipeline import catalogue, parts
from pipeline.airport.surfaces import surface_of_radar
from pipeline.chain import RadarChain
from pipeline.engine_records import CHAIN, CODEC, SWEEPS, ChainBlock, ChainState
from pipeline.state import StateError
from pipeline.tables import SectorPlots, TableError

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
        """Take a record of sweeps or of a chain's state; others are none of its business. Raises JournalError."""
        if record.topic not in (SWEEPS, CHAIN):
            return
        try:
            body = CODEC.decode(record.data)
            if isinstance(body, ChainState):
                self._restore(body)
            elif isinstance(body, ChainBlock):
                self._work(body)
        except (StateError, TableError, parts.PartError, IndexError, ValueError) as error:
            raise JournalError(f"the record of topic {record.topic} at {record.time:.3f}: {error}") from error

    def sector(self, recorded: SectorPlots) -> SectorPlots | None:
        """What the chain makes of the block that `recorded` was made of; None when that block is not known."""
        waiting = self._made.get(key(recorded))
        return waiting.pop(0) if waiting else None

    def _restore(self, state: ChainState) -> None:
        chosen = {verb: self._part(verb, state) for verb in FRONT_END}
        if self._own and state.radar in self._chains:
            return  # other parts than the recorded ones: their own state goes on
        chain = self._chain(state.radar, chosen)
        if not self._own:
            chain.restore_whole(state.state)
        self._chains[state.radar] = chain

    def _part(self, verb: str, state: ChainState) -> Any:
        if verb in self._own:
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
        made = chain.process(body.block)
        self._made.setdefault(key(made), []).append(made)
        while len(self._made) > MOST_WAITING:
            self._made.pop(next(iter(self._made)))


def key(sector: SectorPlots) -> tuple[int, int, float]:
    """What a sector of the same block has in common, whatever parts made it."""
    return sector.radar, sector.scan, sector.time
