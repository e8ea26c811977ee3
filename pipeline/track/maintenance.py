"""What time alone does to tracks, and two tracks of one target becoming one."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.contracts.associate import Expected
from pipeline.tables import TargetCategory, TargetClass, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, end, judge, strip_identity
from pipeline.track.parts import absorb, join_parts
from pipeline.track.radar_update import owners
from pipeline.track.table import NEVER

JUDGE_EVERY = 0.12
"""Seconds between two looks at all tracks; less than any radar needs to come round."""

CHECK_EVERY = 1.0
"""Seconds between two searches for doubles."""


def keep_house(core: Core) -> None:
    """End, coast, forget names nobody says any more and merge doubles, as of the tracker's time."""
    if abs(core.time - core.judged) < JUDGE_EVERY:
        return
    core.judged = core.time
    judge(core)
    if abs(core.time - core.checked) < CHECK_EVERY:
        return
    core.checked = core.time
    unsaid = core.column("report_time") < core.time - core.settings.identity_hold
    stale = np.flatnonzero((core.column("address") != "") & unsaid)
    core.count("identity_stale", len(stale))
    strip_identity(core, stale)
    _merge_doubles(core)
    join_parts(core)
    _end_parts(core)


def _merge_doubles(core: Core) -> None:
    """Where two tracks stay together and one of them gets no plots, the senior goes on with what both know."""
    table, n = core.table, core.table.n
    alive = np.flatnonzero(table.phase[:n] != TrackPhase.TENTATIVE)
    if len(alive) < 2:
        return
    dt = core.time - table.time[alive]
    state, covariance = core.filter.predict(table.state[alive], table.covariance[alive], dt)
    order = np.argsort(state[:, 0], kind="stable")
    name = np.unique(table.address[alive], return_inverse=True)[1]
    name[table.address[alive] == ""] = -1
    starved = table.radar_time[alive] < core.time - 2.2
    double = np.full(len(alive), -1, np.int64)
    size = core.extents(alive)
    # a car that says that it is one is not the large thing beside it
    kind = np.zeros(len(alive), np.int8)
    kind[table.claimed[alive] == TargetCategory.VEHICLE] = 1
    kind[(kind == 0) & (table.category[alive] == TargetClass.AIRCRAFT)] = 2
    _doubles(order, state, covariance, size, name, kind, starved, table.born[alive], double)
    table.twin[alive] = np.where(double >= 0, table.twin[alive] + 1, 0)
    ripe = np.flatnonzero(table.twin[alive] >= core.settings.merge_after)
    gone = np.zeros(n, np.bool_)
    for junior in ripe:
        senior = alive[double[junior]]
        if not gone[senior]:
            absorb(core, int(senior), int(alive[junior]))
            gone[alive[junior]] = True
    core.count("merged", int(gone.sum()))
    end(core, gone)


def _end_parts(core: Core) -> None:
    """Tentative tracks by radar alone inside the extent of an established track are parts of its echo."""
    table, n = core.table, core.table.n
    young = np.flatnonzero((table.phase[:n] == TrackPhase.TENTATIVE) & (table.shapes[:n] > 0))
    young = young[np.maximum(table.node_time[young], table.report_time[young]) == NEVER]
    old = np.flatnonzero(table.phase[:n] == TrackPhase.CONFIRMED)
    if not len(young) or not len(old):
        return
    size = core.extents()
    known = Expected(
        table.time[old], table.state[old], table.covariance[old], np.zeros(len(old)), size[old], np.zeros(len(old))
    )
    owner = owners(
        core, old, known, table.time[young], table.state[young, :2], table.covariance[young, :2, :2], size[young]
    )
    gone = np.zeros(n, np.bool_)
    gone[young[owner >= 0]] = True
    core.count("absorbed_tracks", int(gone.sum()))
    end(core, gone)


@njit(nogil=True, cache=True)
def _doubles(
    order: Array,
    state: Floats,
    cov: Floats,
    extent: Floats,
    name: Array,
    kind: Array,
    starved: Array,
    born: Floats,
    double: Array,
) -> None:
    """For each track the senior it doubles, or -1. order: rows by east."""
    far = 60.0
    for a in range(len(order)):
        i = order[a]
        for b in range(a + 1, len(order)):
            j = order[b]
            e, n = state[j, 0] - state[i, 0], state[j, 1] - state[i, 1]
            if e > far:
                break
            if abs(n) > far or not (starved[i] or starved[j]):
                continue
            if name[i] >= 0 and name[j] >= 0 and name[i] != name[j]:
                continue
            if kind[i] != kind[j] and kind[i] + kind[j] == 3:
                continue
            wide = (0.3 * max(extent[i, 0], extent[j, 0])) ** 2
            s00 = cov[i, 0, 0] + cov[j, 0, 0] + wide
            s11 = cov[i, 1, 1] + cov[j, 1, 1] + wide
            s01 = cov[i, 0, 1] + cov[j, 0, 1]
            squared = (e * e * s11 - 2 * e * n * s01 + n * n * s00) / (s00 * s11 - s01 * s01)
            faster = (state[i, 2] - state[j, 2]) ** 2 + (state[i, 3] - state[j, 3]) ** 2
            loose = cov[i, 2, 2] + cov[i, 3, 3] + cov[j, 2, 2] + cov[j, 3, 3]
            if squared > 6.0 or faster > 5.0 * (loose + 1.0):
                continue
            older, younger = (i, j) if (born[i], i) <= (born[j], j) else (j, i)
            if double[younger] < 0:
                double[younger] = older
