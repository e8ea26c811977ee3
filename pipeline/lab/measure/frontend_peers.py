"""What other libraries take for the front end's work, on the same input."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import ndimage

from pipeline.lab.measure.frontend_workload import VIDEO, Workload
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch


def peers(watch: Stopwatch, work: Workload) -> Iterator[BenchRow]:
    """Rows of numpy and scipy, and of OpenCV and scikit-image where they are installed."""
    yield from _numpy_and_scipy(watch, work)
    for name, rows in (("cv2", _opencv), ("skimage.measure", _skimage)):
        try:
            library = importlib.import_module(name)
        except ImportError:
            continue
        yield from rows(library, watch, work)


def _numpy_and_scipy(watch: Stopwatch, work: Workload) -> Iterator[BenchRow]:
    frame, cells = work.frames[0], work.found.cells(VIDEO.ranges)
    level = np.full((128, 32), 72.0)

    def hybrid(_: Any) -> Any:
        level[...] += (frame.reshape(128, 32, 32, 32).mean(axis=(1, 3)) - level) / 64
        limit = np.minimum(level + 44.0, 255).astype(np.uint8)
        return frame > np.repeat(np.repeat(limit, 32, axis=0), 32, axis=1)

    def cell_averaging(_: Any) -> Any:
        power = frame.astype(np.float32)
        outer, inner = (ndimage.uniform_filter(power, (1, width), mode="nearest") for width in (37, 5))
        return power > (37 * outer - 5 * inner) / 32 + 44.0

    def plots(_: Any) -> Any:
        label, many = ndimage.label(cells, np.ones((3, 3)))
        every = np.arange(1, many + 1)
        ndimage.find_objects(label)
        ndimage.maximum(frame, label, every)
        return ndimage.center_of_mass(cells, label, every), ndimage.mean(frame, label, every)

    yield watch.row("detect, numpy", int, hybrid, peer=True, note="the sums of hybrid, square macro-cells")
    yield watch.row("detect, scipy.ndimage", int, cell_averaging, peer=True, note="the sums of ca: uniform_filter")
    yield watch.row("extract, scipy.ndimage", int, plots, peer=True, note="8 neighbours, no wrap")


def _opencv(cv2: Any, watch: Stopwatch, work: Workload) -> Iterator[BenchRow]:
    frame = work.frames[0]
    level = np.full((128, 32), 72.0)
    image = work.found.cells(VIDEO.ranges).astype(np.uint8)

    def hybrid(_: Any) -> Any:
        cv2.accumulateWeighted(cv2.resize(frame, (32, 128), interpolation=cv2.INTER_AREA), level, 1 / 64)
        limit = cv2.resize(cv2.convertScaleAbs(level, alpha=1, beta=44), (1024, 4096), interpolation=cv2.INTER_NEAREST)
        return cv2.compare(frame, limit, cv2.CMP_GT)

    def cell_averaging(_: Any) -> Any:
        outer, inner = (cv2.boxFilter(frame, cv2.CV_32F, (width, 1), normalize=False) for width in (37, 5))
        return frame > (outer - inner) / 32 + 44.0

    yield watch.row("detect, OpenCV", int, hybrid, peer=True, note="the sums of hybrid, square macro-cells")
    yield watch.row("detect, OpenCV boxFilter", int, cell_averaging, peer=True, note="the sums of ca")
    yield watch.row(
        "extract, OpenCV",
        int,
        lambda _: cv2.connectedComponentsWithStats(image, connectivity=8),
        peer=True,
        note="8 neighbours, no wrap, no amplitude",
    )


def _skimage(measure: Any, watch: Stopwatch, work: Workload) -> Iterator[BenchRow]:
    frame, cells = work.frames[0], work.found.cells(VIDEO.ranges)
    names = ("label", "area", "bbox", "centroid", "intensity_mean", "intensity_max", "orientation")

    def plots(_: Any) -> Any:
        label = measure.label(cells, connectivity=2)
        return measure.regionprops_table(label, frame, properties=names)

    yield watch.row("extract, scikit-image", int, plots, peer=True, note="8 neighbours, no wrap, with the axis")
