"""What two engines made of the same inputs: how the tracks and the alerts of one differ from those of the other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from pipeline.picture import AlertChange
from pipeline.tables import TrackPhase, Tracks
from pipeline.tables.arrays import Array, Bools, Floats

SAME_TARGET_M = 20.0
"""Tracks of both pictures that are each other's nearest within this are the same target: half a large aircraft."""

SAME_ALERT_S = 10.0
"""Alerts of one rule on one runway that are raised within this of each other are the same alert."""


@dataclass(frozen=True)
class RaisedAlert:
    """An alert when it was raised. time: UTC s. targets: what its targets are called."""

    time: float
    rule: str
    runway: str
    stage: str
    targets: tuple[str, ...]


@dataclass(frozen=True)
class Figure:
    """One line of the comparison."""

    name: str
    recorded: float
    replayed: float
    unit: str = ""


@dataclass
class _Side:
    """What one engine showed."""

    rows: int = 0
    coasting: int = 0
    unmatched: int = 0
    seen: set[tuple[int, float]] = field(default_factory=set)
    alerts: list[RaisedAlert] = field(default_factory=list)

    @property
    def alarms(self) -> int:
        """Alerts that were alarms when they were raised."""
        return sum(one.stage == "alarm" for one in self.alerts)

    def add(self, tracks: Tracks, matched: Bools) -> None:
        self.rows += len(tracks)
        self.coasting += int((tracks.phase == TrackPhase.COASTING).sum())
        self.unmatched += int((~matched).sum())
        self.seen.update(zip(tracks.id.tolist(), tracks.born.tolist(), strict=True))


class PictureComparison:
    """Adds up pictures in pairs; `figures` and `alerts` say what came of them."""

    def __init__(self) -> None:
        self.pictures = 0
        self.recorded, self.replayed = _Side(), _Side()
        self._apart: list[Floats] = []
        self._renumbered = 0

    def add(self, recorded: Tracks, replayed: Tracks) -> None:
        """Take the tracks of the same moment from both."""
        self.pictures += 1
        one, other = matched(recorded, replayed)
        mask, counterpart = np.zeros(len(recorded), np.bool_), np.zeros(len(replayed), np.bool_)
        mask[one] = counterpart[other] = True
        self.recorded.add(recorded, mask)
        self.replayed.add(replayed, counterpart)
        self._apart.append(np.hypot(*(recorded.state[one, :2] - replayed.state[other, :2]).T))
        self._renumbered += int((recorded.id[one] != replayed.id[other]).sum())

    def changes(self, recorded: Iterable[AlertChange], replayed: Iterable[AlertChange]) -> None:
        """Take the alert changes of the same input from both."""
        for side, changes in ((self.recorded, recorded), (self.replayed, replayed)):
            side.alerts += [raised(change) for change in changes if change.operation == "raise"]

    def figures(self) -> tuple[Figure, ...]:
        """The comparison in numbers."""
        a, b, n = self.recorded, self.replayed, max(self.pictures, 1)
        apart = np.concatenate(self._apart) if self._apart else np.zeros(0)
        far = float(np.quantile(apart, 0.95)) if len(apart) else 0.0
        number = self._renumbered / max(len(apart), 1)
        return (
            Figure("tracks in a picture", a.rows / n, b.rows / n),
            Figure("different tracks", len(a.seen), len(b.seen)),
            Figure("tracks coasting", a.coasting / max(a.rows, 1), b.coasting / max(b.rows, 1)),
            Figure("tracks that the other has not", a.unmatched / max(a.rows, 1), b.unmatched / max(b.rows, 1)),
            Figure("same target, distance, 95 %", 0.0, far, "m"),
            Figure("same target, other number", 0.0, number),
            Figure("alerts raised", len(a.alerts), len(b.alerts)),
            Figure("of these alarms", a.alarms, b.alarms),
        )

    def alerts(self) -> tuple[list[RaisedAlert], list[RaisedAlert]]:
        """The alerts that only the recorded engine raised, and those that only the replaying one did."""
        return alone(self.recorded.alerts, self.replayed.alerts), alone(self.replayed.alerts, self.recorded.alerts)


def matched(one: Tracks, other: Tracks) -> tuple[Array, Array]:
    """Rows of both tables (k,), (k,) that are each other's nearest within SAME_TARGET_M."""
    if not len(one) or not len(other):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    first, second = KDTree(one.state[:, :2]), KDTree(other.state[:, :2])
    found, counterpart = second.query(one.state[:, :2]), first.query(other.state[:, :2])
    away, there, back = np.asarray(found[0]), np.asarray(found[1]), np.asarray(counterpart[1])
    rows = np.flatnonzero((away <= SAME_TARGET_M) & (back[there] == np.arange(len(one))))
    return rows, there[rows]


def raised(change: AlertChange) -> RaisedAlert:
    """An alert as it was raised."""
    alert = change.alert
    names = tuple(target.callsign or f"{target.category} {target.number or target.track}" for target in alert.targets)
    return RaisedAlert(change.time, alert.rule, alert.runway or "", alert.stage, names)


def alone(alerts: list[RaisedAlert], others: list[RaisedAlert]) -> list[RaisedAlert]:
    """The alerts that have no counterpart among the others; each counterpart serves one alert."""
    left, found = list(others), []
    for one in alerts:
        near = [
            it
            for it in left
            if (it.rule, it.runway) == (one.rule, one.runway) and abs(it.time - one.time) <= SAME_ALERT_S
        ]
        if near:
            left.remove(min(near, key=lambda it: abs(it.time - one.time)))
        else:
            found.append(one)
    return found
