"""Node events: something was felt in the pavement at a known place and time."""

from __future__ import annotations

import math

import numpy as np

from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.tables import NodeEventKind, NodeEvents, Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import Core
from pipeline.track.judge import judge_tracks
from pipeline.track.shape import extents
from pipeline.track.update import add_score, node_sensor, start_tracks, unknown_velocity, update_tracks

LEAST_SPEED = 0.5
"""m/s, below which the sense of a motion along the lane is not believed."""

MOST_SPEED = 120.0
"""m/s, above which a measured speed is not believed; no landing is faster."""

GATE_SHARE = 0.5
"""Fraction of the association's gate in metres within which a track takes an event: without a velocity its covariance
reaches over half the airport, so what is near has to be near in metres, too."""

FRONT = 0.5
"""Fraction of its length from the centre of a target to its front or tail."""

EXTENT_SD_ALONG = 0.2
"""Standard deviation, as a fraction of the length, of where between its ends a target is felt."""

EXTENT_SD_ACROSS = 0.3
"""Standard deviation, as a fraction of the width, of which of its sides a target is felt by."""

UNKNOWN_END_SD = 0.3
"""Standard deviation, as a fraction of the length, of the centre when it is not known which end was felt."""

KNOWN_SPEED_HEAD_START = 2
"""Looks that count as hits beforehand of a track begun by an event with a speed: only a vehicle in motion gives one."""

SPEED_SD, SPEED_SD_ACROSS = 1.0, 0.1
"""m/s, least standard deviation of a first velocity along and across the lane, and fraction of the speed by which the
one across grows. Along the lane the whole speed is added: a lane is driven both ways, so the sense is not known."""

ALL_HITS, HISTORY_LOOKS = 0xFFFFFFFF, 32
"""A history of nothing but hits, and how many looks it holds."""


def take_node_events(core: Core, events: NodeEvents) -> NodeEvents:
    """Each event pulls and confirms the track that it fits best, or starts one. Gives those that were taken."""
    known = (events.node >= 0) & (events.node < len(core.nodes))
    core.count("node_unknown", int((~known).sum()))
    events = events[known]
    events = events[core.in_time(events.time, "node")]
    for event in np.argsort(events.time, kind="stable"):
        _apply_event(core, events, int(event))
        core.time = max(core.time, float(events.time[event]))
    rows = core.alive()
    judge_tracks(core, rows, np.full(len(rows), core.time))
    return events


def _apply_event(core: Core, events: NodeEvents, event: int) -> None:
    site, time = core.nodes[int(events.node[event])], float(events.time[event])
    store, rows = core.store, likeliest(core, core.alive())
    lane = np.array([math.sin(site.heading), math.cos(site.heading)])
    _, (state, covariance) = core.predicted(rows, np.full(len(rows), time))
    size = extents(store.records(rows))
    position, noise = _as_measured(
        core, site.accuracy, lane, state, size, int(events.kind[event]), (site.east, site.north)
    )
    spread = covariance[:, :2, :2] + noise
    off = position - state[:, :2]
    distance = _squared(off, spread)
    close = (distance <= core.associate.gate) & (
        np.hypot(off[:, 0], off[:, 1]) <= GATE_SHARE * core.associate.max_gate_m
    )
    cost = distance + np.log(np.linalg.det(spread)) if len(rows) else distance
    cost = cost + np.where(store.phase[rows] == TrackPhase.TENTATIVE, core.settings.measurement.tentative_penalty, 0.0)
    if close.any():
        best = int(np.argmin(np.where(close, cost, np.inf)))
        measured = Measured.of(
            np.array([time]), position[best][None], noise[best][None], speed=events.speed[event],
            sensor=node_sensor(core),
        )  # fmt: skip
        _update_track(core, rows[best : best + 1], measured)
        return
    _start(core, events, event, time, lane)


def _as_measured(
    core: Core, accuracy: float, lane: Floats, state: Floats, size: Floats, kind: int, at: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Where the centre of each track would be if it caused the event, and how surely: (n, 2) and (n, 2, 2).

    ARRIVED is felt when the front reaches the node, LEFT when the tail leaves it.
    """
    sense = state[:, 2] * lane[0] + state[:, 3] * lane[1]
    offset = {NodeEventKind.ARRIVED: -FRONT, NodeEventKind.LEFT: FRONT}.get(NodeEventKind(min(int(kind), 2)), 0.0)
    shift = np.where(np.abs(sense) > LEAST_SPEED, np.sign(sense), 0.0) * offset * size[:, 0]
    position = np.array(at) + shift[:, None] * lane
    unknown_end = (UNKNOWN_END_SD * abs(offset) * 2 * size[:, 0]) ** 2
    along = accuracy**2 + (EXTENT_SD_ALONG * size[:, 0]) ** 2 + np.where(shift == 0, unknown_end, 0.0)
    across = core.settings.measurement.lane_sd**2 + (EXTENT_SD_ACROSS * size[:, 1]) ** 2
    noise = along[:, None, None] * np.outer(lane, lane)
    side = _side(lane)
    return position, np.asarray(noise + across[:, None, None] * np.outer(side, side))


def _squared(off: Floats, spread: Floats) -> Floats:
    det = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
    top = (
        off[:, 0] ** 2 * spread[:, 1, 1]
        - 2 * off[:, 0] * off[:, 1] * spread[:, 0, 1]
        + off[:, 1] ** 2 * spread[:, 0, 0]
    )
    return np.asarray(top / det)


def _update_track(core: Core, rows: Array, measured: Measured) -> None:
    store, sensor = core.store, node_sensor(core)
    if core.associate.branching:
        rows = core.alive()[store.target[core.alive()] == store.target[rows[0]]]
    tentative = rows[store.phase[rows] == TrackPhase.TENTATIVE]
    predicted, _ = core.predicted(rows, np.full(len(rows), measured.time[0]))
    update_tracks(core, predicted, measured, Hypotheses.single(np.zeros(len(rows), np.int32)), sensor, Source.NODE)
    add_score(core, rows, sensor, core.settings.evidence.other_sensor)
    core.count("node_pulled")
    if len(tentative):
        # two kinds of sensor agree on a place and a time, which confirms it at once
        evidence = store.evidence[:, sensor]
        evidence["history"][tentative] = ALL_HITS
        evidence["looks"][tentative] = np.maximum(evidence["looks"][tentative], HISTORY_LOOKS)
        evidence["score"][tentative] = core.settings.evidence.max_score
        core.count("node_confirmed")


def _start(core: Core, events: NodeEvents, event: int, time: float, lane: Floats) -> None:
    site = core.nodes[int(events.node[event])]
    speed = float(events.speed[event])
    knows_speed = math.isfinite(speed) and 0 <= speed < MOST_SPEED
    across = np.outer(_side(lane), _side(lane))
    noise = site.accuracy**2 * np.outer(lane, lane) + core.settings.measurement.lane_sd**2 * across
    prior = unknown_velocity(core, 1)
    if knows_speed:
        along_sd, across_sd = SPEED_SD + speed, SPEED_SD + SPEED_SD_ACROSS * speed
        prior = Prior(
            prior.velocity, (along_sd**2 * np.outer(lane, lane) + across_sd**2 * across)[None], np.ones(1, np.bool_)
        )
    measured = Measured.of(
        np.array([time]), np.array([[site.east, site.north]]), noise[None], speed=speed, sensor=node_sensor(core)
    )
    rows = start_tracks(
        core, measured, prior, node_sensor(core), Source.NODE, bool(events.simulated[event]) or site.simulated,
        head_start=KNOWN_SPEED_HEAD_START if knows_speed else 0,
    )  # fmt: skip
    core.count("node_started", len(rows))
    core.count("node_without_track", int(not len(rows)))


def _side(lane: Floats) -> Floats:
    """The direction across a lane."""
    return np.array([lane[1], -lane[0]])
