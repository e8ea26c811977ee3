"""Node events: something was felt in the pavement at a known place and time."""

from __future__ import annotations

import math

import numpy as np

from pipeline.tables import NodeEventKind, NodeEvents, Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, judge, start, take

LEAST_SPEED = 0.5
"""m/s, below which the sense of a motion along the lane is not believed."""


def take_node_events(core: Core, events: NodeEvents) -> NodeEvents:
    """Each event pulls and confirms the track that it fits best, or starts one. Gives those that were taken."""
    known = (events.node >= 0) & (events.node < len(core.nodes))
    core.count("node_unknown", int((~known).sum()))
    events = events[known]
    events = events[core.in_time(events.time, "node")]
    for event in np.argsort(events.time, kind="stable"):
        _take_one(core, events, int(event))
        core.time = max(core.time, float(events.time[event]))
    judge(core)
    return events


def _take_one(core: Core, events: NodeEvents, event: int) -> None:
    site, time = core.nodes[int(events.node[event])], float(events.time[event])
    table, n = core.table, core.table.n
    lane = np.array([math.sin(site.heading), math.cos(site.heading)])
    dt = time - table.time[:n]
    state, covariance = core.filter.predict(table.state[:n], table.covariance[:n], dt)
    position, noise = _as_measured(core, site.accuracy, lane, state, events.kind[event], (site.east, site.north))
    spread = covariance[:, :2, :2] + noise
    off = position - state[:, :2]
    distance = _squared(off, spread)
    # without a velocity the covariance reaches over half the airport, so what is near has to be near in metres too
    close = (distance <= core.associate.gate) & (np.hypot(off[:, 0], off[:, 1]) <= 0.5 * core.associate.max_gate_m)
    cost = distance + np.log(np.linalg.det(spread)) if n else distance
    cost = cost + np.where(table.phase[:n] == TrackPhase.TENTATIVE, core.settings.tentative_penalty, 0.0)
    if close.any():
        best = int(np.argmin(np.where(close, cost, np.inf)))
        _pull(core, best, time, position[best], noise[best], events.simulated[event])
        return
    _begin(core, events, event, time, lane)


def _as_measured(
    core: Core, accuracy: float, lane: Floats, state: Floats, kind: int, at: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Where the centre of each track would be if it caused the event, and how surely: (n, 2) and (n, 2, 2).

    ARRIVED is felt when the front reaches the node, LEFT when the tail leaves it.
    """
    size = core.extents()
    sense = state[:, 2] * lane[0] + state[:, 3] * lane[1]
    offset = {NodeEventKind.ARRIVED: -0.5, NodeEventKind.LEFT: 0.5}.get(NodeEventKind(min(int(kind), 2)), 0.0)
    shift = np.where(np.abs(sense) > LEAST_SPEED, np.sign(sense), 0.0) * offset * size[:, 0]
    position = np.array(at) + shift[:, None] * lane
    along = accuracy**2 + (0.2 * size[:, 0]) ** 2 + np.where(shift == 0, (0.3 * abs(offset) * 2 * size[:, 0]) ** 2, 0.0)
    across = core.settings.lane_half_width**2 + (0.3 * size[:, 1]) ** 2
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


def _pull(core: Core, row: int, time: float, position: Floats, noise: Floats, simulated: Array) -> None:
    table = core.table
    tentative = table.phase[row] == TrackPhase.TENTATIVE
    rows = np.array([row])
    take(core, rows, np.array([time]), position[None], noise[None], Source.NODE)
    core.count("node_pulled")
    if tentative:
        # two kinds of sensor agree on a place and a time: that is worth all the looks still wanting
        table.history[row] = 0xFFFFFFFF
        table.looks[row] = max(int(table.looks[row]), 32)
        table.score[row] = core.settings.most_score
        core.count("node_confirmed")


def _begin(core: Core, events: NodeEvents, event: int, time: float, lane: Floats) -> None:
    site, table = core.nodes[int(events.node[event])], core.table
    speed = float(events.speed[event])
    knows_speed = math.isfinite(speed) and 0 <= speed < 120
    side = np.array([lane[1], -lane[0]])
    noise = site.accuracy**2 * np.outer(lane, lane) + core.settings.lane_half_width**2 * np.outer(side, side)
    position = np.array([[site.east, site.north]])
    made = start(
        core, np.array([time]), position, noise[None], Source.NODE, bool(events.simulated[event]) or site.simulated,
        head_start=2 if knows_speed else 0,
    )  # fmt: skip
    core.count("node_started", made.stop - made.start)
    core.count("node_without_track", int(made.stop == made.start))
    if knows_speed and made.stop > made.start:
        row = made.start
        # a lane is driven both ways: the speed is known, its sense is not
        velocity = (1.0 + speed) ** 2 * np.outer(lane, lane) + (1.0 + 0.1 * speed) ** 2 * np.outer(side, side)
        table.covariance[row, 2:, 2:] = velocity
        table.one_point[row] = False
