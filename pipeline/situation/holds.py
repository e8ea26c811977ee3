"""Who has passed a holding position towards its runway, and is still between it and the far side."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.runway_frames import HoldFrames
from pipeline.contracts.alert import Entry

Array = NDArray[Any]


@dataclass(frozen=True)
class HoldSettings:
    """step_m: movement that counts as movement. past_m: how far past the bar a track must be.

    node_radius_m, node_speed: a node event belongs to the nearest track within this of the bar, moving towards the
    runway at least this fast (m/s). node_wait_s: an event waits so long for its track. reach_s: an entry that has not
    come into the protection area after so long is forgotten. soon_s: an entry counts when the track is in the area or
    cannot stop before it, and one that a node felt also when it will be in after so long. Behind a holding position
    far out there may be another one, or other ways to go.
    """

    step_m: float = 4.0
    past_m: float = 3.0
    node_radius_m: float = 30.0
    node_speed: float = 1.5
    node_wait_s: float = 3.0
    reach_s: float = 30.0
    soon_s: float = 3.0


@dataclass
class HoldMemory:
    """The state of the watch: where each track was when it last moved, open entries, events that wait for a track."""

    ids: Array = field(default_factory=lambda: np.zeros(0, np.int64))
    anchors: Array = field(default_factory=lambda: np.zeros((0, 2)))
    entries: dict[int, Entry] = field(default_factory=dict)
    waiting: list[tuple[int, float]] = field(default_factory=list)


def watch_holds(
    frames: HoldFrames,
    memory: HoldMemory,
    settings: HoldSettings,
    clock: float,
    ids: Array,
    position: Array,
    velocity: Array,
    depth: Array,
    settled: Array,
    events: tuple[int, ...],
) -> None:
    """Bring `memory` up to date.

    ids (N,), position and velocity (N, 2); depth (R, N): m inside each protection area, negative outside; settled
    (R, N): lined up or leaving, which ends an entry. events: indices of holding positions where a node has just felt
    something.
    """
    beyond, lateral = frames.project(position)
    approach = frames.unit @ velocity.T
    _close(frames, memory, settings, clock, ids, beyond, depth, settled)
    _open_by_movement(frames, memory, settings, clock, ids, position, beyond)
    memory.waiting += [(hold, clock) for hold in events]
    memory.waiting = [
        (hold, since)
        for hold, since in memory.waiting
        if clock - since <= settings.node_wait_s
        and not _open_by_node(memory, settings, hold, since, ids, beyond, lateral, approach)
    ]


def _open_by_movement(
    frames: HoldFrames,
    memory: HoldMemory,
    settings: HoldSettings,
    clock: float,
    ids: Array,
    position: Array,
    beyond: Array,
) -> None:
    anchor = position.copy()
    _, now, then = np.intersect1d(ids, memory.ids, return_indices=True)
    anchor[now] = memory.anchors[then]
    before, side_before = frames.project(anchor)
    _, side = frames.project(position)
    moved = np.hypot(*(position - anchor).T) >= settings.step_m
    crossed = (before < settings.past_m) & (beyond >= settings.past_m) & moved
    # a track that jumps far has not driven over the bar
    crossed &= (np.abs(side) <= frames.half[:, None] + 15) & (np.abs(side_before) <= frames.half[:, None] + 15)
    crossed &= np.hypot(*(position - anchor).T) < 80.0
    for hold, row in zip(*np.nonzero(crossed), strict=True):
        entry = memory.entries.setdefault(int(ids[row]), Entry(int(hold), clock))
        if entry.hold != hold and frames.runway[entry.hold] == frames.runway[hold]:
            # the nearer of two holds on the way to one runway is the one that matters
            entry.hold, entry.since = int(hold), clock
    memory.ids = ids.astype(np.int64)
    memory.anchors = np.where(moved[:, None], position, anchor)


def _open_by_node(
    memory: HoldMemory,
    settings: HoldSettings,
    hold: int,
    since: float,
    ids: Array,
    beyond: Array,
    lateral: Array,
    approach: Array,
) -> bool:
    distance = np.hypot(beyond[hold], lateral[hold])
    distance = np.where(approach[hold] >= settings.node_speed, distance, np.inf)
    if not len(distance) or distance.min() > settings.node_radius_m:
        return False
    entry = memory.entries.setdefault(int(ids[int(distance.argmin())]), Entry(hold, since))
    entry.node = True
    return True


def _close(
    frames: HoldFrames,
    memory: HoldMemory,
    settings: HoldSettings,
    clock: float,
    ids: Array,
    beyond: Array,
    depth: Array,
    settled: Array,
) -> None:
    rows = {int(one): row for row, one in enumerate(ids)}
    for track, entry in list(memory.entries.items()):
        row = rows.get(track)
        runway = int(frames.runway[entry.hold])
        if row is None or settled[runway, row]:
            del memory.entries[track]
            continue
        inside = depth[runway, row] > 0
        entry.reached = entry.reached or bool(inside)
        backed = beyond[entry.hold, row] < -settings.past_m and (not entry.node or clock - entry.since > 5)
        late = clock - entry.since > settings.reach_s
        if (not inside and (entry.reached or late)) or backed:
            del memory.entries[track]
