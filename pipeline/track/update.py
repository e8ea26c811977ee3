"""The one path by which measurements reach tracks, of whatever sensor: updates and new tracks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.compiled import allocating
from pipeline.tables import Source
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import SOURCE_TIMES, Core
from pipeline.track.schedule import forget_plans
from pipeline.track.store import NEVER

CENTROID_JUMP = 0.5
"""Fraction of its extent by which the centroid of a standing target may jump: from its middle to one end."""

FIRST_SCORE = 0.5
"""Fraction of `other_sensor` that a track begun by a node event or a report has for each hit counted beforehand, so
that it takes a second measurement to confirm it."""


def node_sensor(core: Core) -> int:
    """The column of the evidence of nodes."""
    return len(core.radars)


def report_sensor(core: Core) -> int:
    """The column of the evidence of reports."""
    return len(core.radars) + 1


def update_tracks(
    core: Core, predicted: Any, measured: Measured, hypotheses: Hypotheses, sensor: int, source: Source
) -> None:
    """The filter takes the hypotheses of predicted rows over measurements; what took something was hit."""
    store = core.store
    innovations = core.filter.update(store, predicted, measured, hypotheses)
    mean, covariance = core.on_ground(innovations.moments)
    _contribute(
        store.rows, store.evidence, store.look, store.rows[SOURCE_TIMES[source]], predicted.rows, mean, covariance,
        measured.time, hypotheses.track_first, hypotheses.plot_first, hypotheses.plot, sensor, CENTROID_JUMP,
        core.settings.reporting.moved_by,
    )  # fmt: skip


def add_score(core: Core, rows: Array, sensor: int, amount: float) -> None:
    """A sensor without false plots saw these tracks."""
    score = core.store.evidence["score"]
    score[rows, sensor] = np.minimum(score[rows, sensor] + amount, core.settings.evidence.max_score)


def renew(core: Core, rows: Array) -> None:
    """Take from the filter what it now says of the rows."""
    _, moments = core.predicted(rows, core.store.time[rows])
    _put_moments(core.store.rows, rows, moments.mean, moments.covariance)


def start_tracks(
    core: Core, measured: Measured, prior: Prior, sensor: int, source: Source, simulated: Array | bool,
    head_start: int = 0,
) -> Array:  # fmt: skip
    """Rows of new tentative tracks, fewer than asked when the store is full. head_start: looks counted as hits
    beforehand."""
    store = core.store
    made = store.append(len(measured.time))
    k = made.stop - made.start
    core.count("no_room", len(measured.time) - k)
    rows = np.arange(made.start, made.stop)
    if not k:
        return rows
    if k < len(measured.time):
        simulated = np.broadcast_to(simulated, (len(measured.time),))[:k]
        measured, prior = Measured(*(one[:k] for one in measured)), Prior(*(one[:k] for one in prior))
    core.filter.start(store, rows, measured, prior)
    _, moments = core.predicted(rows, store.time[made])
    first_score = 0.0
    if source != Source.RADAR:
        first_score = (1 + head_start) * core.settings.evidence.other_sensor * FIRST_SCORE
    last = [clock.decided_row(azimuths) for clock, azimuths in zip(core.clocks, core.azimuths, strict=True)]
    _found(
        store.rows, store.evidence, store.look, store.rows[SOURCE_TIMES[source]], rows, *moments, measured.time,
        measured.position, np.full(k, simulated), sensor, 1 + head_start, first_score, np.array(last, np.int64),
        np.array(core.azimuths, np.int64),
    )  # fmt: skip
    return rows


def restate(core: Core, rows: Array, shift: Floats, more: Floats) -> None:
    """The filter begins the rows anew (k, 2) m from where they are, less sure of the position by (k, 2, 2) m^2.

    What comes next then moves the position and not the velocity.
    """
    store = core.store
    state, covariance = store.state[rows], store.covariance[rows]
    there = Measured.of(store.time[rows], state[:, :2] + shift, covariance[:, :2, :2] + more)
    known = np.ones(len(rows), np.bool_)
    core.filter.start(store, rows, there, Prior(state[:, 2:].copy(), covariance[:, 2:, 2:].copy(), known))
    renew(core, rows)
    forget_plans(store.look, rows)


def unknown_velocity(core: Core, rows: int) -> Prior:
    """Nothing is known of the velocity."""
    covariance = np.zeros((rows, 2, 2))
    covariance[:, 0, 0] = covariance[:, 1, 1] = core.settings.start.speed_sd**2
    return Prior(np.zeros((rows, 2)), covariance, np.zeros(rows, np.bool_))


@allocating
def _put_moments(tracks: Array, rows: Array, mean: Floats, covariance: Floats) -> None:
    for k in range(len(rows)):
        one = tracks[rows[k]]
        one["state"][:], one["covariance"][:] = mean[k], covariance[k]


@allocating
def _found(
    tracks: Array, evidence: Array, look: Array, source_time: Floats, rows: Array, mean: Floats, covariance: Floats,
    time: Floats, position: Floats, simulated: Array, sensor: int, hits: int, score: float, decided: Array,
    azimuths: Array,
) -> None:  # fmt: skip
    """Write what is known of new tracks. decided: absolute row of each radar's newest mark."""
    for k in range(len(rows)):
        i = rows[k]
        one, seen = tracks[i], evidence[i, sensor]
        one["state"][:], one["covariance"][:] = mean[k], covariance[k]
        one["updated"] = one["born"] = source_time[i] = time[k]
        one["birthplace"][:] = position[k]
        one["hits"], one["simulated"] = 1, simulated[k]
        seen["looks"], seen["history"], seen["score"] = hits, (1 << hits) - 1, score
        for s in range(look.shape[1]):
            # as if looked at half a turn ago: the look at which they were found is over, the next is due
            look[i, s]["last"] = decided[s] - azimuths[s] // 2


@allocating
def _contribute(
    tracks: Array, evidence: Array, look: Array, source_time: Floats, rows: Array, mean: Floats, covariance: Floats,
    time: Floats, track_first: Array, plot_first: Array, plot: Array, sensor: int, centroid_jump: float,
    moved_by: float,
) -> None:  # fmt: skip
    """Write what the filter now says of the tracks that took something, and that the sensor saw them."""
    for k in range(len(rows)):
        first, last = plot_first[track_first[k]], plot_first[track_first[k + 1]]
        if first == last:
            continue
        newest = NEVER
        for o in range(first, last):
            newest = max(newest, time[plot[o]])
        i = rows[k]
        one = tracks[i]
        x, p, place = one["state"], one["covariance"], one["birthplace"]
        x[:], p[:] = mean[k], covariance[k]
        one["updated"] = max(one["updated"], newest)
        source_time[i] = max(source_time[i], newest)
        size = max(2.0 * one["least_half_extent"], one["length"] if one["length"] > 0.0 else 0.0)
        if math.hypot(x[0] - place[0], x[1] - place[1]) > moved_by + centroid_jump * size:
            one["moved"] = True
        one["hits"] += 1
        seen = evidence[i, sensor]
        seen["history"] = (seen["history"] << np.uint32(1)) | np.uint32(1)
        seen["looks"] += 1
        for s in range(evidence.shape[1]):
            evidence[i, s]["misses"] = 0
        for s in range(look.shape[1]):
            if s != sensor:  # what is known of the track has changed: the looks of the others are planned anew
                look[i, s]["planned"], look[i, s]["wake"] = False, 0
