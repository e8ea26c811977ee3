"""One target whose echo falls apart for good, as that of an aircraft half hidden by a building, is one track."""

from __future__ import annotations

import math

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.group.fragments import AIRCRAFT_HALF_EXTENT, FAST, LONGEST_AIRCRAFT, Tracks, find_fragments, grow_extent
from pipeline.kernels.compiled import allocating
from pipeline.tables import TargetClass
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import Core
from pipeline.track.judge import end_tracks
from pipeline.track.neighbours import close_rows
from pipeline.track.shape import extents, fill_track_extent
from pipeline.track.update import renew, restate

MERGED_POSITION_SD = 0.1
"""Standard deviation of the middle of a joined target, as a fraction of the distance of its two fragments."""

AIRCRAFT = int(TargetClass.AIRCRAFT)

RANK_NAMED, RANK_AIRCRAFT, RANK_JOINED = 4.0, 2.0, 1.0
"""Which of two tracks goes on: one with an address before one without, then an aircraft, then one that already holds
fragments. Not the larger, for extents change with every turn. Each outweighs all that follow it."""

EXTENT_COLUMNS = (
    "length", "width", "heading", "axis_bearing", "moving", "extent_count", "category", "least_half_extent",
)  # fmt: skip
"""What a track knows of the size and direction of its target."""

IDENTITY_COLUMNS = (
    "named", "address", "callsign", "claimed", "altitude", "on_ground", "simulated", "misfit_reports",
)  # fmt: skip
"""What reports say of a target besides its motion."""


def join_fragments(core: Core, time: float) -> None:
    """Make one track, with the extent of all, of an aircraft and the tracks without an address that stay within its
    extent, and of tracks that stay close together off runways and taxiways without ever moving.
    """
    store = core.store
    shown = likeliest(core, core.shown())
    reach = 0.5 * LONGEST_AIRCRAFT + core.settings.grouping.absorb_margin
    alive = close_rows(core, shown, time, reach)
    n = len(alive)
    if n < 2:
        _count_checks(store.rows[: store.n], alive, np.full(n, -1))
        return
    _, (state, covariance) = core.predicted(alive, np.full(n, time))
    kind = core.zones.kind(state[:, 0], state[:, 1])
    on_apron = (kind != SurfaceKind.RUNWAY) & (kind != SurfaceKind.TAXIWAY)
    tracks = Tracks(
        state, covariance, np.empty((n, 3)), np.empty(n), np.empty(n, np.bool_), np.empty(n, np.bool_), on_apron,
        np.empty(n, np.bool_), np.empty(n),
    )  # fmt: skip
    _describe(
        store.rows, alive, on_apron, tracks.extent, tracks.longest_side, tracks.named, tracks.aircraft, tracks.standing,
        tracks.rank,
    )  # fmt: skip
    named = tracks.named
    whole = find_fragments(tracks, core.settings.grouping.absorb_margin)
    if not _count_checks(store.rows[: store.n], alive, whole):
        return
    fast = np.hypot(state[whole, 2], state[whole, 3]) > FAST
    patience = np.where(fast, 0, core.settings.grouping.merge_after)
    gone: list[int] = []
    for fragment in np.flatnonzero((whole >= 0) & (store.fragment_checks[alive] > patience)):
        senior, junior = int(alive[whole[fragment]]), int(alive[fragment])
        if senior not in gone and junior not in gone:
            parked = bool(on_apron[whole[fragment]] and not named[whole[fragment]])
            _cover(core, senior, junior, state[fragment, :2] - state[whole[fragment], :2], parked)
            least = store.least_half_extent[senior]
            absorb(core, senior, junior, keep_place=parked)
            store.least_half_extent[senior] = least
            gone.append(junior)
    core.count("fragments_joined", len(gone))
    end_tracks(core, np.array(gone, np.int64))


@allocating
def _describe(
    tracks: Array, rows: Array, on_apron: Array, extent: Floats, longest_side: Floats, named: Array, aircraft: Array,
    standing: Array, rank: Floats,
) -> None:  # fmt: skip
    """Write what `find_fragments` is told of tracks besides their motion."""
    for k in range(len(rows)):
        one = tracks[rows[k]]
        if one["moving"] and one["category"] != AIRCRAFT:
            one["least_half_extent"] = 0.0  # what moves is seen whole again
        fill_track_extent(one, extent[k])
        length, width = one["length"], one["width"]
        longest_side[k] = max(length if math.isfinite(length) else 0.0, width if math.isfinite(width) else 0.0)
        named[k], aircraft[k] = one["named"], one["category"] == AIRCRAFT
        standing[k] = on_apron[k] and not one["moved"] and not named[k]
        joined = one["least_half_extent"] > 0.0
        rank[k] = RANK_NAMED * named[k] + RANK_AIRCRAFT * aircraft[k] + RANK_JOINED * joined


@allocating
def _count_checks(tracks: Array, rows: Array, whole: Array) -> bool:
    """Count, of `rows`, the checks in which each was a fragment of another; the others are none. Whether any was."""
    k, any_fragment = 0, False
    for i in range(len(tracks)):
        one = tracks[i]
        if k < len(rows) and rows[k] == i:
            fragment = whole[k] >= 0
            one["fragment_checks"] = one["fragment_checks"] + 1 if fragment else 0
            any_fragment = any_fragment or fragment
            k += 1
        else:
            one["fragment_checks"] = 0
            if one["moving"] and one["category"] != AIRCRAFT:
                one["least_half_extent"] = 0.0
    return any_fragment


def _cover(core: Core, whole: int, fragment: int, away: Floats, parked: bool) -> None:
    """Grow the extent of the track `whole` over that of `fragment`, which lies `away` (east, north) m from it.

    parked: its only motion was that from fragment to fragment, so it has no heading, and moves to the middle of both.
    """
    store = core.store
    distance = float(np.hypot(away[0], away[1]))
    own = extents(store.records(np.array([whole, fragment])))
    direction = store.heading[whole]
    if not math.isfinite(direction):
        if distance > own[0, 0]:
            store.axis_bearing[whole] = math.atan2(away[0], away[1]) % math.pi
        direction = store.axis_bearing[whole] if math.isfinite(store.axis_bearing[whole]) else 0.0
    grown = grow_extent(own[0], own[1], away, direction)
    if parked:
        more = (MERGED_POSITION_SD * distance) ** 2 * np.eye(2)
        restate(core, np.array([whole]), (grown.shift * away)[None], more[None])
        store.moved[whole] = store.moving[whole] = False
        store.heading[whole] = np.nan
        store.birthplace[whole] = store.state[whole, :2]
    store.length[whole], store.width[whole] = grown.length, grown.width
    store.least_half_extent[whole] = max(AIRCRAFT_HALF_EXTENT, 0.5 * max(grown.length, grown.width))
    store.extent_count[whole] = max(int(store.extent_count[whole]), 1)


def absorb(core: Core, senior: int, junior: int, keep_place: bool = False) -> None:
    """The track `senior` takes over from `junior` the better state, and address and extent where it has none.

    keep_place: not the state, for the middle of both is where the target is.
    """
    store = core.store
    mine, other = store.rows[senior], store.rows[junior]
    surer = np.trace(other["covariance"][:2, :2]) < np.trace(mine["covariance"][:2, :2])
    if not keep_place and (surer or other["radar_time"] > mine["radar_time"]):
        core.filter.merge(store, np.array([senior]), np.array([junior]), np.ones(1))
        renew(core, np.array([senior]))
        store.look[senior] = store.look[junior]
    if other["extent_count"] > mine["extent_count"]:
        for name in EXTENT_COLUMNS:
            mine[name] = other[name]
    if other["named"] and not mine["named"]:
        for name in IDENTITY_COLUMNS:
            mine[name] = other[name]
        if mine["claimed"]:
            mine["category"] = mine["claimed"]
    for name in ("updated", "radar_time", "node_time", "report_time"):
        mine[name] = max(mine[name], other[name])
    mine["hits"] += other["hits"]
    mine["moved"] |= other["moved"]
    store.evidence[senior] = _joined(store.evidence[senior], store.evidence[junior])


def _joined(mine: Array, other: Array) -> Array:
    """The evidence of two tracks of one target: of each sensor, that of the track which it favours more."""
    made = mine.copy()
    better = other["score"] > mine["score"]
    made[better] = other[better]
    made["history"] = mine["history"] | other["history"]
    made["looks"] = np.maximum(mine["looks"], other["looks"])
    made["misses"] = np.minimum(mine["misses"], other["misses"])
    return made
