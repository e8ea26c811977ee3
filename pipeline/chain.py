"""One radar's chain: blocks of sweeps in, the plots of sectors out."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.bearing.of_plots import NOTHING_EXPECTED, Expectations, PlotBearings
from pipeline.contracts.bearing import BearingEstimator
from pipeline.contracts.detect import Detector
from pipeline.contracts.extract import Extractor
from pipeline.kernels.scan_convert import plot_images
from pipeline.sites import RadarSite
from pipeline.state import StateError
from pipeline.tables import Detections, Plots, SectorPlots, Sweeps, TableError, VideoFormat, passed_marks

PIECES = 8
"""A block is worked on in pieces of at most this part of a turn."""


class RadarChain:
    """Detection, extraction and bearings of one radar, block after block.

    site: the radar. index: its place in the engine, written into every plot. detector, extractor, bearing: parts of
    `pipeline.detect`, `pipeline.extract` and `pipeline.bearing`; without the last, plots have the axis of their cells.
    surface: (azimuths, ranges) uint8 kind of surface of each cell, for
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
        bearing: BearingEstimator | None = None,
    ) -> None:
        self.site = site
        self.index = index
        self.detector = detector
        self.extractor = extractor
        self.bearing = bearing
        self.newest: NDArray[np.uint8] = np.zeros((site.video.azimuths, site.video.ranges), np.uint8)
        self.time = float("nan")
        self.timings: dict[str, float] = {}
        self._clock = clock
        self._detecting = detector.start(site.video, surface, growth_db=getattr(extractor, "growth_db", None))
        self._extracting = extractor.start(site)
        self._bearings = None if bearing is None else PlotBearings(site, bearing)
        self._surface = "none" if surface is None else f"{zlib.crc32(np.ascontiguousarray(surface).tobytes()):08x}"
        self._next_row = -1
        self._closed_to = -1
        self._scans_before = 0
        self._carried: dict[str, int] = {}
        self._counts = dict.fromkeys(
            ("blocks", "sweeps", "missing_sweeps", "late_blocks", "late_sweeps", "plots", "degraded_blocks"), 0
        )

    @property
    def counters(self) -> dict[str, int]:
        """What was worked on, and what was not, by reason; they only grow."""
        own = self._own_counters()
        return {**self._carried, **{name: count + self._carried.get(name, 0) for name, count in own.items()}}

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
        azimuths = self.site.video.azimuths
        marks = passed_marks(fresh.scan * azimuths, fresh.row, fresh.time, self._next_row, azimuths)
        spent: dict[str, float] = {}
        made, degraded = [], False
        for piece in _pieces(fresh, azimuths // PIECES):
            self._timed(spent, "keep", self._keep, piece)
            found: Detections = self._timed(spent, "detect", self.detector, self._numbered(piece), self._detecting)
            plots: Plots = self._timed(spent, "extract", self.extractor, piece, found, self._extracting)
            if self._bearings is not None:
                plots = self._timed(spent, "bearing", self._bearings, plots, self.newest)
            made.append(plots)
            degraded |= found.degraded
        self.timings = spent
        self.time = float(fresh.time[-1])
        plots = made[0] if len(made) == 1 else Plots.concatenate(made)
        self._counts["plots"] += len(plots)
        self._counts["degraded_blocks"] += degraded
        return self._sector(block.scan, plots, degraded, *marks)

    def flush(self) -> SectorPlots:
        """Deliver the plots that are still open, as at the end of a recording."""
        plots = self.extractor.flush(self._extracting)
        if self._bearings is not None:
            plots = self._bearings(plots, self.newest)
        self._counts["plots"] += len(plots)
        return self._sector(max(0, self._next_row - 1) // self.site.video.azimuths, plots, degraded=False)

    def expect(self, east: ArrayLike, north: ArrayLike, heading: ArrayLike, sd: ArrayLike) -> None:
        """What tracks expect from now on, one value a track: where they are (m from the airport's reference point) and
        how they point (rad from true north, standard deviation rad); plots near such a place take it for their bearing.

        Replaces what was expected before; any thread may call it. Without it bearings depend on the video only. Raises
        ValueError for columns of different lengths.
        """
        if self._bearings is not None:
            self._bearings.expected = Expectations.of(east, north, heading, sd)

    def images(self, plots: Plots, *, step_m: float = 1.5, size: int = 64) -> NDArray[np.uint8]:
        """(n, size, size) mean log amplitude of the ground about each plot, north up, east to the right, `step_m`
        metres a pixel; 0 outside the video. For plots just delivered: the picture is of the newest turn. Raises
        ValueError for an image without pixels."""
        return plot_images(plots, self.newest, self.site, step=step_m, size=size)

    def save(self) -> dict[str, NDArray[Any]]:
        """Everything that must survive a restart, as arrays by name (fit for `numpy.savez`); the picture is not in
        it."""
        kept = {f"detect.{name}": array for name, array in self._detecting.save().items()}
        kept |= {f"extract.{name}": array for name, array in self._extracting.save().items()}
        kept |= {f"chain.{name}": np.array(words) for name, words in self._origin().items()}
        kept["chain.rows"] = np.array([self._next_row, self._closed_to, self._scans_before], np.int64)
        kept["chain.time"] = np.array([self.time])
        return kept

    def restore(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Take up what save() gave and go on at the row after it. Raises StateError when it belongs to other parts,
        settings, another site, video format or map."""
        rows, time = _numbers(saved, "chain.rows", 3), _numbers(saved, "chain.time", 1)
        self._check_origin(saved)
        before = self._detecting.save()
        self._detecting.restore(_under("detect.", saved))
        try:
            self._extracting.restore(_under("extract.", saved))
        except StateError:
            self._detecting.restore(before)
            raise
        self._next_row, self._closed_to, self._scans_before = (int(one) for one in rows)
        self.time = float(time[0])

    def save_whole(self) -> dict[str, NDArray[Any]]:
        """save() with all else that the next plots depend on: the newest turn, and which plots got a bearing."""
        bearings = self._bearings
        place = (-1, 0) if bearings is None else bearings.place
        expected = NOTHING_EXPECTED if bearings is None else bearings.expected
        return {
            **{name: _plain(array) for name, array in self.save().items()},
            "whole.newest": self.newest.copy(),
            "whole.place": np.array(place, np.int64),
            "whole.expected": expected.table(),
        }

    def restore_whole(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Take up what save_whole() gave: the same blocks then give the same plots. Raises StateError."""
        newest, place, expected = (saved.get(f"whole.{one}") for one in ("newest", "place", "expected"))
        if newest is None or place is None or expected is None or newest.shape != self.newest.shape:
            raise StateError("the saved state is not whole, or of another video format")
        mine = {name: array.dtype for name, array in self.save().items()}
        kept = {name: array for name, array in saved.items() if not name.startswith("whole.")}
        self.restore({name: _typed(array, mine.get(name)) for name, array in kept.items()})
        self.newest[...] = newest
        if self._bearings is not None:
            self._bearings.place = (int(place[0]), int(place[1]))
            self._bearings.expected = Expectations.of(*expected)

    @property
    def expected(self) -> NDArray[np.float64]:
        """(4, n) what expect() was last given, without what is not used: east and north m, heading rad, its sd rad."""
        return (NOTHING_EXPECTED if self._bearings is None else self._bearings.expected).table()

    def resume(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Take up what the detector of save() had learned, and count rows and scans anew: for the start of a process.

        Raises StateError, changing nothing, when a block was already worked on, or when it belongs to another
        detector, other settings of it, another site, video format or map.
        """
        if self._next_row >= 0:
            raise StateError("only a chain that has not begun can resume")
        rows = _numbers(saved, "chain.rows", 3)
        self._check_origin(saved, besides="extract")
        if not (-1 <= rows[0] < 2**48 and 0 <= rows[2] < 2**32):
            raise StateError("the saved rows cannot be true")
        learned = _under("detect.", saved)
        for name, array in learned.items():
            least = 0 if name == "budget" else -np.inf
            if array.dtype.kind == "f" and not (np.isfinite(array) & (array >= least)).all():
                raise StateError(f"{name}: numbers that cannot be true")
        self._detecting.restore(learned)
        self._scans_before = int(rows[2] - -rows[0] // self.site.video.azimuths)
        self._carry({})

    def learn(self, block: Sweeps) -> None:
        """Let the detector learn from a block that another chain works on. Raises TableError like process()."""
        self._check(block)
        fresh = self._fresh(block)
        if len(fresh):
            self.detector(self._numbered(fresh), self._detecting)
            self._next_row = fresh.scan * self.site.video.azimuths + int(fresh.row[-1]) + 1

    def take_over(self, before: RadarChain) -> None:
        """Go on where `before`, a chain of the same radar, stopped: its rows, picture and counters; and what its
        detector had learned, when this one is the same. Call before.flush() first. Raises ValueError for another
        site."""
        if before.site != self.site:
            raise ValueError(f"a chain of radar {self.site.id} cannot take over from one of {before.site.id}")
        if self.detects_like(before):
            self._detecting.restore(before._detecting.save())
            self._scans_before = before._scans_before
        self.newest, self.time = before.newest, before.time
        self._next_row, self._closed_to = before._next_row, before._closed_to
        self._carry(before.counters)

    def detects_like(self, other: RadarChain) -> bool:
        """The detector of both is the same, on the same map: what one has learned fits the other."""
        return (self.detector, self._surface) == (other.detector, other._surface)

    @property
    def scans_to_learn(self) -> int:
        """Scans for which the detector only learns before it detects."""
        return int(getattr(self.detector, "learn_scans", 0))

    def warm(self) -> None:
        """Compile everything (or load it from the cache) on a tiny radar, leaving this chain's state alone."""
        video = VideoFormat(azimuths=64, ranges=80, period_s=1.0, db_per_step=self.site.video.db_per_step)
        there = replace(self.site, video=video, height=0.0)
        tiny = RadarChain(there, self.index, self.detector, self.extractor, bearing=self.bearing)
        rng = np.random.default_rng(0)
        row = np.arange(64, dtype=np.int32)
        for scan in range(3):
            amplitude = rng.integers(20, 60, (64, 80), dtype=np.uint8)
            amplitude[10:14, 20:24] = 200
            azimuth = ((row + 0.5) * video.azimuth_step_rad).astype(np.float64)
            tiny.process(Sweeps(0, scan, row, azimuth, azimuth + scan, amplitude, last=True))
        tiny.flush()

    def _own_counters(self) -> dict[str, int]:
        bearings = {} if self._bearings is None else self._bearings.counters
        return {**self._counts, **self._detecting.counters, **self._extracting.counters, **bearings}

    def _carry(self, counted: Mapping[str, int]) -> None:
        """Let the counters go on from these."""
        own = self._own_counters()
        self._carried = {name: counted.get(name, 0) - own.get(name, 0) for name in {**own, **counted}}

    def _origin(self) -> dict[str, str]:
        """What a saved state belongs to."""
        parts = {"detect": repr(self.detector), "extract": repr(self.extractor)}
        return {**parts, "site": repr(self.site), "map": self._surface}

    def _check_origin(self, saved: Mapping[str, NDArray[Any]], besides: str = "") -> None:
        for name, mine in self._origin().items():
            given = saved.get(f"chain.{name}")
            if given is None:
                raise StateError(f"the saved state has no 'chain.{name}'")
            if name != besides and str(given) != mine:
                raise StateError(f"the saved state belongs to another {name}: {str(given)[:300]}, not {mine}")

    def _numbered(self, block: Sweeps) -> Sweeps:
        """The block with its scan as the detector counts: its scans go on rising when those of the rows begin anew."""
        return replace(block, scan=block.scan + self._scans_before) if self._scans_before else block

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

    def _sector(self, scan: int, plots: Plots, degraded: bool, *marks: NDArray[Any]) -> SectorPlots:
        closed_from = self._closed_to
        if self._next_row >= 0:
            self._closed_to = max(closed_from, int(self._extracting.closed_row))
        closed = max(closed_from, 0), max(self._closed_to, 0)
        mark, time = marks or (np.empty(0, np.int64), np.empty(0))
        return SectorPlots(self.index, scan, self.time, *closed, plots, degraded, mark, time)

    def _timed(self, spent: dict[str, float], stage: str, work: Callable[..., Any], *words: Any) -> Any:
        if self._clock is None:
            return work(*words)
        begin = self._clock()
        result = work(*words)
        spent[stage] = spent.get(stage, 0.0) + self._clock() - begin
        return result


def _pieces(block: Sweeps, most: int) -> Iterator[Sweeps]:
    """The block cut so that the newest turn still shows the sweeps of a plot when that is complete."""
    if not block.row[-1] - block.row[0] >= most > 0:
        yield block
        return
    edges = np.searchsorted(block.row, np.arange(block.row[0], block.row[-1] + most, most))
    cuts = [int(one) for one in np.unique(np.append(edges, len(block)))]
    for a, b in pairwise(cuts):
        yield replace(
            block,
            row=block.row[a:b],
            azimuth=block.azimuth[a:b],
            time=block.time[a:b],
            amplitude=block.amplitude[a:b],
            last=block.last and b == len(block),
        )


def _under(prefix: str, saved: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(prefix): array for name, array in saved.items() if name.startswith(prefix)}


def _plain(array: NDArray[Any]) -> NDArray[Any]:
    """Records with named fields as their octets, (..., octets of one); other arrays as they are."""
    if array.dtype.names is None:
        return array
    return np.ascontiguousarray(array)[..., None].view(np.uint8)


def _typed(array: NDArray[Any], wanted: np.dtype[Any] | None) -> NDArray[Any]:
    """The inverse of _plain(); wanted: the dtype. Raises StateError when the octets have another size."""
    if wanted is None or wanted.names is None:
        return array
    if array.dtype != np.uint8 or array.ndim < 1 or array.shape[-1] != wanted.itemsize:
        raise StateError(f"the saved state has records of another form than {wanted}")
    return np.ascontiguousarray(array).view(wanted)[..., 0]


def _numbers(saved: Mapping[str, NDArray[Any]], name: str, many: int) -> NDArray[Any]:
    """The saved array called so. Raises StateError when it is not that many numbers."""
    array = saved.get(name)
    if array is None or array.shape != (many,) or array.dtype.kind not in "if":
        raise StateError(f"the saved state has no {name!r}, or not {many} numbers in it")
    return array
