"""The tracker's workload for the bench: a thousand targets and 180 false plots a turn, or more at the same density."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, SurfaceKind, TaxiGraph
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.sites import RadarSite
from pipeline.tables import Plots, SectorPlots, VideoFormat, mark_row, marks_between
from pipeline.tables.arrays import Array, Floats
from pipeline.track.tracker import Tracker

EPOCH = 1.7e9
"""UTC s at which the turns begin."""

HALF = 3000.0
"""m, half the side of the square on which a thousand targets move."""

TARGETS, FALSE_PLOTS = 1000, 180.0
"""On that square: targets, and false plots a turn."""

RANGE_STEP = 6.0
"""m between range cells of the radar, in the middle of the field."""


TAXIWAY = int(SurfaceKind.TAXIWAY)


class _Pavement:
    """The whole bench field is a taxiway."""

    def zone(self, east: Any, north: Any) -> Array:
        return np.zeros(len(east), np.int32)

    def runway(self, east: Any, north: Any) -> Array:
        return np.full(len(east), -1, np.int16)

    def kind(self, east: Any, north: Any) -> Array:
        return np.full(len(east), TAXIWAY, np.uint8)


class Field:
    """Moving targets on a square, some at rest, some fast; plots with misses and false ones. Seeded.

    The square grows with the targets, so that targets and false plots a square metre stay the same; `half` m is half
    its side. `site` is a radar that covers it.
    """

    def __init__(self, targets: int = TARGETS, detection: float = 0.97, seed: int = 1) -> None:
        self.targets = targets
        self.half = HALF * math.sqrt(targets / TARGETS)
        ranges = 64 * math.ceil(2 * self.half / RANGE_STEP / 64)  # 2 halves reach past the corners, at 1.41
        self.site = RadarSite("bench", 0.0, 0.0, 22.0, VideoFormat(ranges=ranges, range_step_m=RANGE_STEP))
        self._false = FALSE_PLOTS * targets / TARGETS
        self._detection = detection
        self._rng = np.random.default_rng(seed)
        self._place = self._rng.uniform(-self.half, self.half, (targets, 2))
        speed = self._rng.choice([0.0, 5.0, 10.0, 15.0, 70.0], targets, p=[0.4, 0.25, 0.2, 0.1, 0.05])
        course = self._rng.uniform(0, 2 * np.pi, targets)
        self._velocity = speed[:, None] * np.stack([np.sin(course), np.cos(course)], axis=1)
        self._length = self._rng.choice([6.0, 12.0, 38.0, 60.0], targets)

    def scan(self, turn: int) -> Plots:
        """The plots of one turn, in order of time."""
        place, velocity, rng = self._place, self._velocity, self._rng
        passed: Floats = np.full(len(place), turn + 0.5)
        for _ in range(3):
            where = place + velocity * passed[:, None]
            passed = turn + np.arctan2(where[:, 0], where[:, 1]) % (2 * np.pi) / (2 * np.pi)
        seen = (rng.random(len(place)) < self._detection) & (np.hypot(*where.T) < 1.8 * self.half)
        false = rng.uniform(-self.half, self.half, (rng.poisson(self._false), 2))
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

    def sectors(self, turn: int, count: int) -> list[SectorPlots]:
        """The next turn's plots in so many sectors of equal width, with the azimuth marks of their rows."""
        plots, rows = self.scan(turn), self.site.video.azimuths
        sector = plots.azimuth / (2 * np.pi) * count
        made = []
        for k in range(count):
            low, high = (turn * rows + rows * edge // count for edge in (k, k + 1))
            mark = marks_between(low, high, rows)
            made.append(
                SectorPlots(
                    0,
                    turn,
                    EPOCH + turn + (k + 1) / count,
                    low,
                    high,
                    plots[(sector >= k) & (sector < k + 1)],
                    mark=mark,
                    mark_time=EPOCH + mark_row(mark, rows) / rows,
                )
            )
        return made


def make_bench_tracker(site: RadarSite, capacity: int = 2048) -> Tracker:
    """A tracker with the default parts on an empty field. Raises ValueError when it cannot hold so many tracks."""
    airport = Airport("BENC", "bench", LocalFrame(0.0, 0.0), (), (), (), TaxiGraph((), ()))
    return Tracker(
        airport,
        (site,),
        (),
        filter=Kalman(),
        associate=GlobalNearestNeighbour(),
        lifecycle=Score(),
        classify=ExtentSpeed(),
        capacity=capacity,
        zones=_Pavement(),
    )
