"""One target whose echo falls apart for good, as that of an aircraft half hidden by a building, is one track."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.airport.model import SurfaceKind
from pipeline.tables import TargetClass, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, end

BODY = 21.0
"""Half the length, and half the span, of an aircraft of unknown size, and how far off its centre may be; metres."""

FAST = 20.0
"""m/s, above which nothing else moves within the body of an aircraft."""

LONGEST = 75.0
"""No aircraft is longer; metres."""


def join_parts(core: Core) -> None:
    """Small unnamed tracks that stay within the body of an aircraft, or within one body of each other off runways and
    taxiways without ever moving, become one track with the extent of all.
    """
    table, n = core.table, core.table.n
    table.body[:n][table.moving[:n] & (table.category[:n] != TargetClass.AIRCRAFT)] = 0.0
    alive = np.flatnonzero(table.phase[:n] != TrackPhase.TENTATIVE)
    if len(alive) < 2:
        return
    dt = core.time - table.time[alive]
    state, covariance = core.filter.predict(table.state[alive], table.covariance[alive], dt)
    named = table.address[alive] != ""
    aircraft = table.category[alive] == TargetClass.AIRCRAFT
    kind = core.zones.kind(state[:, 0], state[:, 1])
    on_apron = (kind != SurfaceKind.RUNWAY) & (kind != SurfaceKind.TAXIWAY)
    still = on_apron & ~table.moved[alive] & ~named
    size = core.extents(alive)
    # not by extent, which changes with every turn; among equals the older goes on
    rank = 4.0 * named + 2.0 * aircraft + 1.0 * (table.body[alive] > 0)
    whole = np.full(len(alive), -1, np.int64)
    order = np.argsort(state[:, 0], kind="stable")
    seen = np.fmax(np.nan_to_num(table.length[alive]), np.nan_to_num(table.width[alive]))
    _parts(
        order, state, covariance, size, seen, named, aircraft, on_apron, still, rank, core.settings.absorb_margin, whole
    )
    table.part[alive] = np.where(whole >= 0, table.part[alive] + 1, 0)
    gone = np.zeros(n, np.bool_)
    fast = np.hypot(state[whole, 2], state[whole, 3]) > FAST
    patience = np.where(fast, 0, core.settings.merge_after)
    for junior in np.flatnonzero((whole >= 0) & (table.part[alive] > patience)):
        senior = alive[whole[junior]]
        if not gone[senior] and not gone[alive[junior]]:
            hopped = bool(on_apron[whole[junior]] and not named[whole[junior]])
            _cover(core, int(senior), int(alive[junior]), state[whole[junior]], state[junior], hopped)
            body = table.body[senior]
            absorb(core, int(senior), int(alive[junior]))
            table.body[senior] = body
            gone[alive[junior]] = True
    core.count("parts_joined", int(gone.sum()))
    end(core, gone)


def _cover(core: Core, whole: int, part: int, here: Floats, there: Floats, hopped: bool) -> None:
    """The extent of `whole` grows over `part`; what stands moves to the middle of both.

    hopped: it has no motion but that from part to part, so it has no heading.
    """
    table = core.table
    away = there[:2] - here[:2]
    distance = float(np.hypot(away[0], away[1]))
    own = core.extents(np.array([whole, part]))
    direction = table.heading[whole]
    if not math.isfinite(direction):
        if distance > own[0, 0]:
            table.axis[whole] = math.atan2(away[0], away[1]) % math.pi
        direction = table.axis[whole] if math.isfinite(table.axis[whole]) else 0.0
    along = abs(away[0] * math.sin(direction) + away[1] * math.cos(direction))
    across = abs(away[0] * math.cos(direction) - away[1] * math.sin(direction))
    grown = []
    for own_side, other, apart in ((own[0, 0], own[1, 0], along), (own[0, 1], own[1, 1], across)):
        grown.append(min(max(own_side, own_side / 2 + apart + other / 2), LONGEST))
    if hopped:
        # halfway by how far the extent grew, so that the far edges of both stay where they are
        share = (
            0.5 * (grown[0] - own[0, 0]) / max(along, 1.0)
            if along >= across
            else 0.5 * (grown[1] - own[0, 1]) / max(across, 1.0)
        )
        table.state[whole, :2] += min(share, 1.0) * away
        table.covariance[whole, 0, 0] += (0.1 * distance) ** 2
        table.covariance[whole, 1, 1] += (0.1 * distance) ** 2
    if hopped:
        table.moved[whole] = table.moving[whole] = False
        table.heading[whole] = np.nan
        table.birthplace[whole] = table.state[whole, :2]
    table.length[whole], table.width[whole] = grown
    table.body[whole] = max(BODY, 0.5 * max(grown))
    table.shapes[whole] = max(int(table.shapes[whole]), 1)


def absorb(core: Core, senior: int, junior: int) -> None:
    """The senior takes the better state, and name and extent where it has none."""
    table = core.table
    if np.trace(table.covariance[junior, :2, :2]) < np.trace(table.covariance[senior, :2, :2]) or (
        table.radar_time[junior] > table.radar_time[senior]
    ):
        for name in ("time", "state", "covariance", "one_point"):
            getattr(table, name)[senior] = getattr(table, name)[junior]
        table.looked[:, senior] = table.looked[:, junior]
    if table.shapes[junior] > table.shapes[senior]:
        for name in ("length", "width", "heading", "axis", "moving", "shapes", "category", "body"):
            getattr(table, name)[senior] = getattr(table, name)[junior]
    if table.address[senior] == "" and table.address[junior] != "":
        for name in ("address", "callsign", "claimed", "altitude", "on_ground", "simulated", "doubt"):
            getattr(table, name)[senior] = getattr(table, name)[junior]
        if table.claimed[senior]:
            table.category[senior] = table.claimed[senior]
    for name in ("updated", "radar_time", "node_time", "report_time"):
        getattr(table, name)[senior] = max(getattr(table, name)[senior], getattr(table, name)[junior])
    table.hits[senior] += table.hits[junior]
    table.misses[senior] = min(table.misses[senior], table.misses[junior])
    table.moved[senior] |= table.moved[junior]


@njit(nogil=True, cache=True)
def _parts(
    order: Array, state: Floats, cov: Floats, extent: Floats, seen: Floats, named: Array, aircraft: Array,
    apron: Array, still: Array, rank: Floats, margin: float, whole: Array,
) -> None:  # fmt: skip
    """For each track the one it is a part of, or -1. order: rows by east."""
    for a in range(len(order)):
        for b in range(a + 1, len(order)):
            i, j = order[a], order[b]
            e, n = state[j, 0] - state[i, 0], state[j, 1] - state[i, 1]
            if e > 0.5 * LONGEST + margin:
                break
            if (rank[j], -j) > (rank[i], -i):
                i, j = j, i
            if named[j] or not (aircraft[i] or (still[i] and still[j])):
                continue
            reach = max(0.5 * max(extent[i, 0], extent[i, 1]), BODY) + margin
            apart = math.sqrt(e * e + n * n)
            if apart > reach or (seen[j] > 25.0 and apart > BODY):
                continue
            faster = (state[i, 2] - state[j, 2]) ** 2 + (state[i, 3] - state[j, 3]) ** 2
            loose = cov[i, 2, 2] + cov[i, 3, 3] + cov[j, 2, 2] + cov[j, 3, 3]
            # on the apron a track that hops from part to part seems to move
            slack = 4.0 if apron[i] and apron[j] else 1.0
            pace = state[i, 2] ** 2 + state[i, 3] ** 2
            # two of them cannot fly or roll so close; new tracks have wild speeds
            if pace > FAST**2:
                slack += 0.02 * pace
            if faster > 5.0 * (loose + slack):
                continue
            if whole[j] < 0 or (rank[i], -i) > (rank[whole[j]], -whole[j]):
                whole[j] = i
