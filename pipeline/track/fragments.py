"""One target whose echo falls apart for good, as that of an aircraft half hidden by a building, is one track."""

from __future__ import annotations

import math

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.group.fragments import AIRCRAFT_HALF_EXTENT, FAST, Tracks, find_fragments, grow_extent
from pipeline.tables import TargetClass, TrackPhase
from pipeline.tables.arrays import Floats
from pipeline.track.core import Core, end_tracks

MERGED_POSITION_SD = 0.1
"""Standard deviation of the middle of a joined target, as a fraction of the distance of its two fragments."""

RANK_NAMED, RANK_AIRCRAFT, RANK_JOINED = 4.0, 2.0, 1.0
"""Which of two tracks goes on: one with an address before one without, then an aircraft, then one that already holds
fragments. Not the larger, for extents change with every turn. Each outweighs all that follow it."""

EXTENT_COLUMNS = (
    "length", "width", "heading", "axis_bearing", "moving", "extent_count", "category", "least_half_extent",
)  # fmt: skip
"""What a track knows of the size and direction of its target."""


def join_fragments(core: Core) -> None:
    """Make one track, with the extent of all, of an aircraft and the tracks without an address that stay within its
    extent, and of tracks that stay close together off runways and taxiways without ever moving.
    """
    table, n = core.table, core.table.n
    table.least_half_extent[:n][table.moving[:n] & (table.category[:n] != TargetClass.AIRCRAFT)] = 0.0
    alive = np.flatnonzero(table.phase[:n] != TrackPhase.TENTATIVE)
    if len(alive) < 2:
        return
    dt = core.time - table.time[alive]
    state, covariance = core.filter.predict(table.state[alive], table.covariance[alive], dt)
    named = table.address[alive] != ""
    aircraft = table.category[alive] == TargetClass.AIRCRAFT
    kind = core.zones.kind(state[:, 0], state[:, 1])
    on_apron = (kind != SurfaceKind.RUNWAY) & (kind != SurfaceKind.TAXIWAY)
    tracks = Tracks(
        state=state,
        covariance=covariance,
        extent=core.extents(alive),
        longest_side=np.fmax(np.nan_to_num(table.length[alive]), np.nan_to_num(table.width[alive])),
        named=named,
        aircraft=aircraft,
        on_apron=on_apron,
        standing=on_apron & ~table.moved[alive] & ~named,
        rank=RANK_NAMED * named + RANK_AIRCRAFT * aircraft + RANK_JOINED * (table.least_half_extent[alive] > 0),
    )
    whole = find_fragments(tracks, core.settings.grouping.absorb_margin)
    table.fragment_checks[alive] = np.where(whole >= 0, table.fragment_checks[alive] + 1, 0)
    gone = np.zeros(n, np.bool_)
    fast = np.hypot(state[whole, 2], state[whole, 3]) > FAST
    patience = np.where(fast, 0, core.settings.grouping.merge_after)
    for fragment in np.flatnonzero((whole >= 0) & (table.fragment_checks[alive] > patience)):
        senior, junior = alive[whole[fragment]], alive[fragment]
        if not gone[senior] and not gone[junior]:
            parked = bool(on_apron[whole[fragment]] and not named[whole[fragment]])
            _cover(core, int(senior), int(junior), state[fragment, :2] - state[whole[fragment], :2], parked)
            least = table.least_half_extent[senior]
            absorb(core, int(senior), int(junior))
            table.least_half_extent[senior] = least
            gone[junior] = True
    core.count("fragments_joined", int(gone.sum()))
    end_tracks(core, gone)


def _cover(core: Core, whole: int, fragment: int, away: Floats, parked: bool) -> None:
    """Grow the extent of the track `whole` over that of `fragment`, which lies `away` (east, north) m from it.

    parked: its only motion was that from fragment to fragment, so it has no heading, and moves to the middle of both.
    """
    table = core.table
    distance = float(np.hypot(away[0], away[1]))
    own = core.extents(np.array([whole, fragment]))
    direction = table.heading[whole]
    if not math.isfinite(direction):
        if distance > own[0, 0]:
            table.axis_bearing[whole] = math.atan2(away[0], away[1]) % math.pi
        direction = table.axis_bearing[whole] if math.isfinite(table.axis_bearing[whole]) else 0.0
    grown = grow_extent(own[0], own[1], away, direction)
    if parked:
        table.state[whole, :2] += grown.shift * away
        table.covariance[whole, 0, 0] += (MERGED_POSITION_SD * distance) ** 2
        table.covariance[whole, 1, 1] += (MERGED_POSITION_SD * distance) ** 2
        table.moved[whole] = table.moving[whole] = False
        table.heading[whole] = np.nan
        table.birthplace[whole] = table.state[whole, :2]
    table.length[whole], table.width[whole] = grown.length, grown.width
    table.least_half_extent[whole] = max(AIRCRAFT_HALF_EXTENT, 0.5 * max(grown.length, grown.width))
    table.extent_count[whole] = max(int(table.extent_count[whole]), 1)


def absorb(core: Core, senior: int, junior: int) -> None:
    """The track `senior` takes over from `junior` the better state, and address and extent where it has none."""
    table = core.table
    if np.trace(table.covariance[junior, :2, :2]) < np.trace(table.covariance[senior, :2, :2]) or (
        table.radar_time[junior] > table.radar_time[senior]
    ):
        for name in ("time", "state", "covariance", "velocity_unknown"):
            getattr(table, name)[senior] = getattr(table, name)[junior]
        table.looked[:, senior] = table.looked[:, junior]
    if table.extent_count[junior] > table.extent_count[senior]:
        for name in EXTENT_COLUMNS:
            getattr(table, name)[senior] = getattr(table, name)[junior]
    if table.address[senior] == "" and table.address[junior] != "":
        for name in ("address", "callsign", "claimed", "altitude", "on_ground", "simulated", "misfit_reports"):
            getattr(table, name)[senior] = getattr(table, name)[junior]
        if table.claimed[senior]:
            table.category[senior] = table.claimed[senior]
    for name in ("updated", "radar_time", "node_time", "report_time"):
        getattr(table, name)[senior] = max(getattr(table, name)[senior], getattr(table, name)[junior])
    table.hits[senior] += table.hits[junior]
    table.misses[senior] = min(table.misses[senior], table.misses[junior])
    table.moved[senior] |= table.moved[junior]
