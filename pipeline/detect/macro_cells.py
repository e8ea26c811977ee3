"""Macro-cells of the hybrid detector: squares on the polar grid, and squares cut by the airport map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.tables import VideoFormat

STRIPE_ROWS = 8
"""Macro-cells are made of stripes of this many rows (fewer where a macro-cell itself has fewer)."""

FEWEST = 150
"""A piece of a square with fewer cells is put together with the same kind of surface in a larger square."""


@dataclass(frozen=True)
class MacroCells:
    """The polar grid of macro-cells, each as near to square as the grid lets it be, in rings of whole groups of 8 range
    cells.

    groups: (rings + 1) first group of each ring. first: (rings) index of each ring's macro-cell at north; clockwise
    from there they are counted on. until: (cells) stripe after each macro-cell's last. rows, cells: (cells) azimuth
    rows and radar cells. turn: (4, cells) the macro-cells in the order in which the antenna leaves them: stripe after
    their last, number, ring, and number of the next in the ring.
    """

    stripe_rows: int
    groups: NDArray[np.uint64]
    first: NDArray[np.uint64]
    until: NDArray[np.int64]
    rows: NDArray[np.float64]
    cells: NDArray[np.float64]
    turn: NDArray[np.uint64]

    @classmethod
    def build(cls, video: VideoFormat, size_m: float) -> MacroCells:
        """Macro-cells of about size_m by size_m metres."""
        all_groups = -(-video.ranges // 8)
        depth = max(1, round(size_m / video.range_step_m / 8))
        rings = max(1, round(all_groups / depth))
        groups = np.array([*(np.arange(rings) * depth), all_groups])
        edges = np.minimum(8 * groups, video.ranges)
        middle = video.first_range_m + video.range_step_m * (edges[:-1] + edges[1:] - 1) / 2
        wanted = np.maximum(2 * np.pi * middle / size_m, 1.0)
        stripe_rows = int(np.clip(video.azimuths / wanted.max() / 2, 1, STRIPE_ROWS))
        stripes = -(-video.azimuths // stripe_rows)
        bands = np.clip(np.rint(wanted), 1, stripes).astype(np.int64)
        until = [(np.arange(n) + 1) * stripes // n for n in bands]
        rows = [np.diff(np.minimum(one * stripe_rows, video.azimuths), prepend=0) for one in until]
        first = np.concatenate([[0], np.cumsum(bands)[:-1]])
        after = np.arange(bands.sum()) + 1
        after[first + bands - 1] = first
        turn = np.stack([np.concatenate(until), np.arange(bands.sum()), np.repeat(np.arange(rings), bands), after])
        return cls(
            stripe_rows,
            groups.astype(np.uint64),
            first.astype(np.uint64),
            np.concatenate(until).astype(np.int64),
            np.concatenate(rows).astype(np.float64),
            np.concatenate([one * w for one, w in zip(rows, np.diff(edges), strict=True)]).astype(np.float64),
            turn[:, np.lexsort([turn[2], turn[0]])].astype(np.uint64),
        )

    def labels(self, video: VideoFormat) -> NDArray[np.int64]:
        """(azimuths, ranges) macro-cell of each cell."""
        stripe = np.arange(video.azimuths) // self.stripe_rows
        label = np.empty((video.azimuths, video.ranges), np.int64)
        ends = np.append(self.first[1:], len(self.until)).astype(int)
        for k, (first, end) in enumerate(zip(self.first.astype(int), ends, strict=True)):
            ring = slice(int(self.groups[k]) * 8, int(self.groups[k + 1]) * 8)
            label[:, ring] = (first + np.searchsorted(self.until[first:end], stripe, side="right"))[:, None]
        return label


@dataclass(frozen=True)
class MapCells:
    """Macro-cells cut by the kinds of surface. cells: (many) radar cells of each.

    run_at: (azimuths + 1) first run of each row. runs: (n, 3) first cell, end and macro-cell of each run of one.
    """

    cells: NDArray[np.int64]
    run_at: NDArray[np.int64]
    runs: NDArray[np.int32]

    @classmethod
    def build(cls, video: VideoFormat, surface: NDArray[np.uint8], size_m: float) -> MapCells:
        """The pieces of each square, one a kind of surface; see `map_labels`."""
        label = map_labels(video, surface, size_m)
        starts = np.ones(label.shape, bool)
        starts[:, 1:] = label[:, 1:] != label[:, :-1]
        row, cell = np.nonzero(starts)
        run_at = np.searchsorted(row, np.arange(video.azimuths + 1))
        end = np.append(cell[1:], 0)
        end[end == 0] = video.ranges
        runs = np.stack([cell, end, label[row, cell]], axis=1).astype(np.int32)
        return cls(np.bincount(label.ravel()), run_at.astype(np.int64), runs)


@dataclass
class _Pieces:
    """at: a cell of each piece. cells: how many it has."""

    at: list[int]
    cells: list[int]

    def add(self, at: int, cells: int) -> int:
        self.at.append(at)
        self.cells.append(cells)
        return len(self.at) - 1

    def largest(self, key: NDArray[np.int64]) -> dict[int, int]:
        """The largest piece for every key of a cell."""
        order = np.argsort(self.cells)
        return {int(key[self.at[piece]]): int(piece) for piece in order}


def map_labels(video: VideoFormat, surface: NDArray[np.uint8], size_m: float) -> NDArray[np.int64]:
    """(azimuths, ranges) macro-cell of each cell: square by kind of surface.

    Pieces of fewer than `FEWEST` cells are put together with what is left of their kind in a square three times, then
    ten times as large, then everywhere; where that is still too little, they join the largest piece of their kind
    there. Kinds that have fewer cells in all are one macro-cell together.
    """
    label = np.full(surface.size, -1, np.int64)
    kind = surface.ravel().astype(np.int64)
    left = np.arange(surface.size)
    pieces = _Pieces([], [])
    for size in (size_m, 3 * size_m, 10 * size_m, np.inf):
        square = MacroCells.build(video, size).labels(video).ravel() if size < np.inf else np.zeros(surface.size, int)
        key = square * 256 + kind
        keys, first, which, counts = np.unique(key[left], return_index=True, return_inverse=True, return_counts=True)
        largest = pieces.largest(key)
        number = np.full(len(keys), -1)
        for group in np.flatnonzero(counts >= FEWEST):
            number[group] = pieces.add(left[first[group]], counts[group])
        for group in np.flatnonzero(counts < FEWEST):
            number[group] = largest.get(keys[group], -1)
        label[left] = number[which]
        left = left[label[left] < 0]
        if not len(left):
            break
    label[left] = len(pieces.at)
    return label.reshape(surface.shape)
