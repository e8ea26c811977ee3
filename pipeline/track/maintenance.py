"""What time alone does to tracks, and the search for several tracks of one target."""

from __future__ import annotations

import numpy as np

from pipeline.contracts.associate import Expected
from pipeline.kernels.compiled import allocating
from pipeline.tables import TargetCategory, TargetClass, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, clear_identity, end_tracks, update_lifecycle
from pipeline.track.fragments import absorb, join_fragments
from pipeline.track.radar_update import owners
from pipeline.track.table import NEVER

LIFECYCLE_INTERVAL_S = 0.12
"""Between two decisions of the lifecycle part on all tracks, so that not each of 32 sectors a turn makes one. Tied to a
one-second antenna: a turn has eight."""

MAINTENANCE_INTERVAL_S = 1.0
"""Between two searches for duplicates and fragments. Tied to a one-second antenna: a check per turn."""

DUPLICATE_DISTANCE_M = 60.0
"""In east and in north, beyond which two tracks are not compared: the size of a large aircraft."""

DUPLICATE_GATE = 6.0
"""Squared Mahalanobis distance of the positions, up to which two tracks may be one target: 95 % in two dimensions."""

DUPLICATE_EXTENT_SD = 0.3
"""Standard deviation of the distance of two positions on one target, as a fraction of its longer side: two sensors may
follow its two ends."""

VELOCITY_GATE = 5.0
"""Squared difference of the velocities over the sum of their variances, up to which two tracks may be one target; about
the 90 % bound of two dimensions (4.6)."""

VELOCITY_VARIANCE = 1.0
"""m^2/s^2 beyond what the filter states, for its constant velocity is not the truth."""

VEHICLE, AIRCRAFT = 1, 2
"""Marks of a track reported as a vehicle, and of another one classified as an aircraft; 0 for all others."""


def maintain_tracks(core: Core) -> None:
    """End and coast tracks, clear addresses no longer reported, merge tracks of one target, at the tracker's time."""
    if abs(core.time - core.lifecycle_time) < LIFECYCLE_INTERVAL_S:
        return
    core.lifecycle_time = core.time
    update_lifecycle(core)
    if abs(core.time - core.maintenance_time) < MAINTENANCE_INTERVAL_S:
        return
    core.maintenance_time = core.time
    unheard = core.column("report_time") < core.time - core.settings.identity.forget_after
    stale = np.flatnonzero((core.column("address") != "") & unheard)
    core.count("identity_stale", len(stale))
    clear_identity(core, stale)
    _merge_duplicates(core)
    join_fragments(core)
    _end_fragments(core)


def _merge_duplicates(core: Core) -> None:
    """Where two tracks stay together and one of them gets no plots, the older goes on with what both know."""
    table, n = core.table, core.table.n
    alive = np.flatnonzero(table.phase[:n] != TrackPhase.TENTATIVE)
    if len(alive) < 2:
        return
    dt = core.time - table.time[alive]
    state, covariance = core.filter.predict(table.state[alive], table.covariance[alive], dt)
    order = np.argsort(state[:, 0], kind="stable")
    name = np.unique(table.address[alive], return_inverse=True)[1]
    name[table.address[alive] == ""] = -1
    starved = table.radar_time[alive] < core.time - core.settings.grouping.starved_after
    original = np.full(len(alive), -1, np.int64)
    # Never merge a reported vehicle with a track classified as an aircraft.
    kind = np.zeros(len(alive), np.int8)
    kind[table.claimed[alive] == TargetCategory.VEHICLE] = VEHICLE
    kind[(kind == 0) & (table.category[alive] == TargetClass.AIRCRAFT)] = AIRCRAFT
    _duplicates(order, state, covariance, core.extents(alive), name, kind, starved, table.born[alive], original)
    table.duplicate_checks[alive] = np.where(original >= 0, table.duplicate_checks[alive] + 1, 0)
    gone = np.zeros(n, np.bool_)
    for junior in np.flatnonzero(table.duplicate_checks[alive] >= core.settings.grouping.merge_after):
        senior = alive[original[junior]]
        if not gone[senior]:
            absorb(core, int(senior), int(alive[junior]))
            gone[alive[junior]] = True
    core.count("merged", int(gone.sum()))
    end_tracks(core, gone)


def _end_fragments(core: Core) -> None:
    """End tentative tracks by radar alone inside the extent of an established track: they are fragments of its echo."""
    table, n = core.table, core.table.n
    young = np.flatnonzero((table.phase[:n] == TrackPhase.TENTATIVE) & (table.extent_count[:n] > 0))
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
    end_tracks(core, gone)


@allocating
def _duplicates(
    order: Array, state: Floats, cov: Floats, extent: Floats, name: Array, kind: Array, starved: Array, born: Floats,
    original: Array,
) -> None:  # fmt: skip
    """For each track the older one that it duplicates, or -1. order: rows by east."""
    for a in range(len(order)):
        i = order[a]
        for b in range(a + 1, len(order)):
            j = order[b]
            e, n = state[j, 0] - state[i, 0], state[j, 1] - state[i, 1]
            if e > DUPLICATE_DISTANCE_M:
                break
            if abs(n) > DUPLICATE_DISTANCE_M or not (starved[i] or starved[j]):
                continue
            if name[i] >= 0 and name[j] >= 0 and name[i] != name[j]:
                continue
            if kind[i] != kind[j] and kind[i] + kind[j] == VEHICLE + AIRCRAFT:
                continue
            wide = (DUPLICATE_EXTENT_SD * max(extent[i, 0], extent[j, 0])) ** 2
            s00 = cov[i, 0, 0] + cov[j, 0, 0] + wide
            s11 = cov[i, 1, 1] + cov[j, 1, 1] + wide
            s01 = cov[i, 0, 1] + cov[j, 0, 1]
            squared = (e * e * s11 - 2 * e * n * s01 + n * n * s00) / (s00 * s11 - s01 * s01)
            difference = (state[i, 2] - state[j, 2]) ** 2 + (state[i, 3] - state[j, 3]) ** 2
            variance = cov[i, 2, 2] + cov[i, 3, 3] + cov[j, 2, 2] + cov[j, 3, 3]
            if squared > DUPLICATE_GATE or difference > VELOCITY_GATE * (variance + VELOCITY_VARIANCE):
                continue
            older, younger = (i, j) if (born[i], i) <= (born[j], j) else (j, i)
            if original[younger] < 0:
                original[younger] = older
