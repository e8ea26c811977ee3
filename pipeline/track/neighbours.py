"""Which tracks are near others: only those need to be looked at more closely."""

from __future__ import annotations

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core

MARGIN_M = 20.0
"""By which the search reaches further than the pairs that are wanted: filters do not move all targets along their
velocity, as the search does."""


def close_rows(core: Core, rows: Array, time: float, reach: float, marked: Array | None = None) -> Array:
    """Those of `rows` (k,) that may have another within `reach` m in east and in north at `time` UTC s, in their order.

    marked: (k,) mask, of which one of each pair must be. Nothing nearer than `reach` is left out, but more may be in.
    """
    if len(rows) < 2 or (marked is not None and not marked.any()):
        return rows[:0]
    place = np.empty((len(rows), 2))
    _move(core.store.rows, core.store.time, rows, time, place)
    near = np.zeros(len(rows), np.bool_)
    every = np.ones(len(rows), np.bool_) if marked is None else marked
    _search(np.argsort(place[:, 0], kind="stable"), place, every, reach + MARGIN_M, near)
    return np.asarray(rows[near])


@allocating
def _move(tracks: Array, own_time: Floats, rows: Array, time: float, place: Floats) -> None:
    for k in range(len(rows)):
        x, dt = tracks[rows[k]]["state"], time - own_time[rows[k]]
        place[k, 0], place[k, 1] = x[0] + dt * x[2], x[1] + dt * x[3]


@allocating
def _search(order: Array, place: Floats, marked: Array, reach: float, near: Array) -> None:
    """order: rows by east."""
    for a in range(len(order)):
        i = order[a]
        for b in range(a + 1, len(order)):
            j = order[b]
            if place[j, 0] - place[i, 0] > reach:
                break
            if abs(place[j, 1] - place[i, 1]) <= reach and (marked[i] or marked[j]):
                near[i] = near[j] = True
