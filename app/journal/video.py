"""Hands the raw sweeps of the radars to the journal, with the state of their chains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from app.assembly import parts_of
from app.journal.writer import JournalWriter
from pipeline import catalogue
from pipeline.chain import RadarChain
from pipeline.engine_records import CHAIN, CODEC, SWEEPS, ChainBlock, ChainState
from pipeline.tables import Sweeps
from pipeline.tables.arrays import Floats

HEAD_BYTES = 4096
"""What a record of sweeps holds besides the cells, about."""


class VideoRecorder:
    """The journal as the thread of one radar sees it. now: UTC s of this host.

    The state of the chain is recorded anew whenever other parts have taken over and after every snapshot of the engine,
    so that each file can be replayed by itself.
    """

    def __init__(self, writer: JournalWriter, now: Callable[[], float]) -> None:
        self._writer, self._now = writer, now
        self._chain: RadarChain | None = None
        self._snapshots = 0
        self._expected: Floats | None = None

    def before(self, chain: RadarChain, block: Sweeps) -> None:
        """`chain` is about to work on `block`."""
        taken = self._writer.snapshots_taken
        if not taken:
            return  # a journal begins with a snapshot of the engine
        now = self._now()
        if chain is not self._chain or taken != self._snapshots:
            self._chain, self._snapshots, self._expected = chain, taken, chain.expected
            parts = {verb: catalogue.chosen(part) for verb, part in parts_of(chain).items()}
            state = ChainState(chain.index, parts, chain.save_whole())
            self._writer.put(CHAIN, now, partial(CODEC.encode, state))
        expected = chain.expected
        same = self._expected is not None and np.array_equal(expected, self._expected)
        self._expected = expected
        # the receiver may use the memory of the block again
        kept = replace(
            block,
            amplitude=block.amplitude.copy(),
            row=block.row.copy(),
            azimuth=block.azimuth.copy(),
            time=block.time.copy(),
        )
        self._writer.put(
            SWEEPS,
            now,
            partial(CODEC.encode, ChainBlock(kept, None if same else expected)),
            size=block.amplitude.nbytes + HEAD_BYTES,
        )
