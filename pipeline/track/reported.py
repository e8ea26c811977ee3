"""The table of tracks that is handed out."""

from __future__ import annotations

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.kernels.compiled import allocating
from pipeline.kernels.records import take
from pipeline.tables import TrackPhase, Tracks
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import SOURCE_TIMES, Core
from pipeline.track.plot_pool import PAVED
from pipeline.track.shape import SETTLED
from pipeline.track.store import NEVER

_SAME = (
    "id", "number", "phase", "updated", "born", "hits", "altitude", "on_ground", "category", "address", "callsign",
    "simulated",
)  # fmt: skip
"""Columns that the table handed out has as they are in the store."""

COURSE_SPEED = 2.0
"""m/s, above which the direction of motion is told as heading; below it is noise."""

MEMORY_TURNS = 2.0
"""Turns of the slowest radar for which the contribution of a sensor is shown at least."""


def reported_tracks(core: Core, time: float | None = None) -> Tracks:
    """The confirmed and coasting tracks that are shown, in order of birth.

    Each stands at the time of its last measurement, coasting ones at the tracker's time; with `time`, all at it.
    Tracks by radar alone that never moved and stand off the pavement are left out unless the settings want them.
    """
    store = core.store
    rows = core.shown()
    rows = likeliest(core, rows[store.id[rows] > 0])
    records, at = store.records(rows), store.time[rows]
    if time is not None:
        at = np.full(len(rows), time)
        state, covariance = core.predicted(rows, at)[1]
    else:
        state, covariance = records["state"], records["covariance"]
        late = np.flatnonzero((records["phase"] == TrackPhase.COASTING) & (at < core.time))
        if len(late):
            at[late] = core.time
            state[late], covariance[late] = core.predicted(rows[late], at[late])[1]
    seen = _reportable(core, records, state)
    if not seen.all():
        rows, records, at, state, covariance = rows[seen], take(records, seen), at[seen], state[seen], covariance[seen]
    state, covariance = np.ascontiguousarray(state), np.ascontiguousarray(covariance)
    facts = {name: np.empty(len(rows), kind) for name, kind in _FACTS.items()}
    memory = max([core.settings.reporting.source_memory, *(MEMORY_TURNS * one.period for one in core.clocks)])
    _describe(
        records, store.evidence, rows, state, len(core.radars), core.time - memory, *facts.values(),
    )  # fmt: skip
    return Tracks(
        time=at,
        state=state,
        covariance=covariance,
        zone=core.zones.zone(state[:, 0], state[:, 1]),
        runway=core.zones.runway(state[:, 0], state[:, 1]),
        **{name: np.ascontiguousarray(records[name]) for name in _SAME},
        **facts,
    )


_FACTS = {"misses": "i4", "length": "f4", "width": "f4", "heading": "f4", "sources": "u1"}


def _reportable(core: Core, records: Array, state: Floats) -> Array:
    kind = core.zones.kind(state[:, 0], state[:, 1])
    made = np.empty(len(records), np.bool_)
    _choose(
        records, kind, PAVED, SurfaceKind.BUILDING, core.settings.reporting.fixed_off_pavement,
        core.settings.extent.aircraft_length, made,
    )  # fmt: skip
    return made


@allocating
def _choose(
    tracks: Array, kind: Array, paved: Array, building: int, fixed_too: bool, aircraft_length: float, made: Array
) -> None:
    for k in range(len(tracks)):
        one = tracks[k]
        known = one["named"] or one["node_time"] > NEVER or one["report_time"] > NEVER
        # a track that its radar has lost does not go on through a building
        lost = not known and one["phase"] == COASTING and kind[k] == building
        large = one["length"] >= aircraft_length and one["extent_count"] >= SETTLED
        made[k] = not lost and (fixed_too or known or one["moved"] or large or paved[kind[k]])


COASTING = int(TrackPhase.COASTING)


@allocating
def _describe(
    tracks: Array, evidence: Array, rows: Array, state: Floats, radars: int, remembered: float, misses: Array,
    length: Array, width: Array, heading: Array, sources: Array,
) -> None:  # fmt: skip
    for k in range(len(tracks)):
        one = tracks[k]
        fewest = -1
        for s in range(radars):
            seen = evidence[rows[k], s]
            if seen["history"] != 0 and (fewest < 0 or seen["misses"] < fewest):
                fewest = seen["misses"]
        misses[k] = max(fewest, 0)
        v_east, v_north = state[k, 2], state[k, 3]
        if one["extent_count"] > 0:
            length[k], width[k], heading[k] = one["length"], one["width"], one["heading"]
        else:
            length[k] = width[k] = heading[k] = np.nan
            if v_east * v_east + v_north * v_north > COURSE_SPEED * COURSE_SPEED:
                heading[k] = np.arctan2(v_east, v_north) % (2.0 * np.pi)
        sources[k] = (
            RADAR * (one["radar_time"] >= remembered)
            + NODE * (one["node_time"] >= remembered)
            + REPORT * (one["report_time"] >= remembered)
        )


RADAR, NODE, REPORT = (int(source) for source in SOURCE_TIMES)
