"""Node events: something was felt in the pavement at a known place and time."""

from __future__ import annotations

import math

import numpy as np

from pipeline.tables import NodeEventKind, NodeEvents, Source, TrackPhase
from pipeline.tables.arrays import Floats
from pipeline.track.core import Core, apply_positions, start_tracks, update_lifecycle

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
    update_lifecycle(core)
    return events


def _apply_event(core: Core, events: NodeEvents, event: int) -> None:
    site, time = core.nodes[int(events.node[event])], float(events.time[event])
    table, n = core.table, core.table.n
    lane = np.array([math.sin(site.heading), math.cos(site.heading)])
    dt = time - table.time[:n]
    state, covariance = core.filter.predict(table.state[:n], table.covariance[:n], dt)
    position, noise = _as_measured(core, site.accuracy, lane, state, events.kind[event], (site.east, site.north))
    spread = covariance[:, :2, :2] + noise
    off = position - state[:, :2]
    distance = _squared(off, spread)
    close = (distance <= core.associate.gate) & (
        np.hypot(off[:, 0], off[:, 1]) <= GATE_SHARE * core.associate.max_gate_m
    )
    cost = distance + np.log(np.linalg.det(spread)) if n else distance
    cost = cost + np.where(table.phase[:n] == TrackPhase.TENTATIVE, core.settings.measurement.tentative_penalty, 0.0)
    if close.any():
        best = int(np.argmin(np.where(close, cost, np.inf)))
        _update_track(core, best, time, position[best], noise[best])
        return
    _start(core, events, event, time, lane)


def _as_measured(
    core: Core, accuracy: float, lane: Floats, state: Floats, kind: int, at: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Where the centre of each track would be if it caused the event, and how surely: (n, 2) and (n, 2, 2).

    ARRIVED is felt when the front reaches the node, LEFT when the tail leaves it.
    """
    size = core.extents()
    sense = state[:, 2] * lane[0] + state[:, 3] * lane[1]
    offset = {NodeEventKind.ARRIVED: -FRONT, NodeEventKind.LEFT: FRONT}.get(NodeEventKind(min(int(kind), 2)), 0.0)
    shift = np.where(np.abs(sense) > LEAST_SPEED, np.sign(sense), 0.0) * offset * size[:, 0]
    position = np.array(at) + shift[:, None] * lane
    unknown_end = (UNKNOWN_END_SD * abs(offset) * 2 * size[:, 0]) ** 2
    along = accuracy**2 + (EXTENT_SD_ALONG * size[:, 0]) ** 2 + np.where(shift == 0, unknown_end, 0.0)
    across = core.settings.measurement.lane_sd**2 + (EXTENT_SD_ACROSS * size[:, 1]) ** 2
    noise = along[:, None, None] * np.outer(lane, lane)
    side = np.array([lane[1], -lane[0]])
    return position, np.asarray(noise + across[:, None, None] * np.outer(side, side))


def _squared(off: Floats, spread: Floats) -> Floats:
    det = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
    top = (
        off[:, 0] ** 2 * spread[:, 1, 1]
        - 2 * off[:, 0] * off[:, 1] * spread[:, 0, 1]
        + off[:, 1] ** 2 * spread[:, 0, 0]
    )
    return np.asarray(top / det)


def _update_track(core: Core, row: int, time: float, position: Floats, noise: Floats) -> None:
    table = core.table
    tentative = table.phase[row] == TrackPhase.TENTATIVE
    rows = np.array([row])
    apply_positions(core, rows, np.array([time]), position[None], noise[None], Source.NODE)
    core.count("node_pulled")
    if tentative:
        # two kinds of sensor agree on a place and a time, which confirms it at once
        table.history[row] = ALL_HITS
        table.looks[row] = max(int(table.looks[row]), HISTORY_LOOKS)
        table.score[row] = core.settings.evidence.max_score
        core.count("node_confirmed")


def _start(core: Core, events: NodeEvents, event: int, time: float, lane: Floats) -> None:
    site, table = core.nodes[int(events.node[event])], core.table
    speed = float(events.speed[event])
    knows_speed = math.isfinite(speed) and 0 <= speed < MOST_SPEED
    side = np.array([lane[1], -lane[0]])
    noise = site.accuracy**2 * np.outer(lane, lane) + core.settings.measurement.lane_sd**2 * np.outer(side, side)
    position = np.array([[site.east, site.north]])
    made = start_tracks(
        core, np.array([time]), position, noise[None], Source.NODE, bool(events.simulated[event]) or site.simulated,
        head_start=KNOWN_SPEED_HEAD_START if knows_speed else 0,
    )  # fmt: skip
    core.count("node_started", made.stop - made.start)
    core.count("node_without_track", int(made.stop == made.start))
    if knows_speed and made.stop > made.start:
        row = made.start
        along, across = (SPEED_SD + speed) ** 2, (SPEED_SD + SPEED_SD_ACROSS * speed) ** 2
        table.covariance[row, 2:, 2:] = along * np.outer(lane, lane) + across * np.outer(side, side)
        table.velocity_unknown[row] = False
