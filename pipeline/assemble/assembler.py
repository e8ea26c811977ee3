"""The assembler: radar messages in the order of their arrival in, `Sweeps` blocks on the azimuth grid out.

It asks no clock: the time of arrival comes with each message and serves to find the day of the message's time of day,
to judge steps of the radar's clock, and as the time of sweeps that carry none. The same messages in the same order
give the same blocks, however they are cut into batches.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.assemble.fill import FILLED, order_and_fill
from pipeline.assemble.refusal import Refusals
from pipeline.assemble.spacing import begin
from pipeline.assemble.state import COUNTERS, HAVE, PLACED_FIELDS, GridRules, new_state
from pipeline.asterix.cat240_batch import VideoBatch, decode_batch
from pipeline.asterix.cat240_decode import REASONS
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps

LIGHT_M_PER_S = 299_792_458.0

MOST_HELD = 64
"""Messages that wait for a second azimuth, at most: a sweep in parts has fewer; a standing antenna has no second."""


class Assembler:
    """The state of one radar's assembly.

    site: gives the grid and the offset of north. index: of the radar in the engine. blocks_per_scan: blocks a turn; a
    block is handed on as soon as its last row is in. sac, sic: take messages of this source only; None takes the one
    that is heard first, and another when that falls silent. resample: bring cells of another length to the grid's
    instead of refusing them; where they reach less far the rest is 0.

    Rules: a message covers the grid rows whose centre lies between its start azimuth and that of the next one (its end
    azimuth where the ends of this radar agree with that, see `pipeline.assemble.spacing`), or the row it lies in when
    it is finer than the grid (cells of several such messages: the greatest). Parts of one azimuth that follow each
    other in range are joined; a row that stays short is not handed on. What is not taken is counted by reason, see
    `pipeline.assemble.state.COUNTERS`, and told in words by `refusals`.
    """

    def __init__(
        self,
        site: RadarSite,
        index: int,
        blocks_per_scan: int = 32,
        *,
        sac: int | None = None,
        sic: int | None = None,
        resample: bool = False,
    ) -> None:
        video = site.video
        if not 1 <= blocks_per_scan <= video.azimuths:
            raise ValueError(f"{blocks_per_scan} blocks do not divide {video.azimuths} azimuths")
        self.site = site
        self.index = index
        self._rules = GridRules(
            azimuths=video.azimuths,
            ranges=video.ranges,
            first_cell=round(video.first_range_m / video.range_step_m),
            cell_fs=2e15 * video.range_step_m / LIGHT_M_PER_S,
            offset=round(site.north_offset / (2 * math.pi) * 2**26) % 2**26,
            period=video.period_s,
            source_mask=(0 if sac is None else 0xFF00) | (0 if sic is None else 0x00FF),
            source=(sac or 0) << 8 | (sic or 0),
            resample=int(resample),
        )
        edges = -(-np.arange(blocks_per_scan + 1) * video.azimuths // blocks_per_scan)
        self._edges = edges.astype(np.int64)
        self._order, self._clock, self._seen = new_state()
        self._counts = np.zeros(len(COUNTERS), np.int64)
        self.refusals = Refusals(self._rules)
        self._held: VideoBatch | None = None
        self._held_arrival = np.zeros(0)
        self._decoding: dict[str, int] = dict.fromkeys((*REASONS, "summary"), 0)
        self._block = np.array([-1, -1, 0, 0, 0, 0], np.int64)
        self._rows = int(np.diff(edges).max())
        self._arrived = math.nan
        self._new_buffers()

    def push_datagrams(
        self, datagrams: NDArray[np.uint8], lengths: NDArray[np.int32], arrival: NDArray[np.float64]
    ) -> list[Sweeps]:
        """Decode datagrams (n, width) uint8 of `lengths` octets and push what they hold.

        arrival: (n,) float64 UTC seconds. The datagrams may be overwritten afterwards.
        """
        blocks: list[Sweeps] = []
        for batch, origin in decode_batch(datagrams, lengths, self._decoding):
            blocks += self.push(batch, arrival[origin])
        return blocks

    def push(self, batch: VideoBatch, arrival: NDArray[np.float64]) -> list[Sweeps]:
        """Take messages in the order of their arrival; gives the blocks that they complete.

        arrival: (n,) float64 UTC seconds. The very first message waits for the next azimuth when its end does not fit
        the grid.
        """
        arrival = np.ascontiguousarray(arrival, np.float64)
        self.refusals.note(batch.fields)
        if self._held is not None:
            batch, arrival = self._held.joined(batch), np.concatenate([self._held_arrival, arrival])
            self._held = None
        if self._order[HAVE] == 0 and not self._begun(batch) and len(batch) <= MOST_HELD:
            self._held, self._held_arrival = batch.joined(VideoBatch.of([])), arrival
            return []
        return self._push(batch, arrival)

    def _begun(self, batch: VideoBatch) -> bool:
        return bool(begin(batch.fields, self._rules, self._order, self.refusals.newest, self._counts))

    def _push(self, batch: VideoBatch, arrival: NDArray[np.float64]) -> list[Sweeps]:
        n = len(batch)
        placed = np.empty((n, PLACED_FIELDS), np.int64)
        times = np.empty((n, 2))
        blocks: list[Sweeps] = []
        at, row = -1, -1
        while True:
            at, row, full = order_and_fill(
                batch.fields, batch.octets, arrival, self._rules, self._order, self._clock, self._seen, placed, times,
                self.refusals.newest, at, row, self._edges, self._block, self._amplitude, self._cover,
                self._converted, self._key, self._time, self._azimuth, self._counts,
            )  # fmt: skip
            if full != FILLED:
                self._arrived = float(arrival[-1]) if n else self._arrived
                return blocks
            block = self._close(row if at < n else -1, float(arrival[at - 1]) if at else self._arrived)
            if block is not None:
                blocks.append(block)

    def flush(self) -> list[Sweeps]:
        """What is in the open block, or still waits; for the end of a recording."""
        held, self._held = self._held, None
        blocks = [] if held is None else self._push(held, self._held_arrival)
        block = self._close(-1, self._arrived) if self._block[0] >= 0 else None
        return blocks if block is None else [*blocks, block]

    @property
    def counters(self) -> dict[str, int]:
        """What was taken, and what was not by reason."""
        return {name: int(count) for name, count in zip(COUNTERS, self._counts, strict=True)} | self._decoding

    def _new_buffers(self) -> None:
        rows, ranges = self._rows, self._rules.ranges
        self._amplitude = np.zeros((rows, ranges), np.uint8)
        self._cover = np.zeros(rows, np.int32)
        self._converted = np.zeros(rows, np.bool_)
        self._key = np.zeros(rows, np.int64)
        self._time = np.zeros(rows)
        self._azimuth = np.zeros(rows)

    def _close(self, next_row: int, arrival: float) -> Sweeps | None:
        start, end, gap = int(self._block[0]), int(self._block[1]), bool(self._block[3])
        azimuths, ranges = self._rules.azimuths, self._rules.ranges
        rows = end - start
        cover = self._cover[:rows]
        converted = self._converted[:rows]
        # what was resampled may reach less far than the grid
        reach = max(1, int(cover[converted].max(initial=0)))
        wanted = np.where(converted, reach, ranges)
        whole = np.flatnonzero(cover >= wanted)
        short = int(np.count_nonzero(cover)) - len(whole)
        if short and not gap:
            self.refusals.note_short(int(cover[cover < wanted].max(initial=0)))
        self._counts[COUNTERS.index("incomplete" if gap else "wrong_cell_count")] += short
        self._counts[COUNTERS.index("sweeps")] += len(whole)
        scan = start // azimuths
        last = end % azimuths == 0 or (next_row >= 0 and next_row // azimuths != scan)
        made = None
        if len(whole):
            amplitude = self._amplitude[:rows] if len(whole) == rows else self._amplitude[whole]
            made = Sweeps(
                radar=self.index,
                scan=scan,
                row=(whole + start % azimuths).astype(np.int32),
                azimuth=self._azimuth[whole],
                time=self._time[whole],
                amplitude=amplitude,
                last=last,
                arrival=arrival,
            )
        self._block[:] = (-1, -1, max(end, int(self._block[2])), 0, 0, 0)
        self._new_buffers()
        return made
