"""True motions and what a radar makes of them: a small scene generator for the tests of the tracker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, SurfaceKind, TaxiGraph
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import Plots, SectorPlots, VideoFormat, mark_row, marks_between
from pipeline.track.tracker import Tracker

T0 = 1_700_000_000.0
RADAR = RadarSite("smr", 0.0, 0.0, 22.0, VideoFormat(range_step_m=4.0))
A = RADAR.video.azimuths
AIRPORT = Airport("TEST", "Test", LocalFrame(48.7, 2.4), (), (), (), TaxiGraph((), ()))


@dataclass(frozen=True)
class FlatZones:
    """Everything is of one kind, but for a square building around (1000, 1000)."""

    surface: SurfaceKind = SurfaceKind.TAXIWAY

    def zone(self, east: Any, north: Any) -> NDArray[np.int32]:
        return np.where(np.asarray(north) > 0, 3, -1).astype(np.int32)

    def runway(self, east: Any, north: Any) -> NDArray[np.int16]:
        return np.where(np.abs(north) < 30, 0, -1).astype(np.int16)

    def kind(self, east: Any, north: Any) -> NDArray[np.uint8]:
        built = (np.abs(np.asarray(east) - 1000) < 50) & (np.abs(np.asarray(north) - 1000) < 50)
        return np.where(built, SurfaceKind.BUILDING, self.surface).astype(np.uint8)


@dataclass(frozen=True)
class Target:
    """path: time since T0 -> (east, north). hidden: times since T0 at which it is not detected. fragments: how many
    plots it falls into.
    """

    path: Callable[[float], tuple[float, float]]
    length: float = 0.0
    width: float = 0.0
    detection: float = 1.0
    born: float = 0.0
    gone: float = np.inf
    hidden: tuple[tuple[float, float], ...] = ()
    fragments: Callable[[int], int] = lambda scan: 1

    def course(self, t: float) -> float:
        e, n = np.subtract(self.path(t + 0.05), self.path(t - 0.05))
        return float(np.arctan2(e, n)) if np.hypot(e, n) > 1e-3 else 0.0


def line(east: float, north: float, v_east: float, v_north: float) -> Callable[[float], tuple[float, float]]:
    return lambda t: (east + v_east * t, north + v_north * t)


def crossing(
    path: Callable[[float], tuple[float, float]], scan: int, site: RadarSite = RADAR, phase: float = 0.0
) -> float:
    """Time since T0 at which the beam of turn `scan` passes the target. phase: s since T0 at which turn 0 begins."""
    period = site.video.period_s
    t = phase + (scan + 0.5) * period
    for _ in range(6):
        e, n = path(t)
        t = phase + (scan + np.arctan2(e - site.east, n - site.north) % (2 * np.pi) / (2 * np.pi)) * period
    return float(t)


def make_plots(time: Any, position: Any, sd: float, site: RadarSite = RADAR, **columns: Any) -> Plots:
    position = np.asarray(position, float).reshape(-1, 2)
    away = position - (site.east, site.north)
    given: dict[str, Any] = {
        "range_extent": 8.0, "azimuth_extent": 0.01, "cells": 12, "mean_amplitude": 80.0, "peak_amplitude": 120.0,
    }  # fmt: skip
    return Plots.build(
        len(position),
        time=time,
        east=position[:, 0],
        north=position[:, 1],
        covariance=sd**2 * np.eye(2),
        range=np.hypot(*away.T),
        azimuth=np.arctan2(away[:, 0], away[:, 1]) % (2 * np.pi),
        **(given | columns),
    )


def scan_plots(
    rng: np.random.Generator, targets: Sequence[Target], scan: int, sd: float = 2.0, false: float = 0.0,
    half: float = 3000.0, site: RadarSite = RADAR, phase: float = 0.0,
) -> Plots:  # fmt: skip
    """All plots of one turn; random false ones, `false` on average, over a square of 2 `half`.

    phase: s since T0 at which turn 0 of this radar begins.
    """
    time, place, length, width, bearing = [], [], [], [], []
    for one in targets:
        t = crossing(one.path, scan, site, phase)
        seen = rng.random() < one.detection
        noise = rng.normal(0, sd, 2)
        if not seen or not one.born <= t < one.gone or any(a <= t < b for a, b in one.hidden):
            continue
        fragments, course = one.fragments(scan), one.course(t)
        along = np.array([np.sin(course), np.cos(course)])
        for fragment in range(fragments):
            offset = ((fragment + 0.5) / fragments - 0.5) * one.length * along
            time.append(T0 + t)
            place.append(np.array(one.path(t)) + offset + noise)
            length.append(one.length / fragments)
            width.append(one.width)
            bearing.append(course % np.pi)
    for _ in range(rng.poisson(false)):
        e, n = rng.uniform(-half, half, 2)
        time.append(T0 + crossing(lambda t, e=e, n=n: (e, n), scan, site, phase))  # type: ignore[misc]
        place.append(np.array([e, n]))
        length.append(0.0)
        width.append(0.0)
        bearing.append(np.nan)
    plots = make_plots(
        np.array(time), np.array(place), sd, site, length=np.array(length), width=np.array(width),
        bearing=np.array(bearing), bearing_sd=0.1,
    )  # fmt: skip
    # noise may carry a plot across north, into another turn than that of its time: such a one is not seen
    turns = (plots.time - T0 - phase) / site.video.period_s - scan
    return plots[np.abs(turns - plots.azimuth / (2 * np.pi)) < 0.5]


def row_time(row: Any, site: RadarSite = RADAR, phase: float = 0.0) -> Any:
    """UTC s at which the antenna is at the absolute row: it turns evenly, turn 0 begins `phase` s after T0."""
    return T0 + (phase + np.asarray(row) / site.video.azimuths * site.video.period_s)


def marks(low: int, high: int, site: RadarSite = RADAR, phase: float = 0.0) -> dict[str, Any]:
    """The columns of a block that tell which azimuth marks lie in its rows [low, high).

    The time of a mark follows from its number alone, so that every cut of a turn into blocks tells the same bits.
    """
    number = marks_between(low, high, site.video.azimuths)
    return {"mark": number, "mark_time": row_time(mark_row(number, site.video.azimuths), site, phase)}


def block(
    plots: Plots, scan: int, low: int, high: int, site: RadarSite = RADAR, radar: int = 0, phase: float = 0.0
) -> SectorPlots:
    """The block of turn `scan` between two of its rows, with those of the turn's plots whose centroid lies in it."""
    a = site.video.azimuths
    own = plots.azimuth % (2 * np.pi) / (2 * np.pi) * a
    first, last = scan * a + low, scan * a + high
    inside = plots[(own >= low) & (own < high)]
    time = float(row_time(last, site, phase))
    return SectorPlots(radar, scan, time, first, last, inside, **marks(first, last, site, phase))


def split_scan(
    plots: Plots, scan: int, sectors: int, site: RadarSite = RADAR, radar: int = 0, phase: float = 0.0
) -> list[SectorPlots]:
    """The same turn as equal sectors; a plot comes with the sector in which its centroid is closed."""
    ends = [site.video.azimuths * k // sectors for k in range(sectors + 1)]
    return [block(plots, scan, low, high, site, radar, phase) for low, high in pairwise(ends)]


def make_tracker(nodes: Sequence[NodeSite] = (), radars: Sequence[RadarSite] = (RADAR,), **words: Any) -> Tracker:
    given: dict[str, Any] = {
        "filter": Kalman(), "associate": GlobalNearestNeighbour(), "lifecycle": Score(), "classify": ExtentSpeed(),
        "zones": FlatZones(),
    }  # fmt: skip
    return Tracker(AIRPORT, radars, nodes, **(given | words))


def run(
    tracker: Tracker, targets: Sequence[Target], scans: int, *, seed: int = 1, sectors: int = 8, first: int = 0,
    watch: Callable[[int], None] | None = None, **words: Any,
) -> Tracker:  # fmt: skip
    """Feed turns first .. first + scans; `watch(scan)` after each."""
    for scan in range(first, first + scans):
        rng = np.random.default_rng((seed, scan))
        for sector in split_scan(scan_plots(rng, targets, scan, **words), scan, sectors):
            tracker.sector(sector)
        if watch is not None:
            watch(scan)
    return tracker


def truth_at(target: Target, time: Any) -> NDArray[np.float64]:
    return np.array([target.path(float(t) - T0) for t in np.atleast_1d(time)])


def assert_same_store(one: dict[str, Any], other: dict[str, Any]) -> None:
    """Two saved stores are alike to the last bit, all kinds of records."""
    assert one.keys() == other.keys()
    assert one["last_uid"] == other["last_uid"]
    np.testing.assert_array_equal(one["time"], other["time"])
    for kind in ("rows", "filter", "evidence", "look"):
        assert one[kind].keys() == other[kind].keys()
        for name, column in one[kind].items():
            np.testing.assert_array_equal(column, other[kind][name], err_msg=f"{kind} {name}")
