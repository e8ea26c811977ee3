"""Targets that go to and fro, for the fake service."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.airport.model import Airport
from pipeline.tables import Source, Tracks


class Mover:
    """One target that goes to and fro along a line."""

    def __init__(self, points: np.ndarray[Any, Any], speed: float, start: float) -> None:
        self.points = points
        self.along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self.speed = speed
        self.start = start

    def at(self, t: float) -> tuple[float, float, float, float]:
        """East, north and velocity at a time."""
        length = float(self.along[-1])
        s = (self.start + self.speed * t) % (2 * length)
        sign = 1.0
        if s > length:
            s, sign = 2 * length - s, -1.0
        leg = min(int(np.searchsorted(self.along, s, side="right")) - 1, len(self.points) - 2)
        a, b = self.points[leg], self.points[leg + 1]
        step = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
        east, north = a + step * (s - self.along[leg])
        velocity = step * self.speed * sign
        return float(east), float(north), float(velocity[0]), float(velocity[1])


def lines_of(airport: Airport, rng: np.random.Generator) -> list[np.ndarray[Any, Any]]:
    """Lines to move on: the taxiways of the airport, else lines beside its runways."""
    edges = [np.asarray(edge[4].coords) for edge in airport.graph.edges if edge[2] > 150]
    if edges:
        return [edges[i] for i in rng.permutation(len(edges))]
    made = []
    for runway in airport.runways:
        for offset in (-180.0, -90.0, 120.0, 200.0):
            made.append(
                np.asarray(runway.centreline.parallel_offset(abs(offset), "left" if offset < 0 else "right").coords)
            )
    return made


def synthetic_tracks(movers: list[Mover], airport: Airport, began: float, now: float) -> Tracks:
    """The tracks of the movers at `now`, UTC s, when they began to move at `began`."""
    t = now - began
    n = len(movers)
    state = np.array([one.at(t) for one in movers]).reshape(n, 4)
    index = np.arange(n)
    vehicle, anonymous = index % 3 == 2, index % 7 == 6
    heading = np.where(np.hypot(state[:, 2], state[:, 3]) > 0.1, np.arctan2(state[:, 2], state[:, 3]), 1.0)
    calls = np.where(vehicle, [f"VEH{i:02d}" for i in index], [f"AFR{100 + i}" for i in index])
    sources = np.where(anonymous, Source.RADAR, Source.RADAR | Source.REPORT)
    return Tracks.build(
        n,
        id=index + 1,
        time=now,
        state=state,
        covariance=np.eye(4) * 4.0,
        phase=np.where((index % 11 == 10) & (int(t) % 20 < 5), 2, 1),
        updated=now,
        born=began,
        hits=int(t) + 5,
        length=np.where(vehicle, 6.0, np.where(index % 4 == 0, 64.0, 38.0)),
        width=np.where(vehicle, 2.5, np.where(index % 4 == 0, 60.0, 34.0)),
        heading=np.where(anonymous, np.nan, heading % (2 * np.pi)),
        altitude=0.0,
        category=np.where(anonymous, 0, np.where(vehicle, 2, 1)),
        address=np.where(anonymous, "", [f"39{i:04x}" for i in index]),
        callsign=np.where(anonymous, "", calls),
        sources=sources,
        simulated=True,
        runway=np.where(index < len(airport.runways), index, -1),
        zone=np.where(len(airport.features) > 0, index % max(len(airport.features), 1), -1),
    )
