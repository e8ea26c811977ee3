"""The bench of the tracker: a thousand targets and 180 false plots a turn, and more targets at the same density.

Every time is a ratio to reading a 4 MiB frame once, in the same process and turn about, as in `bench_frontend`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch, Work
from pipeline.lab.measure.tracker_workload import TARGETS, Field, make_bench_tracker
from pipeline.tables import SectorPlots
from pipeline.track.tracker import Tracker

SECTORS = 32
"""Into which the radar chain cuts a turn."""

SETTLE = 12
"""Turns before the first that counts: tracks are confirmed, and as many false ones end as begin."""

WANTED = {"one_sector": 8.0, "sectors_32": 20.0, "report_table": 1.0}
"""Most times reading the frame once."""

MANY = 5000
"""Targets at which the growth of the cost is wanted."""

WANTED_GROWTH = 1.1
"""Most times in proportion to the targets that the cost may grow: 5.5 from 1,000 to MANY."""

FEWER = 2000
"""Targets where the tracker cannot hold the tracks of MANY."""

TRACKS_PER_TARGET = 2
"""Room in the tracker's table for each target: false plots begin half as many tentative tracks as there are targets."""


def frames(seed: int = 1) -> NDArray[np.uint8]:
    """Three frames of 4 MiB, read in turn so that none of them is still in the nearest cache."""
    return np.random.default_rng(seed).integers(0, 256, (3, 4096, 1024), np.uint8)


def bench_tracker(
    watch: Stopwatch, targets: int = TARGETS, many: int = MANY, settle: int = SETTLE, seed: int = 1
) -> list[BenchRow]:
    """Measure the tracker, all rows turn about: every turn is tracked in one sector, in 32, and with many targets.

    one_sector, sectors_32: the whole tracker on one turn. report_table: making the table of reported tracks.
    scaling_5000: cost of `many` targets in one sector over that of `targets`; measured with fewer and scaled in
    proportion, which its note says, where the tracker cannot hold as many tracks.
    """
    whole, cut = _Run(Field(targets, seed=seed), 1), _Run(Field(targets, seed=seed), SECTORS)
    grown = _grown(many, targets, seed)
    looking = Work("report_table", lambda turn: None, lambda _: whole.tracker.tracks())
    works = [whole.work("one_sector"), looking, cut.work("sectors_32"), grown.work("scaling_5000")]
    times, floor = watch.turn_about(works, settle)
    told = f"{targets:,} targets, {np.median(whole.plots[settle:]):,.0f} plots a turn"
    notes = {
        "one_sector": f"whole tracker, a turn as one sector: {told}",
        "sectors_32": f"whole tracker, a turn as {SECTORS} sectors: {told}",
        "report_table": f"Tracker.tracks(), {len(whole.tracker.tracks()):,} tracks",
    }
    column = {work.name: k for k, work in enumerate(works)}
    rows = [
        BenchRow.of(name, times[:, column[name]], floor[:, column[name]], note=notes[name], most_ratio=most)
        for name, most in WANTED.items()
    ]
    return [*rows, _growth(times[:, 0], times[:, 3], targets, grown, many)]


def _growth(few: NDArray[np.float64], more: NDArray[np.float64], targets: int, grown: _Run, many: int) -> BenchRow:
    measured = grown.field.targets
    part = many / measured  # 1 when all were measured
    note = f"one sector, {measured:,} targets over {targets:,} at the same density"
    if measured < many:
        note += f", times {part:g}: the tracker refuses the capacity that {many:,} targets need"
    if refused := grown.tracker.counters.get("no_room", 0):
        note += f"; {refused:,} plots found no room for a track"
    return BenchRow(
        "scaling_5000",
        float(np.median(more)),
        float(more.min()),
        float(np.median(more) / np.median(few) * part),
        least=float(more.min() / few.min() * part),
        note=note,
        most_ratio=WANTED_GROWTH * many / targets,
    )


class _Run:
    """A tracker and its field. plots: how many came each turn."""

    def __init__(self, field: Field, sectors: int, capacity: int = 2048) -> None:
        self.field, self._sectors = field, sectors
        self.tracker: Tracker = make_bench_tracker(field.site, capacity)
        self.tracker.warm()
        self.plots: list[int] = []

    def work(self, name: str) -> Work:
        """Taking one turn after the other."""
        return Work(name, self._prepare, self._take)

    def _prepare(self, turn: int) -> Sequence[SectorPlots]:
        made = self.field.sectors(turn, self._sectors)
        self.plots.append(sum(len(one.plots) for one in made))
        return made

    def _take(self, sectors: Sequence[SectorPlots]) -> Any:
        for sector in sectors:
            self.tracker.sector(sector)


def _grown(many: int, targets: int, seed: int) -> _Run:
    """A run with many targets, or with FEWER when the tracker refuses the capacity for them."""
    try:
        return _Run(Field(many, seed=seed), 1, TRACKS_PER_TARGET * many)
    except ValueError:
        fewer = min(FEWER, many)
        return _Run(Field(fewer, seed=seed), 1, TRACKS_PER_TARGET * fewer)
