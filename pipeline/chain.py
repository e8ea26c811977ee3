"""One radar's chain: blocks of sweeps in, the plots of sectors out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detect import Detector
from pipeline.extract import Extractor
from pipeline.sites import RadarSite
from pipeline.state import StateError
from pipeline.tables import Detections, Plots, SectorPlots, Sweeps, TableError, VideoFormat


class RadarChain:
    """Detection and extraction of one radar, block after block.

    site: the radar. index: its place in the engine, written into every plot. detector, extractor: parts of
    `pipeline.detect` and `pipeline.extract`. surface: (azimuths, ranges) uint8 kind of surface of each cell, for
    detectors that use it. clock: seconds of any steady clock; with it `timings` holds the seconds of each stage for the
    newest block. newest: (azimuths, ranges) uint8, the newest turn for displays, written in place; rows that were not
    received are 0.
    """

    def __init__(
        self,
        site: RadarSite,
        index: int,
        detector: Detector,
        extractor: Extractor,
        surface: NDArray[np.uint8] | None = None,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.site = site
        self.index = index
        self.detector = detector
        self.extractor = extractor
        self.newest: NDArray[np.uint8] = np.zeros((site.video.azimuths, site.video.ranges), np.uint8)
        self.time = float("nan")
        self.timings: dict[str, float] = {}
        self._clock = clock
        self._detecting = detector.start(site.video, surface)
        self._extracting = extractor.start(site)
        self._next_row = -1
        self._closed_to = -1
        self._counts = dict.fromkeys(
            ("blocks", "sweeps", "missing_sweeps", "late_blocks", "late_sweeps", "plots", "degraded_blocks"), 0
        )

    @property
    def counters(self) -> dict[str, int]:
        """What was worked on, and what was not, by reason; they only grow."""
        return {**self._counts, **self._detecting.counters, **self._extracting.counters}

    def process(self, block: Sweeps) -> SectorPlots:
        """Work on one block; blocks come in order of scan and row, with gaps where nothing was received.

        Sweeps that are not newer than those already worked on are refused and counted. Raises TableError, changing
        nothing, when the block does not fit the video format or its times or azimuths are not finite.
        """
        self._check(block)
        fresh = self._fresh(block)
        if not len(fresh):
            return self._sector(block.scan, Plots.empty(), degraded=False)
        self._count(fresh)
        self._timed("keep", self._keep, fresh)
        found: Detections = self._timed("detect", self.detector, fresh, self._detecting)
        plots: Plots = self._timed("extract", self.extractor, fresh, found, self._extracting)
        self.time = float(fresh.time[-1])
        self._counts["plots"] += len(plots)
        self._counts["degraded_blocks"] += found.degraded
        return self._sector(block.scan, plots, found.degraded)

    def flush(self) -> SectorPlots:
        """Deliver the plots that are still open, as at the end of a recording."""
        plots = self.extractor.flush(self._extracting)
        self._counts["plots"] += len(plots)
        return self._sector(max(0, self._next_row - 1) // self.site.video.azimuths, plots, degraded=False)

    def save(self) -> dict[str, NDArray[Any]]:
        """Everything that must survive a restart, as arrays by name (fit for `numpy.savez`); the picture is not in
        it."""
        kept = {f"detect.{name}": array for name, array in self._detecting.save().items()}
        kept |= {f"extract.{name}": array for name, array in self._extracting.save().items()}
        kept["chain.parts"] = np.array(self._parts())
        kept["chain.rows"] = np.array([self._next_row, self._closed_to], np.int64)
        kept["chain.time"] = np.array([self.time])
        return kept

    def restore(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Take up what save() gave. Raises StateError when it belongs to other parts, settings or another video
        format."""
        try:
            parts, rows, time = saved["chain.parts"], saved["chain.rows"], saved["chain.time"]
        except KeyError as missing:
            raise StateError(f"the saved state has no {missing}") from missing
        if list(parts) != self._parts():
            raise StateError(f"the saved state belongs to {', '.join(map(str, parts))}")
        before = self._detecting.save()
        self._detecting.restore(_under("detect.", saved))
        try:
            self._extracting.restore(_under("extract.", saved))
        except StateError:
            self._detecting.restore(before)
            raise
        self._next_row, self._closed_to = (int(one) for one in rows)
        self.time = float(time[0])

    def warm(self) -> None:
        """Compile everything (or load it from the cache) on a tiny radar, leaving this chain's state alone."""
        video = VideoFormat(azimuths=64, ranges=80, period_s=1.0, db_per_step=self.site.video.db_per_step)
        tiny = RadarChain(replace(self.site, video=video), self.index, self.detector, self.extractor)
        rng = np.random.default_rng(0)
        row = np.arange(64, dtype=np.int32)
        for scan in range(3):
            amplitude = rng.integers(20, 60, (64, 80), dtype=np.uint8)
            amplitude[10:14, 20:24] = 200
            azimuth = ((row + 0.5) * video.azimuth_step_rad).astype(np.float64)
            tiny.process(Sweeps(0, scan, row, azimuth, azimuth + scan, amplitude, last=True))
        tiny.flush()

    def _parts(self) -> list[str]:
        return [type(self.detector).__name__, type(self.extractor).__name__]

    def _check(self, block: Sweeps) -> None:
        video = self.site.video
        if block.amplitude.shape[1] != video.ranges:
            raise TableError(f"radar {self.site.id}: {video.ranges} range cells wanted, not {block.amplitude.shape[1]}")
        if not len(block):
            return
        if block.scan < 0 or block.row[0] < 0 or block.row[-1] >= video.azimuths:
            raise TableError(f"radar {self.site.id}: rows outside 0 .. {video.azimuths - 1}, or a scan below 0")
        if not (np.isfinite(block.time).all() and np.isfinite(block.azimuth).all()):
            raise TableError(f"radar {self.site.id}: a time or an azimuth is not finite")

    def _fresh(self, block: Sweeps) -> Sweeps:
        first = block.scan * self.site.video.azimuths
        late = int(np.searchsorted(block.row, self._next_row - first)) if self._next_row > first else 0
        if late:
            self._counts["late_sweeps"] += late
            self._counts["late_blocks"] += 1
            block = replace(
                block,
                row=block.row[late:],
                azimuth=block.azimuth[late:],
                time=block.time[late:],
                amplitude=block.amplitude[late:],
            )
        return replace(block, radar=self.index) if block.radar != self.index else block

    def _count(self, block: Sweeps) -> None:
        first, newest = (block.scan * self.site.video.azimuths + int(block.row[at]) for at in (0, -1))
        if self._next_row < 0:
            self._next_row = self._closed_to = first
        self._counts["blocks"] += 1
        self._counts["sweeps"] += len(block)
        self._counts["missing_sweeps"] += newest + 1 - self._next_row - len(block)

    def _keep(self, block: Sweeps) -> None:
        azimuths = self.site.video.azimuths
        first = block.scan * azimuths
        newest = first + int(block.row[-1])
        gap_from = max(self._next_row, newest + 1 - azimuths)
        if newest + 1 - gap_from > len(block):
            rows = np.arange(gap_from, newest + 1) % azimuths
            self.newest[rows] = 0
        if int(block.row[-1]) - int(block.row[0]) + 1 == len(block):
            self.newest[block.row[0] : block.row[-1] + 1] = block.amplitude
        else:
            self.newest[block.row] = block.amplitude
        self._next_row = newest + 1

    def _sector(self, scan: int, plots: Plots, degraded: bool) -> SectorPlots:
        closed_from = self._closed_to
        if self._next_row >= 0:
            self._closed_to = max(closed_from, int(self._extracting.closed_row))
        return SectorPlots(
            radar=self.index,
            scan=scan,
            time=self.time,
            closed_from=max(closed_from, 0),
            closed_to=max(self._closed_to, 0),
            plots=plots,
            degraded=degraded,
        )

    def _timed(self, stage: str, work: Callable[..., Any], *words: Any) -> Any:
        if self._clock is None:
            return work(*words)
        begin = self._clock()
        result = work(*words)
        self.timings[stage] = self._clock() - begin
        return result


def _under(prefix: str, saved: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(prefix): array for name, array in saved.items() if name.startswith(prefix)}
