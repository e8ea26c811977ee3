"""Patches of ground for detectors that follow each kind of surface by itself: macro-cells cut by the airport map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import cKDTree

from pipeline.tables import VideoFormat

TILE_CELLS = 8
"""Range cells of a tile."""

TILE_ROWS = 16
"""Rows of a tile."""

MIXED = 8
"""Added to the greatest surface kind of a tile that has more than one, or lies beside another."""

TELLING = 250
"""A patch of one kind with fewer cells does not tell how hard it rains."""

NEIGHBOURS = 8
"""Macro-cells about one that may tell of its rain."""

MOST = 60_000
"""A patch with more cells is cut."""

LIKE = 2
"""Patches near by that tell how strongly a pavement answers."""

GRASS, BUILDING = 0, 4
PAVEMENT = (1, 2, 3, 5, 6)
"""Surface kinds of their own rules; see `pipeline.airport.model.SurfaceKind`."""


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Tiles of TILE_ROWS x TILE_CELLS cells, each in one patch.

    tile: (stripes, tiles of a row, in whole words) int32 patch of each tile; what lies past the last cell belongs to
    the patch beside it. kind: (patches) surface kind, MIXED added where it is not the only one. cells: (patches) how
    many. macro: (patches) macro-cell, counted from 0. telling: (patches) whether it tells of rain. near, distance:
    (macro-cells, n) macro-cells that have telling patches, the nearest first, and m to their middle. paved: (rows,
    words) a bit a cell, set where it and its neighbours are paved. like: (patches, n) other
    patches of the kind that most of such cells of it have, the nearest first; -1 where it has none.
    """

    tile: NDArray[np.int32]
    kind: NDArray[np.int64]
    cells: NDArray[np.int64]
    macro: NDArray[np.int64]
    telling: NDArray[np.bool_]
    near: NDArray[np.int64]
    distance: NDArray[np.float64]
    paved: NDArray[np.uint64]
    like: NDArray[np.int64]

    @classmethod
    def build(cls, video: VideoFormat, surface: NDArray[np.uint8], size_m: float) -> Patches:
        """Patches of macro-cells of about size_m by size_m over a map (azimuths, ranges) of surface kinds."""
        cells = _per_tile(np.ones(surface.shape, np.int64), np.add, 0)
        kind = _kinds(surface)
        macro, east, north = _macro_cells(video, size_m, kind.shape)
        key = macro * (2 * MIXED) + kind
        if np.bincount(np.unique(key, return_inverse=True)[1].ravel(), cells.ravel()).max() > MOST:
            share = np.cumsum(cells.ravel()).reshape(cells.shape) // (MOST // 2)
            key = key * (share.max() + 1) + share
        _, first, patch = np.unique(key, return_index=True, return_inverse=True)
        patch = patch.reshape(key.shape)
        many = np.bincount(patch.ravel(), cells.ravel()).astype(np.int64)
        _, seat, own_macro = np.unique(macro.ravel()[first], return_index=True, return_inverse=True)
        kinds = kind.ravel()[first]
        telling = (kinds < MIXED) & (kinds != BUILDING) & (many >= TELLING)
        place = np.stack([east.ravel()[first[seat]], north.ravel()[first[seat]]], axis=1)
        words = np.pad(patch, ((0, 0), (0, 8 * video.words - patch.shape[1])), mode="edge")
        good = np.unique(own_macro[telling]) if telling.any() else np.arange(len(place))
        distance, near = cKDTree(place[good]).query(place, np.arange(1, 1 + min(NEIGHBOURS, len(good))))
        bits, like = _paved(video, surface), _like(surface, patch, kinds, first, east, north)
        return cls(
            words.astype(np.int32), kinds, many, own_macro, telling, good[near], np.asarray(distance), bits, like
        )


def _like(
    surface: NDArray[np.uint8],
    patch: NDArray[np.int64],
    kinds: NDArray[np.int64],
    first: NDArray[np.int64],
    east: NDArray[np.float64],
    north: NDArray[np.float64],
) -> NDArray[np.int64]:
    """(patches, LIKE) see `Patches`."""
    made = np.full((len(kinds), LIKE), -1, np.int64)
    inner = _inner(surface)
    place = np.stack([east.ravel()[first], north.ravel()[first]], axis=1)
    share = []
    for kind in PAVEMENT:
        cells = _per_tile((inner & (surface == kind)).astype(np.int64), np.add, 0)
        share.append(np.bincount(patch.ravel(), cells.ravel(), len(kinds)))
    most = np.argmax(share, axis=0)
    for number, kind in enumerate(PAVEMENT):
        wanting = ((kinds >= MIXED) & (most == number) & (np.max(share, axis=0) > 0)) | (kinds == kind)
        pure = np.flatnonzero(kinds == kind)
        if not len(pure):
            pure = np.flatnonzero(np.isin(kinds, PAVEMENT))
        if wanting.any() and len(pure):
            found = np.asarray(
                cKDTree(place[pure]).query(place[wanting], np.arange(1, 2 + min(LIKE, len(pure) - 1)))[1]
            )
            found = pure[found]
            itself = found[:, :1] == np.flatnonzero(wanting)[:, None]
            others = np.where(itself, np.roll(found, -1, axis=1), found)
            made[wanting] = others[:, np.arange(LIKE) % max(others.shape[1] - 1, 1)]
    return made


def _per_tile(values: NDArray[np.int64], what: np.ufunc, empty: int) -> NDArray[np.int64]:
    """(stripes, tiles) of a value of each cell."""
    rows, cells = values.shape
    padded = np.pad(values, ((0, -rows % TILE_ROWS), (0, -cells % TILE_CELLS)), constant_values=empty)
    split = padded.reshape(padded.shape[0] // TILE_ROWS, TILE_ROWS, padded.shape[1] // TILE_CELLS, TILE_CELLS)
    return np.asarray(what.reduce(what.reduce(split, axis=3), axis=1))


def _paved(video: VideoFormat, surface: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """(rows, words) a bit a cell; a map may be wrong by a cell."""
    padded = np.pad(_inner(surface), ((0, 0), (0, 64 * video.words - surface.shape[1])))
    return np.ascontiguousarray(np.packbits(padded, axis=1, bitorder="little")).view(np.uint64)


def _inner(surface: NDArray[np.uint8]) -> NDArray[np.bool_]:
    soft = (surface == GRASS) | (surface == BUILDING)
    # nobody knows what lies past the last cell
    return ~np.asarray(maximum_filter(soft, size=3, mode=("wrap", "constant"), cval=1))


def _kinds(surface: NDArray[np.uint8]) -> NDArray[np.int64]:
    """(stripes, tiles) kind of each tile; a map may be wrong by a cell, so the neighbours of its cells count too."""
    least = minimum_filter(surface, size=3, mode=("wrap", "nearest")).astype(np.int64)
    most = maximum_filter(surface, size=3, mode=("wrap", "nearest")).astype(np.int64)
    low, high = _per_tile(least, np.minimum, 255), _per_tile(most, np.maximum, 0)
    walls = maximum_filter(surface == BUILDING, size=3, mode=("wrap", "nearest"))
    built = _per_tile(walls.astype(np.int64), np.maximum, 0) > 0
    return np.where(low == high, low, MIXED + np.where(built, BUILDING, GRASS))


def _macro_cells(
    video: VideoFormat, size_m: float, tiles: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """(stripes, tiles) number of the nearly square macro-cell of each tile, by its middle, and where that is: east and
    north."""
    middle = (np.arange(tiles[1]) + 0.5) * TILE_CELLS - 0.5
    distance = video.first_range_m + np.minimum(middle, video.ranges - 1) * video.range_step_m
    ring = (distance / size_m).astype(np.int64)
    bands = np.maximum(np.rint(2 * np.pi * (ring + 0.5)), 1).astype(np.int64)
    turn = np.minimum((np.arange(tiles[0])[:, None] + 0.5) * TILE_ROWS / video.azimuths, 1 - 1e-9)
    angle = 2 * np.pi * turn
    return ring * 100_000 + (turn * bands).astype(np.int64), np.sin(angle) * distance, np.cos(angle) * distance
