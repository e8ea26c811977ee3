"""What time alone does to tracks, and the search for several tracks of one target."""

from __future__ import annotations

import numpy as np

from pipeline.group.enclosing import OUTSIDE, farthest_within, place_within
from pipeline.kernels.cells import sort_into_cells, span
from pipeline.kernels.compiled import allocating
from pipeline.tables import TargetCategory, TargetClass, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import TENTATIVE, Core, clear_identity
from pipeline.track.fragments import absorb, join_fragments
from pipeline.track.judge import end_tracks, judge_tracks
from pipeline.track.latency import with_latency
from pipeline.track.neighbours import close_rows
from pipeline.track.shape import SETTLED, extents, fill_track_extent
from pipeline.track.store import NEVER

JUDGE_INTERVAL_S = 0.4
"""Between two times at which all tracks are judged, whether looked at or not, at least: a sixth of the shortest silence
that changes something. It happens at the next half turn, or sooner when the clock says so: with a radar of a second, at
each half turn, though that may come a little early."""

MAINTENANCE_INTERVAL_S = 1.0
"""Between two searches for duplicates and fragments. What must be found in several checks has then lasted seconds,
whatever the antennas do."""

DUPLICATE_DISTANCE_M = 150.0
"""In east and in north, beyond which two tracks are not compared: the size of a large aircraft, and what it moves by in
a second on the final approach, by which its reports may be late."""

CELL_M = 50.0
"""m, side of the cells in which young tracks are searched: about the length of a large aircraft."""

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

FAST_ALIKE = 8.0
"""m/s, above which two targets do not pass within each other's gate for some seconds with the same velocity."""

SEEN_APART_S = 5.0
"""Two tracks that a radar saw at the same time for so long are two targets, although it sees one of them no more."""

CONFIRMED = int(TrackPhase.CONFIRMED)

VEHICLE, AIRCRAFT = 1, 2
"""Marks of a track reported as a vehicle, and of another one classified as an aircraft; 0 for all others."""


def next_housekeeping(core: Core) -> float:
    """UTC s from which the tracks are to be looked after."""
    return core.judged_time + JUDGE_INTERVAL_S


def keep_house(core: Core, time: float) -> None:
    """End and coast tracks, clear addresses no longer reported, merge tracks of one target, at `time` UTC s."""
    core.judged_time = time
    rows = core.alive()
    judge_tracks(core, rows, np.full(len(rows), time))
    if abs(time - core.maintenance_time) < MAINTENANCE_INTERVAL_S:
        return
    core.maintenance_time = time
    if core.reports_taken:
        unheard = core.column("report_time") < time - core.settings.identity.forget_after
        stale = np.flatnonzero(core.column("named") & unheard)
        core.count("identity_stale", len(stale))
        clear_identity(core, stale)
    _merge_duplicates(core, time)
    join_fragments(core, time)
    _end_fragments(core)
    core.store.clear_ended()


def _merge_duplicates(core: Core, time: float) -> None:
    """Where two tracks stay together and one of them gets no plots, the older goes on with what both know."""
    store = core.store
    shown = likeliest(core, core.shown())
    alive = close_rows(core, shown, time, DUPLICATE_DISTANCE_M, _starved(core, shown, time))
    if len(alive) < len(shown):
        _reset(store.rows, shown, alive)
    if len(alive) < 2:
        return
    _, (state, covariance) = core.predicted(alive, np.full(len(alive), time))
    records = store.records(alive)
    covariance = with_latency(state, covariance, core.unsure_latency(alive, np.full(len(alive), time)))
    order = np.argsort(state[:, 0], kind="stable")
    named = records["named"]
    name = np.full(len(alive), -1, np.int64)
    name[named] = np.unique(records["address"][named], return_inverse=True)[1]
    # Never merge a reported vehicle with a track classified as an aircraft.
    kind = np.zeros(len(alive), np.int8)
    kind[records["claimed"] == TargetCategory.VEHICLE] = VEHICLE
    kind[(kind == 0) & (records["category"] == TargetClass.AIRCRAFT)] = AIRCRAFT
    original = np.full(len(alive), -1, np.int64)
    seen = np.stack([records["born"], records["plot_since"], records["radar_time"]], axis=1)
    _duplicates(
        order, state, covariance, extents(records), name, kind, _starved(core, alive, time), named, seen, original
    )
    store.duplicate_checks[alive] = np.where(original >= 0, records["duplicate_checks"] + 1, 0)
    gone: list[int] = []
    for junior in np.flatnonzero(store.duplicate_checks[alive] >= _checks_wanted(core, records, state, original)):
        senior = alive[original[junior]]
        if senior not in gone:
            absorb(core, int(senior), int(alive[junior]))
            gone.append(int(alive[junior]))
    core.count("merged", len(gone))
    end_tracks(core, np.array(gone, np.int64))


def _checks_wanted(core: Core, records: Array, state: Floats, original: Array) -> Array:
    """(n,) checks in a row after which a track becomes one with its `original`.

    One that is reported and one that is not may be a vehicle and what it drives past: only time tells them apart,
    unless both move fast and alike.
    """
    fast = np.hypot(state[:, 2], state[:, 3]) > FAST_ALIKE
    passing = (records["named"] != records["named"][original]) & ~(fast & fast[original])
    return np.where(passing, core.settings.grouping.merge_named_after, core.settings.grouping.merge_after)


def _starved(core: Core, rows: Array, time: float) -> Array:
    """Mask of the tracks that no radar has contributed to for some turns."""
    store, made = core.store, np.empty(len(rows), np.bool_)
    period = np.array([one.period for one in core.clocks])
    _find_starved(store.rows, store.evidence, rows, period, time, core.settings.grouping.starved_turns, made)
    return made


@allocating
def _find_starved(
    tracks: Array, evidence: Array, rows: Array, period: Floats, time: float, turns: float, made: Array
) -> None:
    for k in range(len(rows)):
        fastest, slowest = np.inf, 0.0
        for s in range(len(period)):
            slowest = max(slowest, period[s])
            if evidence[rows[k], s]["history"] != 0:
                fastest = min(fastest, period[s])
        if fastest == np.inf:
            fastest = slowest if slowest > 0.0 else 1.0
        made[k] = tracks[rows[k]]["radar_time"] < time - turns * fastest


def _end_fragments(core: Core) -> None:
    """End tentative tracks by radar alone inside the extent of an established track: they are fragments of its echo."""
    n = core.store.n
    gone = np.empty(n, np.int64)
    many = _inside(core.store.rows[:n], core.store.time, core.settings.grouping.absorb_margin, gone)
    if many:
        core.count("absorbed_tracks", many)
        end_tracks(core, gone[:many])


@allocating
def _reset(tracks: Array, rows: Array, but: Array) -> None:
    """Tracks without a neighbour duplicate none."""
    k = 0
    for i in rows:
        if k < len(but) and but[k] == i:
            k += 1
        else:
            tracks[i]["duplicate_checks"] = 0


@allocating
def _inside(tracks: Array, time: Floats, margin: float, gone: Array) -> int:
    """Write the tentative tracks that radars alone saw within the extent of an established track; how many."""
    n = len(tracks)
    young, old = np.empty(n, np.int64), np.empty(n, np.int64)
    place = np.empty((n, 2))
    y = o = 0
    earliest, latest = np.inf, -np.inf
    for i in range(n):
        one = tracks[i]
        if one["phase"] == TENTATIVE:
            if one["extent_count"] > 0 and max(one["node_time"], one["report_time"]) == NEVER:
                young[y], place[i, 0], place[i, 1] = i, one["state"][0], one["state"][1]
                earliest, latest = min(earliest, time[i]), max(latest, time[i])
                y += 1
        elif one["phase"] == CONFIRMED and one["extent_count"] >= SETTLED:
            old[o] = i
            o += 1
    if y == 0 or o == 0:
        return 0
    start, order, grid = sort_into_cells(place, young[:y], CELL_M)
    west, south, cell, nx, ny = grid[0], grid[1], grid[2], int(grid[3]), int(grid[4])
    inside, extent, own = np.zeros(n, np.bool_), np.empty(3), np.empty(3)
    for i in old[:o]:
        x = tracks[i]["state"]
        fill_track_extent(tracks[i], extent)
        passed = max(abs(latest - time[i]), abs(time[i] - earliest))
        far = farthest_within(extent, margin)
        e, w = far + passed * abs(x[2]), far + passed * abs(x[3])
        x_from, x_to = span(x[0] - e - west, x[0] + e - west, cell, nx)
        y_from, y_to = span(x[1] - w - south, x[1] + w - south, cell, ny)
        for cy in range(y_from, y_to):
            for k in range(start[cy * nx + x_from], start[cy * nx + x_to] if x_to > x_from else 0):
                j = order[k]
                if inside[j]:
                    continue
                other = tracks[j]
                fill_track_extent(other, own)
                ratio = place_within(
                    time[i], x, tracks[i]["covariance"], extent, time[j], other["state"], other["covariance"], own[0],
                    margin,
                )  # fmt: skip
                inside[j] = ratio < OUTSIDE
    many = 0
    for j in young[:y]:
        if inside[j]:
            gone[many] = j
            many += 1
    return many


@allocating
def _duplicates(
    order: Array, state: Floats, cov: Floats, extent: Floats, name: Array, kind: Array, starved: Array, named: Array,
    seen: Floats, original: Array,
) -> None:  # fmt: skip
    """For each track the older one that it duplicates, or -1. order: rows by east. seen: (n, 3) UTC s from when a track
    is known, of its first and of its last plot."""
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
            together = min(seen[i, 2], seen[j, 2]) - max(seen[i, 1], seen[j, 1])
            if named[i] != named[j] and together > SEEN_APART_S:
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
            older, younger = (i, j) if (seen[i, 0], i) <= (seen[j, 0], j) else (j, i)
            if original[younger] < 0:
                original[younger] = older
