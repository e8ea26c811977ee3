"""The bench of the front end: every detector, every extractor, both together, and floods, over 4096 x 1024 x 8 bit.

Every time is given as a ratio to reading the frame once (a compiled sum of all bytes) in the same process, because on
a busy machine the ratio means something and the milliseconds do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.chain import RadarChain
from pipeline.contracts.detect import Detector
from pipeline.contracts.extract import Extractor
from pipeline.lab.measure.frontend_peers import peers as peer_rows
from pipeline.lab.measure.frontend_workload import (
    FRAMES,
    VIDEO,
    Workload,
    count_runs,
    cut,
    flooded,
    fresh_turn,
    speckle,
    surface,
    turn_of,
    workload,
)
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch, read_once
from pipeline.parts import available, build
from pipeline.sites import RadarSite

SITE = RadarSite("bench", 0.0, 0.0, 22.0, VIDEO)
BLOCKS = 32
MANY = 40_000
FLOODS = (112_000, 238_000)
WANTED = {"hybrid": 1.5, "adaptive": 4.0}
"""Most times reading the frame once that a detector may take, where a bound was set."""

WANTED_TOGETHER = {3_000: 3.0, MANY: 15.0}
"""The same for detection and extraction, by about how many runs."""


def bench_frontend(
    clock: Callable[[], float], repeats: int = 60, peers: bool = True, settle: int = 80
) -> Iterator[BenchRow]:
    """Measure and give one row after the other, so that a caller can show progress.

    clock: seconds of a steady clock. repeats: turns a row (a tenth of it, at least 3, for the slow ones). peers: also
    numpy, scipy and, where they are installed, OpenCV and scikit-image. settle: turns before the first that counts, for
    detectors that learn.
    """
    hybrid = build("detect", "hybrid", {})
    extractors = {name: build("extract", name, {}) for name in sorted(available("extract"))}
    works = {name: _calm(hybrid, one) for name, one in extractors.items()}
    calm = works["manhattan"]
    watch = Stopwatch(clock, repeats, calm.frames)
    yield watch.row("read the frame once", lambda turn: calm.frames[turn % FRAMES], read_once, note="the floor")
    for name in sorted(available("detect"), key=lambda one: (one not in WANTED, one)):
        yield _detect(watch, name, calm, settle)
    floods = [Workload(calm.frames, *speckle(runs)) for runs in (MANY, *FLOODS)]
    for name, extractor in extractors.items():
        for work in (works[name], *floods):
            yield _extract(watch, extractor, work)
    eager = _eager(calm.frames)
    for name, extractor in extractors.items():
        yield _together(watch, hybrid, extractor, works[name], 3_000)
        yield _together(watch, eager, extractor, works[name], MANY)
    for detector in (hybrid, build("detect", "adaptive", {})):
        for blocks in (1, BLOCKS):
            yield _scan(watch, detector, extractors["manhattan"], calm, blocks, settle)
    for runs in FLOODS:
        storm = flooded(calm.frames, runs)
        for blocks in (1, BLOCKS):
            yield _storm(watch, hybrid, extractors["manhattan"], calm.frames, storm, (runs, blocks))
    if peers:
        yield from peer_rows(Stopwatch(clock, max(3, repeats // 10), calm.frames), calm)


def _calm(detector: Detector, extractor: Extractor) -> Workload:
    return workload(detector, growth_db=getattr(extractor, "growth_db", None))


def _detect(watch: Stopwatch, name: str, work: Workload, settle: int) -> BenchRow:
    detector = build("detect", name, {})
    learns = hasattr(detector, "learn_scans")
    state = detector.start(VIDEO, surface())
    before = settle if learns else 0
    for turn in range(before):
        detector(fresh_turn(work.frames, turn), state)
    return watch.row(
        f"detect ({name})",
        lambda turn: fresh_turn(work.frames, before + turn),
        lambda block: detector(block, state),
        note="after learning" if learns else "without memory",
        most_ratio=WANTED.get(name),
    )


def _extract(watch: Stopwatch, extractor: Extractor, work: Workload) -> BenchRow:
    state = extractor.start(SITE)
    return watch.row(
        f"extract ({_name(extractor)}), {work.runs:,} runs",
        lambda turn: turn_of(work.frames, turn),
        lambda block: extractor(block, work.found, state),
        note="components and attributes",
        most_s=VIDEO.period_s,
    )


def _eager(frames: NDArray[np.uint8]) -> Detector:
    """A hybrid detector so set that clutter alone makes MANY runs, and no cap in its way."""
    settings: dict[str, Any] = {"pfa": 0.0102, "max_runs": 10 * MANY}
    part: Detector = build("detect", "hybrid", settings)
    state = part.start(VIDEO)
    found = [count_runs(part(turn_of(frames, turn), state)) for turn in range(3)][-1]
    part = build("detect", "hybrid", settings | {"pfa": settings["pfa"] * MANY / found})
    return part


def _together(watch: Stopwatch, detector: Detector, extractor: Extractor, work: Workload, about: int) -> BenchRow:
    detecting = detector.start(VIDEO, growth_db=getattr(extractor, "growth_db", None))
    extracting = extractor.start(SITE)
    runs = [count_runs(detector(turn_of(work.frames, turn), detecting)) for turn in range(FRAMES)][-1]
    return watch.row(
        f"detect and extract ({_name(detector)}, {_name(extractor)}), {runs:,} runs",
        lambda turn: turn_of(work.frames, FRAMES + turn),
        lambda block: extractor(block, detector(block, detecting), extracting),
        note="one block a turn",
        most_ratio=WANTED_TOGETHER[about],
    )


def _scan(
    watch: Stopwatch, detector: Detector, extractor: Extractor, work: Workload, blocks: int, settle: int
) -> BenchRow:
    chain = RadarChain(SITE, 0, detector, extractor, surface=surface())
    for turn in range(settle):
        chain.process(fresh_turn(work.frames, turn))
    return watch.row(
        f"whole scan ({_name(detector)}, {_name(extractor)}), {blocks} block{'s' if blocks > 1 else ''}",
        lambda turn: cut(fresh_turn(work.frames, settle + turn), blocks),
        lambda pieces: [chain.process(one) for one in pieces],
        note=f"detect, extract at about {work.runs:,} runs, keep the picture, make the tables",
        most_s=VIDEO.period_s,
    )


def _storm(
    watch: Stopwatch,
    detector: Detector,
    extractor: Extractor,
    calm: NDArray[np.uint8],
    storm: NDArray[np.uint8],
    size: tuple[int, int],
) -> BenchRow:
    runs, blocks = size
    chain = RadarChain(SITE, 0, detector, extractor)
    for turn in range(FRAMES):
        chain.process(turn_of(calm, turn))
    return watch.row(
        f"storm, {runs:,} runs, {blocks} block{'s' if blocks > 1 else ''}",
        lambda turn: cut(turn_of(storm, FRAMES + turn), blocks),
        lambda pieces: [chain.process(one) for one in pieces],
        note=f"whole scan ({_name(detector)}, {_name(extractor)}); the cap on runs bites, counted",
        most_s=VIDEO.period_s,
    )


def _name(part: Any) -> str:
    return type(part).__module__.rsplit(".", 1)[-1]
