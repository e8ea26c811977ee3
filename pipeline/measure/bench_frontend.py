"""The front end's workload for the bench: 4096 x 1024 x 8 bit a turn, at about 3,000 and about 40,000 runs.

Every time is given as a ratio to reading the frame once (a compiled sum of all bytes) in the same process, because on
a busy machine the ratio means something and the milliseconds do not.
"""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.airport.model import SurfaceKind
from pipeline.chain import RadarChain
from pipeline.detect import Detector
from pipeline.detect.adaptive import Adaptive
from pipeline.extract import Extractor
from pipeline.extract.manhattan import Manhattan
from pipeline.parts import build
from pipeline.sites import RadarSite
from pipeline.tables import Detections, Sweeps, VideoFormat

VIDEO = VideoFormat()
SITE = RadarSite("bench", 0.0, 0.0, 22.0, VIDEO)
FRAMES = 3
BLOCKS = 32


@dataclass(frozen=True)
class BenchRow:
    """One line of the bench. median_s, least_s: seconds a turn. ratio: median to the median of reading the frame once,
    timed turn about.

    peer: somebody else's library on the same input. note: what it does, or how its result compares.
    """

    name: str
    median_s: float
    least_s: float
    ratio: float
    peer: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class Workload:
    """Turns of video and what the detector found in the last of them."""

    frames: NDArray[np.uint8]
    found: Detections
    runs: int


def bench_frontend(
    clock: Callable[[], float],
    repeats: int = 60,
    peers: bool = True,
    detector: Detector | None = None,
    extractor: Extractor | None = None,
) -> Iterator[BenchRow]:
    """Measure and give one row after the other, so that a caller can show progress.

    clock: seconds of a steady clock. repeats: turns a row (a tenth of it, at least 3, for the slow ones). peers: also
    numpy, scipy and, where it is installed, OpenCV. detector, extractor: parts to measure instead of the defaults.
    """
    detector = detector or build("detect", "hybrid", {})
    extractor = extractor or Manhattan()
    work = workload(detector, targets=160)
    storm = Workload(work.frames, *_speckle(40_000))
    watch = Stopwatch(clock, repeats, work.frames)
    yield watch.row("read the frame once", lambda turn: work.frames[turn % FRAMES], read_once, note="the floor")
    yield _detect(watch, detector, work)
    yield _detect(watch, Adaptive(), work, surface=_surface(), settle=80)
    yield _extract(watch, extractor, work)
    yield _extract(watch, extractor, storm)
    for blocks in (1, BLOCKS):
        yield _scan(watch, RadarChain(SITE, 0, detector, extractor), work, blocks)
    for blocks in (1, BLOCKS):
        yield _scan(watch, RadarChain(SITE, 0, Adaptive(), extractor, surface=_surface()), work, blocks, settle=80)
    if peers:
        yield from _peers(Stopwatch(clock, max(3, repeats // 10), work.frames), work)


@dataclass(frozen=True, eq=False)
class Stopwatch:
    """Times work turn about with reading a frame once, so that both meet the same moments of a busy machine."""

    clock: Callable[[], float]
    repeats: int
    frames: NDArray[np.uint8]

    def row(
        self, name: str, prepare: Callable[[int], Any], work: Callable[[Any], Any], peer: bool = False, note: str = ""
    ) -> BenchRow:
        """Time `work` on what `prepare` makes of the turn's number (not timed), after three turns of warming up."""
        times = np.empty((self.repeats, 2))
        for turn in range(-3, self.repeats):
            given = prepare(turn + 3)
            begin = self.clock()
            work(given)
            middle = self.clock()
            read_once(self.frames[(turn + 2) % FRAMES])  # not the frame that was just worked on
            times[turn] = middle - begin, self.clock() - middle
        median, floor = np.median(times, axis=0)
        return BenchRow(name, float(median), float(times[:, 0].min()), float(median / floor), peer, note)


def _detect(
    watch: Stopwatch,
    detector: Detector,
    work: Workload,
    surface: NDArray[np.uint8] | None = None,
    settle: int = 0,
) -> BenchRow:
    """surface: the map for detectors that use one. settle: turns before the first that counts, for those that learn."""
    state = detector.start(VIDEO, surface)
    turn_of = _fresh_turn if settle else _turn
    for turn in range(settle):
        detector(turn_of(work.frames, turn), state)
    return watch.row(
        f"detect ({_name(detector)})",
        lambda turn: turn_of(work.frames, settle + turn),
        lambda block: detector(block, state),
        note="bit mask, macro-cell means, thresholds" if surface is None else "with a map of surfaces, after learning",
    )


def _surface() -> NDArray[np.uint8]:
    """Runways and taxiways like an airport's: strips of pavement through grass."""
    row = (np.arange(VIDEO.azimuths) + 0.5) * VIDEO.azimuth_step_rad
    distance = np.arange(VIDEO.ranges) * VIDEO.range_step_m
    east, north = np.sin(row)[:, None] * distance, np.cos(row)[:, None] * distance
    paved = (np.abs(north + 0.3 * east) % 600 < 50) | (np.abs(east - 0.3 * north) % 900 < 40)
    return np.where(paved, SurfaceKind.TAXIWAY, SurfaceKind.GRASS).astype(np.uint8)


def _extract(watch: Stopwatch, extractor: Extractor, work: Workload) -> BenchRow:
    state = extractor.start(SITE)
    return watch.row(
        f"extract ({_name(extractor)}), {work.runs:,} runs",
        lambda turn: _turn(work.frames, turn),
        lambda block: extractor(block, work.found, state),
        note="components and attributes",
    )


def _scan(watch: Stopwatch, chain: RadarChain, work: Workload, blocks: int, settle: int = 0) -> BenchRow:
    turn_of = _fresh_turn if settle else _turn
    for turn in range(settle):
        chain.process(turn_of(work.frames, turn))
    return watch.row(
        f"whole scan ({_name(chain.detector)}), {blocks} block{'s' if blocks > 1 else ''}",
        lambda turn: _cut(turn_of(work.frames, settle + turn), blocks),
        lambda pieces: [chain.process(one) for one in pieces],
        note=f"detect, extract at about {work.runs:,} runs, keep the picture, make the tables",
    )


def workload(detector: Detector, targets: int, seed: int = 1) -> Workload:
    """Rayleigh clutter with rectangles of aircraft and vehicle size, and the detections of the last turn."""
    rng = np.random.default_rng(seed)
    frames = np.empty((FRAMES, VIDEO.azimuths, VIDEO.ranges), np.uint8)
    for frame in frames:
        power = 10 * np.log10(rng.standard_exponential(frame.shape, dtype=np.float32)) / VIDEO.db_per_step
        np.clip(np.rint(80 + power), 0, 255, out=power)
        frame[:] = power
        for _ in range(targets):
            _paint(frame, rng)
    state = detector.start(VIDEO)
    found = [detector(_turn(frames, turn), state) for turn in range(FRAMES)][-1]
    return Workload(frames, found, _count(found))


def _paint(frame: NDArray[np.uint8], rng: np.random.Generator) -> None:
    length, width = (38.0, 30.0) if rng.random() < 0.5 else (5.0, 2.0)
    distance, azimuth = rng.uniform(150, 2900), rng.uniform(0, 2 * np.pi)
    rows = max(1, round((length / distance + VIDEO.beamwidth_rad) / VIDEO.azimuth_step_rad))
    cells = max(1, round(width / VIDEO.range_step_m))
    first, start = int(azimuth / VIDEO.azimuth_step_rad), int(distance / VIDEO.range_step_m)
    at = (np.arange(first, first + rows) % VIDEO.azimuths)[:, None], np.arange(start, start + cells)[None]
    frame[at] = np.clip(rng.normal(175, 18, (rows, cells)), 0, 255)


def _speckle(runs: int) -> tuple[Detections, int]:
    rng = np.random.default_rng(2)
    cells = rng.random((VIDEO.azimuths, VIDEO.ranges)) < runs / (VIDEO.azimuths * VIDEO.ranges)
    found = Detections(np.packbits(cells, axis=1, bitorder="little").view(np.uint64))
    return found, _count(found)


def _count(found: Detections) -> int:
    cells = np.pad(found.cells(VIDEO.ranges), ((0, 0), (1, 0)))
    return int((cells[:, 1:] & ~cells[:, :-1]).sum())


def _turn(frames: NDArray[np.uint8], turn: int) -> Sweeps:
    row = np.arange(VIDEO.azimuths, dtype=np.int32)
    azimuth = ((row + 0.5) * VIDEO.azimuth_step_rad).astype(np.float64)
    return Sweeps(0, turn, row, azimuth, azimuth / (2 * np.pi) + turn, frames[turn % FRAMES], last=True)


def _fresh_turn(frames: NDArray[np.uint8], turn: int) -> Sweeps:
    """The same, turned by another angle every time: what learns each cell would learn a speckle that comes again."""
    made = _turn(frames, turn)
    return replace(made, amplitude=np.roll(made.amplitude, 997 * turn % VIDEO.azimuths, axis=0))


def _cut(turn: Sweeps, blocks: int) -> list[Sweeps]:
    edges = np.linspace(0, len(turn), blocks + 1).astype(int)
    return [
        replace(turn, row=turn.row[a:b], azimuth=turn.azimuth[a:b], time=turn.time[a:b], amplitude=turn.amplitude[a:b])
        for a, b in itertools.pairwise(edges)
    ]


def _peers(watch: Stopwatch, work: Workload) -> Iterator[BenchRow]:
    frame = work.frames[0]
    level = np.full((128, 32), 72.0)
    cells = work.found.cells(VIDEO.ranges)

    def numpy_hybrid(_: Any) -> Any:
        level[...] += (frame.reshape(128, 32, 32, 32).mean(axis=(1, 3)) - level) / 64
        limit = np.minimum(level + 44.0, 255).astype(np.uint8)
        return frame > np.repeat(np.repeat(limit, 32, axis=0), 32, axis=1)

    def scipy_plots(_: Any) -> Any:
        label, many = ndimage.label(cells, np.ones((3, 3)))
        every = np.arange(1, many + 1)
        ndimage.find_objects(label)
        ndimage.maximum(frame, label, every)
        return ndimage.center_of_mass(cells, label, every), ndimage.mean(frame, label, every)

    yield watch.row("detect, numpy", int, numpy_hybrid, True, "the same sums, square macro-cells")
    yield watch.row("extract, scipy.ndimage", int, scipy_plots, True, "8 neighbours, no wrap")
    try:
        cv2 = importlib.import_module("cv2")
    except ImportError:
        return

    def opencv_hybrid(_: Any) -> Any:
        cv2.accumulateWeighted(cv2.resize(frame, (32, 128), interpolation=cv2.INTER_AREA), level, 1 / 64)
        limit = cv2.resize(cv2.convertScaleAbs(level, alpha=1, beta=44), (1024, 4096), interpolation=cv2.INTER_NEAREST)
        return cv2.compare(frame, limit, cv2.CMP_GT)

    image = cells.astype(np.uint8)
    yield watch.row("detect, OpenCV", int, opencv_hybrid, True, "the same sums, square macro-cells")
    yield watch.row(
        "extract, OpenCV",
        int,
        lambda _: cv2.connectedComponentsWithStats(image, connectivity=8),
        True,
        "8 neighbours, no wrap, no amplitude",
    )


def _name(part: Any) -> str:
    return type(part).__module__.rsplit(".", 1)[-1]


@njit(nogil=True, cache=True)
def read_once(frame: Any) -> int:
    """The sum of all bytes: the least that any work on a frame can take."""
    total = 0
    for value in frame.ravel():
        total += value
    return total
