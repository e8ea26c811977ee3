"""Patches of ground for detectors that follow each kind of surface by itself: macro-cells cut by the airport map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from pipeline.tables import VideoFormat

EDGE = 8
"""Added to the surface kind of a cell beside a border."""

FEWEST = 150
"""A patch with fewer cells is put together with the same kind in a larger macro-cell."""

GRASS, BUILDING = 0, 4
"""Surface kinds of their own rules; see `pipeline.airport.model.SurfaceKind`."""


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """kind: (patches) surface kind, EDGE added beside a border. macro: (patches) macro-cell, counted from 0.

    run_at: (rows + 1) first run of each row. runs: (n, 3) int32 first cell, end and patch of each run of one patch.
    """

    kind: NDArray[np.int64]
    macro: NDArray[np.int64]
    run_at: NDArray[np.int64]
    runs: NDArray[np.int32]

    @classmethod
    def build(cls, video: VideoFormat, surface: NDArray[np.uint8], size_m: float) -> Patches:
        """Patches of macro-cells of about size_m by size_m over a map (azimuths, ranges) of surface kinds."""
        patch, kind, macro = _patches(video, surface, size_m)
        run_at, runs = _runs(patch)
        return cls(kind, macro, run_at, runs)


def _patches(
    video: VideoFormat, surface: NDArray[np.uint8], size_m: float
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """(azimuths, ranges) patch of each cell; kind (EDGE added) and macro-cell of each patch."""
    least = minimum_filter(surface, size=5, mode=("wrap", "nearest"))
    border = least != maximum_filter(surface, size=5, mode=("wrap", "nearest"))
    kind = surface.astype(np.int64) + EDGE * (border & (surface != BUILDING))
    macro = _macro_cells(video, size_m)
    patch = np.full(surface.shape, -1, np.int64)
    sizes = (size_m, 3 * size_m, 10 * size_m, np.inf)
    for size in sizes:
        left = patch < 0
        if not left.any():
            break
        key = _macro_cells(video, size)[left] * (2 * EDGE) + kind[left]
        _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
        good = (counts >= FEWEST)[inverse] if np.isfinite(size) else np.ones(len(inverse), bool)
        patch[left] = np.where(good, inverse + patch.max() + 1, -1)
    _, first, named = np.unique(patch, return_index=True, return_inverse=True)
    _, neighbourhood = np.unique(macro.ravel()[first], return_inverse=True)
    return named.reshape(surface.shape).astype(np.int32), kind.ravel()[first], neighbourhood


def _macro_cells(video: VideoFormat, size_m: float) -> NDArray[np.int64]:
    """(azimuths, ranges) number of the nearly square macro-cell of each cell."""
    if not np.isfinite(size_m):
        return np.zeros((video.azimuths, video.ranges), np.int64)
    distance = video.first_range_m + np.arange(video.ranges) * video.range_step_m
    ring = (distance / size_m).astype(np.int64)
    bands = np.maximum(np.rint(2 * np.pi * (ring + 0.5)), 1).astype(np.int64)
    turn = np.arange(video.azimuths)[:, None] / video.azimuths
    return np.asarray(ring * 100_000 + (turn * bands).astype(np.int64))


def _runs(patch: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Runs of one patch along each row: first run of each row (rows + 1); first cell, end and patch of each run."""
    starts = np.ones(patch.shape, bool)
    starts[:, 1:] = patch[:, 1:] != patch[:, :-1]
    row, cell = np.nonzero(starts)
    run_at = np.zeros(len(patch) + 1, np.int64)
    np.cumsum(np.bincount(row, minlength=len(patch)), out=run_at[1:])
    end = np.append(cell[1:], 0)
    end[end == 0] = patch.shape[1]
    return run_at, np.stack([cell, end, patch[row, cell]], axis=1).astype(np.int32)
