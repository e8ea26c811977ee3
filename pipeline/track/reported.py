"""The table of tracks that is handed out."""

from __future__ import annotations

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.kernels.compiled import allocating
from pipeline.tables import TrackPhase, Tracks
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import SOURCE_TIMES, TENTATIVE, Core
from pipeline.track.plot_pool import PAVED
from pipeline.track.shape import SETTLED
from pipeline.track.store import ENDED, NEVER

_SAME = {
    "id": "i8", "number": "u2", "phase": "u1", "updated": "f8", "born": "f8", "hits": "i4", "altitude": "f4",
    "on_ground": "?", "category": "u1", "simulated": "?",
}  # fmt: skip
"""Columns that the table has as they are in the store, besides those of text, in the order of `_describe`."""

_FACTS = {"misses": "i4", "length": "f4", "width": "f4", "heading": "f4", "axis": "f4", "sources": "u1"}
"""Columns that are made for it, in that order too."""

COURSE_SPEED = 2.0
"""m/s, above which the direction of motion is told as heading; below it is noise."""

OVERHEAD = 45.0
"""m above the airport beyond which a target flies over what is below it, as in the rules of the alerts."""

LONG = 1.3
"""Times as long as wide that a target is at least for its axis to be told: that of a round echo is noise."""

NOWHERE = -1
"""Index of no zone and no runway."""

MEMORY_TURNS = 2.0
"""Turns of the slowest radar for which the contribution of a sensor is shown at least."""


def reported_tracks(core: Core, time: float | None = None) -> Tracks:
    """The confirmed and coasting tracks that are shown, in order of birth.

    Each stands at the time of its last measurement, coasting ones at the tracker's time; with `time`, all at it.
    Tracks by radar alone that never moved and stand off the pavement are left out unless the settings want them.
    """
    store = core.store
    rows = np.empty(store.n, np.int64)
    rows = likeliest(core, rows[: _confirmed(store.rows[: store.n], rows)])
    at, state, covariance = store.time[rows], np.empty((len(rows), 4)), np.empty((len(rows), 4, 4))
    if time is not None:
        at = np.full(len(rows), time)
        state, covariance = core.predicted(rows, at)[1]
    elif many := _place(store.rows, rows, at, core.time, late := np.empty(len(rows), np.int64), state, covariance):
        late = late[:many]
        at[late] = core.time
        state[late], covariance[late] = core.predicted(rows[late], at[late])[1]
    seen = _reportable(core, rows, state)
    if not seen.all():
        rows, at, state, covariance = rows[seen], at[seen], state[seen], covariance[seen]
    made = {name: np.empty(len(rows), kind) for name, kind in (_SAME | _FACTS).items()}
    memory = max([core.settings.reporting.source_memory, *(MEMORY_TURNS * one.period for one in core.clocks)])
    _describe(
        store.rows, store.evidence, rows, state, len(core.radars), core.time - memory, *made.values(),
    )  # fmt: skip
    zone, runway = core.zones.zone(state[:, 0], state[:, 1]), core.zones.runway(state[:, 0], state[:, 1])
    above = ~made["on_ground"] & (made["altitude"] > OVERHEAD)
    if above.any():
        zone, runway = np.where(above, NOWHERE, zone), np.where(above, NOWHERE, runway)
    return Tracks(
        time=at,
        state=state,
        covariance=covariance,
        zone=zone,
        runway=runway,
        address=store.address[rows],
        callsign=store.callsign[rows],
        **made,
    )


def _reportable(core: Core, rows: Array, state: Floats) -> Array:
    kind = core.zones.kind(state[:, 0], state[:, 1])
    made = np.empty(len(rows), np.bool_)
    _choose(
        core.store.rows, rows, kind, PAVED, BUILDING, core.settings.reporting.fixed_off_pavement,
        core.settings.extent.aircraft_length, made,
    )  # fmt: skip
    return made


@allocating
def _confirmed(tracks: Array, rows: Array) -> int:
    """Write the rows that are confirmed or coasting and have an id; how many."""
    k = 0
    for i in range(len(tracks)):
        one = tracks[i]
        if one["phase"] != TENTATIVE and one["phase"] != ENDED and one["id"] > 0:
            rows[k] = i
            k += 1
    return k


@allocating
def _place(tracks: Array, rows: Array, at: Floats, now: float, late: Array, state: Floats, covariance: Floats) -> int:
    """Write where the tracks were last known to be, and which of them coast and are older than now; how many."""
    many = 0
    for k in range(len(rows)):
        one = tracks[rows[k]]
        x, p = one["state"], one["covariance"]
        for i in range(4):
            state[k, i] = x[i]
            for j in range(4):
                covariance[k, i, j] = p[i, j]
        if one["phase"] == COASTING and at[k] < now:
            late[many] = k
            many += 1
    return many


@allocating
def _choose(
    tracks: Array, rows: Array, kind: Array, paved: Array, building: int, fixed_too: bool, aircraft_length: float,
    made: Array,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        one = tracks[rows[k]]
        known = one["named"] or one["node_time"] > NEVER or one["report_time"] > NEVER
        # a track that its radar has lost does not go on through a building
        lost = not known and one["phase"] == COASTING and kind[k] == building
        large = one["length"] >= aircraft_length and one["extent_count"] >= SETTLED
        made[k] = not lost and (fixed_too or known or one["moved"] or large or paved[kind[k]])


COASTING, BUILDING = int(TrackPhase.COASTING), int(SurfaceKind.BUILDING)


@allocating
def _describe(
    tracks: Array, evidence: Array, rows: Array, state: Floats, radars: int, remembered: float, identity: Array,
    number: Array, phase: Array, updated: Floats, born: Floats, hits: Array, altitude: Array, on_ground: Array,
    category: Array, simulated: Array, misses: Array, length: Array, width: Array, heading: Array, axis: Array,
    sources: Array,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        one = tracks[rows[k]]
        identity[k], number[k], phase[k], hits[k] = one["id"], one["number"], one["phase"], one["hits"]
        updated[k], born[k], altitude[k] = one["updated"], one["born"], one["altitude"]
        on_ground[k], category[k], simulated[k] = one["on_ground"], one["category"], one["simulated"]
        fewest = -1
        for s in range(radars):
            seen = evidence[rows[k], s]
            if seen["history"] != 0 and (fewest < 0 or seen["misses"] < fewest):
                fewest = seen["misses"]
        misses[k] = max(fewest, 0)
        v_east, v_north = state[k, 2], state[k, 3]
        if one["extent_count"] > 0:
            length[k], width[k], heading[k] = one["length"], one["width"], one["heading"]
            axis[k] = one["axis_bearing"] if length[k] >= LONG * width[k] else np.nan
        else:
            length[k] = width[k] = heading[k] = axis[k] = np.nan
            if v_east * v_east + v_north * v_north > COURSE_SPEED * COURSE_SPEED:
                heading[k] = np.arctan2(v_east, v_north) % (2.0 * np.pi)
        sources[k] = (
            RADAR * (one["radar_time"] >= remembered)
            + NODE * (one["node_time"] >= remembered)
            + REPORT * (one["report_time"] >= remembered)
        )


RADAR, NODE, REPORT = (int(source) for source in SOURCE_TIMES)
