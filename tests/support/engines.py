"""A surface engine over a small airport with made-up sensors, and the envelopes that traffic sends to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.alert.hold_entry import HoldEntry
from pipeline.alert.monitor import AlertMonitor
from pipeline.alert.runway_occupied import RunwayOccupied
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.engine import SurfaceEngine
from pipeline.filter.kalman import Kalman
from pipeline.inputs import Envelope, Tick
from pipeline.lifecycle.score import Score
from pipeline.picture import RunwayState
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents, TargetReports
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import RADAR, T0, Target, line, scan_plots, split_scan
from tests.support.small_airport import small_airport

NODE = NodeSite("N1", -1450.0, -560.0, 2.6, hold="hold-w1")
LATENCY_S = 0.1
"""Every input arrives this long after the time that it is dated."""


def make_engine(radars: int = 1) -> SurfaceEngine:
    airport = small_airport()
    sites = (RADAR,) * radars
    tracker = Tracker(
        airport, sites, (NODE,), filter=Kalman(), associate=GlobalNearestNeighbour(), lifecycle=Score(),
        classify=ExtentSpeed(),
    )  # fmt: skip
    monitor = AlertMonitor(
        airport, (RunwayOccupied(), HoldEntry()), nodes=(NODE,), runways=(RunwayState("06/24", in_use="06"),)
    )
    return SurfaceEngine(airport, sites, (NODE,), tracker, monitor)


TRAFFIC = (
    Target(line(-1500.0, -560.0, 3.0, 2.2), length=38.0, width=36.0),
    Target(line(-100.0, 40.0, 11.0, 6.0), length=8.0, width=4.0),
    Target(line(200.0, 400.0, 0.0, 0.0), length=44.0, width=36.0),
    Target(line(-4500.0, -2290.0, 62.0, 33.0), length=38.0, width=36.0),
)


def reports_of(time: float, **columns: Any) -> TargetReports:
    """One report of the fourth target of TRAFFIC, dated `time`."""
    place = TRAFFIC[3].path(time - T0)
    given = {"time": time, "address": "3944ef", "callsign": "AFR12", "east": place[0], "north": place[1]}
    return TargetReports.build(1, **{**given, "speed": 70.0, "course": 1.08, "category": 1, **columns})


def minute(seed: int = 1, scans: int = 40, sectors: int = 8, false: float = 20.0) -> Iterator[Envelope]:
    """Sectors of one radar, reports once a second, node events and ticks, in the order in which they arrive."""
    for scan in range(scans):
        rng = np.random.default_rng((seed, scan))
        for k, sector in enumerate(split_scan(scan_plots(rng, TRAFFIC, scan, false=false), scan, sectors)):
            arrival = sector.time + LATENCY_S
            yield Envelope(arrival, sector)
            if k == 3:
                yield Envelope(arrival, reports_of(sector.time - 0.02))
            if k == 5 and scan % 7 == 3:
                yield Envelope(arrival, NodeEvents.build(1, time=sector.time - 0.05, node=0, speed=4.0))
            if k % 2:
                yield Envelope(arrival + 0.01, Tick())
