"""The tracker's workload for the bench: 1000 targets, about 1150 plots a turn, at 1 Hz."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, SurfaceKind, TaxiGraph
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.associate import Expected, Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.sites import RadarSite
from pipeline.tables import Plots, SectorPlots, VideoFormat
from pipeline.tables.arrays import Array, Floats
from pipeline.track.tracker import Tracker

EPOCH = 1.7e9
SITE = RadarSite("bench", 0.0, 0.0, 22.0, VideoFormat(range_step_m=6.0))
HALF = 3000.0


class _Pavement:
    """The whole bench field is a taxiway."""

    def zone(self, east: Any, north: Any) -> Array:
        return np.zeros(len(east), np.int32)

    def runway(self, east: Any, north: Any) -> Array:
        return np.full(len(east), -1, np.int16)

    def kind(self, east: Any, north: Any) -> Array:
        return np.full(len(east), SurfaceKind.TAXIWAY, np.uint8)


@dataclass(frozen=True)
class TrackerTimes:
    """Seconds a turn of the radar, median (least in brackets where printed): filterpy is None when not asked for.

    filter: predict and update of all tracks. associate: gate and assign. scan, scan_32: the whole tracker, given a
    turn as one sector and as 32. tracks: making the table of reported tracks. held: tracks reported at the end.
    """

    targets: int
    plots: int
    held: int
    filter: float
    associate: float
    scan: float
    scan_32: float
    tracks: float
    filterpy: float | None

    def lines(self) -> Sequence[str]:
        """The figures as text, one a line."""
        rows = [
            ("filter, predict + update", self.filter),
            ("associate, gate + assign", self.associate),
            ("whole tracker, one sector a scan", self.scan),
            ("whole tracker, 32 sectors a scan", self.scan_32),
            ("table of reported tracks", self.tracks),
        ]
        made = [f"{self.targets} targets, {self.plots} plots a scan, {self.held} tracks held"]
        made += [f"{what:<36}{1e3 * seconds:9.3f} ms" for what, seconds in rows]
        if self.filterpy is not None:
            made.append(f"{'filterpy KalmanFilter, one an object':<36}{1e3 * self.filterpy:9.3f} ms")
            made.append(f"{'  that is, times our filter':<36}{self.filterpy / self.filter:9.0f}")
        return made


class Field:
    """Moving targets on a square of 6 km, some at rest, some fast; plots with misses and false ones. Seeded."""

    def __init__(self, targets: int = 1000, false: int = 180, detection: float = 0.97, seed: int = 1) -> None:
        self._rng = np.random.default_rng(seed)
        self._place = self._rng.uniform(-HALF, HALF, (targets, 2))
        speed = self._rng.choice([0.0, 5.0, 10.0, 15.0, 70.0], targets, p=[0.4, 0.25, 0.2, 0.1, 0.05])
        course = self._rng.uniform(0, 2 * np.pi, targets)
        self._velocity = speed[:, None] * np.stack([np.sin(course), np.cos(course)], axis=1)
        self._length = self._rng.choice([6.0, 12.0, 38.0, 60.0], targets)
        self._false, self._detection = false, detection

    def scan(self, turn: int) -> Plots:
        """The plots of one turn, in order of time."""
        place, velocity, rng = self._place, self._velocity, self._rng
        passed: Floats = np.full(len(place), turn + 0.5)
        for _ in range(3):
            where = place + velocity * passed[:, None]
            passed = turn + np.arctan2(where[:, 0], where[:, 1]) % (2 * np.pi) / (2 * np.pi)
        seen = (rng.random(len(place)) < self._detection) & (np.hypot(*where.T) < 5500)
        false = rng.uniform(-HALF, HALF, (rng.poisson(self._false), 2))
        spot = np.concatenate([where[seen] + rng.normal(0, 2.0, (int(seen.sum()), 2)), false])
        azimuth = np.arctan2(spot[:, 0], spot[:, 1]) % (2 * np.pi)
        time = np.concatenate([passed[seen], turn + azimuth[int(seen.sum()) :] / (2 * np.pi)])
        length = np.concatenate([self._length[seen], np.full(len(false), 3.0)])
        order = np.argsort(time)
        return Plots.build(
            len(spot),
            time=EPOCH + time[order],
            east=spot[order, 0],
            north=spot[order, 1],
            covariance=4.0 * np.eye(2),
            range=np.hypot(*spot[order].T),
            azimuth=azimuth[order],
            range_extent=length[order],
            azimuth_extent=0.01,
            length=length[order],
            width=0.8 * length[order],
            cells=20,
            mean_amplitude=80.0,
            peak_amplitude=120.0,
        )


def make_bench_tracker() -> Tracker:
    """A tracker with the default parts on an empty field."""
    airport = Airport("BENC", "bench", LocalFrame(0.0, 0.0), (), (), (), TaxiGraph((), ()))
    return Tracker(
        airport,
        (SITE,),
        (),
        filter=Kalman(),
        associate=GlobalNearestNeighbour(),
        lifecycle=Score(),
        classify=ExtentSpeed(),
        zones=_Pavement(),
    )


def bench_tracker(
    clock: Callable[[], float], targets: int = 1000, scans: int = 30, compare: bool = True, seed: int = 1
) -> TrackerTimes:
    """Time the tracker and its parts. clock: a steady clock in seconds. compare: also filterpy, one object a track."""
    whole, held, plots, tracks = _whole(clock, targets, scans, 1, seed)
    parts, *_ = _whole(clock, targets, scans, 32, seed)
    filtering, associating = _parts(clock, targets, scans, seed)
    return TrackerTimes(
        targets=targets,
        plots=plots,
        held=held,
        filter=filtering,
        associate=associating,
        scan=whole,
        scan_32=parts,
        tracks=tracks,
        filterpy=_filterpy(clock, targets) if compare else None,
    )


def _whole(
    clock: Callable[[], float], targets: int, scans: int, sectors: int, seed: int
) -> tuple[float, int, int, float]:
    tracker, field = make_bench_tracker(), Field(targets, seed=seed)
    tracker.warm()
    a = SITE.video.azimuths
    spent, looking, counts = [], [], []
    for turn in range(scans):
        plots = field.scan(turn)
        own = plots.azimuth / (2 * np.pi) * sectors
        work = [
            SectorPlots(0, turn, EPOCH + turn + (k + 1) / sectors, turn * a + a * k // sectors,
                        turn * a + a * (k + 1) // sectors, plots[(own >= k) & (own < k + 1)])
            for k in range(sectors)
        ]  # fmt: skip
        begin = clock()
        for sector in work:
            tracker.sector(sector)
        spent.append(clock() - begin)
        begin = clock()
        reported = tracker.tracks()
        looking.append(clock() - begin)
        counts.append(len(plots))
    settled = scans // 3
    return float(np.median(spent[settled:])), len(reported), int(np.median(counts)), float(np.median(looking[settled:]))


def _parts(clock: Callable[[], float], targets: int, scans: int, seed: int) -> tuple[float, float]:
    kalman, associate = Kalman(), GlobalNearestNeighbour()
    rng = np.random.default_rng(seed)
    plots = Field(targets, seed=seed).scan(0)
    state = np.zeros((targets, 4))
    state[:, :2] = rng.uniform(-HALF, HALF, (targets, 2))
    real = min(targets, len(plots))
    state[:real, 0], state[:real, 1] = plots.east[:real] + 1.0, plots.north[:real] - 1.0
    covariance = np.tile(np.diag([4.0, 4.0, 2.0, 2.0]), (targets, 1, 1))
    at = np.full(targets, EPOCH + 0.5)
    extent = np.tile([12.0, 9.0, 0.0], (targets, 1))
    expected = Expected(at, state, covariance, np.full(targets, 1.0), extent, np.zeros(targets))
    measured = Measured(plots.time, np.stack([plots.east, plots.north], axis=1), plots.covariance)
    dt, noise = np.ones(targets), np.tile(4.0 * np.eye(2), (targets, 1, 1))
    position: Floats = state[:, :2] + rng.normal(0, 2, (targets, 2))
    filtering, associating = [], []
    for _ in range(scans):
        begin = clock()
        predicted = kalman.predict(state, covariance, dt)
        kalman.update(*predicted, np.zeros(targets), position, noise)
        middle = clock()
        associate(expected, measured)
        filtering.append(middle - begin)
        associating.append(clock() - middle)
    return float(np.median(filtering[1:])), float(np.median(associating[1:]))


def _filterpy(clock: Callable[[], float], targets: int) -> float:
    """The same predict and update by one filterpy object a track."""
    from filterpy.common import Q_continuous_white_noise
    from filterpy.kalman import KalmanFilter

    objects = []
    for _ in range(targets):
        one = KalmanFilter(dim_x=4, dim_z=2)
        one.F = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
        one.H = np.eye(2, 4)
        one.Q = Q_continuous_white_noise(2, 1.0, 1.0, block_size=2, order_by_dim=False)
        one.R = 4.0 * np.eye(2)
        objects.append(one)
    spent = []
    for _ in range(3):
        begin = clock()
        for one in objects:
            one.predict()
            one.update(np.array([1.0, 2.0]))
        spent.append(clock() - begin)
    return float(np.median(spent))
