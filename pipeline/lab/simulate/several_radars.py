"""Plots of up to three radars that look at one taxiway area; buildings can hide the area from all but the first.

Made without radar video: each look finds a target with a given probability, and false plots come by chance. Seeded.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, Feature, TaxiGraph
from pipeline.sites import RadarSite
from pipeline.tables import Plots, SectorPlots, VideoFormat
from pipeline.tables.arrays import Array, Floats

EPOCH = 1.7e9
"""UTC s at which the targets appear; the antennas are turning by then."""

SPEEDS_MPS = (0.0, 4.0, 25.0)
"""Standing, taxiing slowly, leaving a runway."""

HALF_EAST_M, LANE_M = 1000.0, 40.0
"""Half the length of the area, and the distance between two targets' lanes: farther than the gate of a track whose
velocity is known, so that targets are not exchanged."""

LENGTH_M, WIDTH_M, CELLS = 12.0, 6.0, 12
"""What a plot says of its target, m and detected cells: those of a large vehicle."""

FALSE_CELLS = 3
"""Detected cells of a false plot, which is small."""

RANGE_STEP_M = 3.5
"""Range cell: 1024 of them reach the farthest corner of the area from every radar, at 3,203 m."""

PLACES_M = ((0.0, 1300.0), (-1700.0, 900.0), (1700.0, -900.0))
"""East and north of the radars. From none of them does the area lie due north, so a target is passed once a turn."""

CROSSING_STEPS = 6
"""Steps of the fixed point that finds when a beam passes a target; each is more exact by the ratio of the target's
speed to that of the beam, below 0.2."""


@dataclass(frozen=True)
class Shadow:
    """What a building hides from a radar: azimuths `first` to `last` rad (not through north), beyond `distance` m."""

    first: float
    last: float
    distance: float


SHADOWS = (
    None,
    Shadow(math.radians(95.0), math.radians(165.0), 300.0),
    Shadow(math.radians(275.0), math.radians(345.0), 300.0),
)
"""Where buildings stand in the sight of each radar; they cover the whole area."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets that move along straight lines from EPOCH on. start: (n, 2) m. velocity: (n, 2) m/s."""

    start: Floats
    velocity: Floats

    def place(self, time: Floats | float) -> Floats:
        """(..., n, 2) m at UTC s `time` (..., n) or a number."""
        passed = np.asarray(time, np.float64) - EPOCH
        return np.asarray(self.start + self.velocity * passed[..., None])


@dataclass(frozen=True, eq=False)
class Seen:
    """Plots of one radar in order of time. target: (n,) index of the target of each, -1 for a false plot."""

    plots: Plots
    target: Array


@dataclass(frozen=True)
class Antenna:
    """A radar and how its antenna turns. phase: fraction of a turn that is over at EPOCH; 0 is north."""

    site: RadarSite
    phase: float

    def begin(self, turn: Array | int) -> Floats:
        """UTC s at which a turn starts in the north; turn 0 has started at EPOCH."""
        return np.asarray(EPOCH + (np.asarray(turn) - self.phase) * self.site.video.period_s)


@dataclass(frozen=True)
class Looking:
    """How radars see. detection: probability a look. noise_m: standard deviation of each coordinate.

    false_plots: a turn and radar, over the area and a margin about it, on average.
    """

    detection: float = 0.95
    noise_m: float = 2.0
    false_plots: float = 4.0


def make_airport(lanes: int) -> Airport:
    """An airport that is one taxiway area of so many lanes, with a margin of 500 m about it."""
    half = _half_north(lanes)
    area = shapely.box(-HALF_EAST_M - 500.0, -half - 500.0, HALF_EAST_M + 500.0, half + 500.0)
    feature = Feature("area", "TaxiwayElement", "area", area)
    return Airport("RCOV", "radar coverage", LocalFrame(0.0, 0.0), (), (), (feature,), TaxiGraph((), ()))


def make_antennas(chance: np.random.Generator, periods_s: Sequence[float]) -> tuple[Antenna, ...]:
    """Radars of these periods, up to three, each with a phase by chance."""
    return tuple(
        Antenna(
            RadarSite(f"radar {k + 1}", *PLACES_M[k], 30.0, VideoFormat(range_step_m=RANGE_STEP_M, period_s=period)),
            float(chance.uniform()),
        )
        for k, period in enumerate(periods_s)
    )


def make_targets(chance: np.random.Generator, each: int, seconds: float) -> Targets:
    """`each` targets of each of SPEEDS_MPS, one a lane, that stay in the area for so many seconds."""
    n = each * len(SPEEDS_MPS)
    speed = np.tile(SPEEDS_MPS, each)
    sense = chance.choice([-1.0, 1.0], n)
    room = HALF_EAST_M - np.minimum(0.5 * speed * seconds, HALF_EAST_M)
    middle = chance.uniform(-room, room)
    north = np.arange(n) * LANE_M - _half_north(n)
    start = np.stack([middle - sense * 0.5 * speed * seconds, north], axis=1)
    return Targets(start, np.stack([sense * speed, np.zeros(n)], axis=1))


def observe(chance: np.random.Generator, antenna: Antenna, targets: Targets, seconds: float, looking: Looking) -> Seen:
    """What a radar sees of the targets for so many seconds where no building stands, and its false plots."""
    video, n = antenna.site.video, len(targets.start)
    turns = np.arange(math.ceil(seconds / video.period_s) + 1)
    begin = antenna.begin(turns)
    time = np.repeat(begin[:, None], n, axis=1)
    for _ in range(CROSSING_STEPS):
        time = begin[:, None] + _azimuth(antenna.site, targets.place(time)) / (2 * np.pi) * video.period_s
    found = chance.random(time.shape) < looking.detection
    place = (targets.place(time) + chance.normal(0.0, looking.noise_m, (*time.shape, 2)))[found]
    target = np.broadcast_to(np.arange(n), time.shape)[found]
    turn = np.broadcast_to(turns[:, None], time.shape)[found]
    count = chance.poisson(looking.false_plots, len(turns))
    half = np.array([HALF_EAST_M + 300.0, _half_north(n) + 300.0])
    false = chance.uniform(-half, half, (int(count.sum()), 2))
    place = np.concatenate([place, false])
    target = np.concatenate([target, np.full(len(false), -1)])
    turn = np.concatenate([turn, np.repeat(turns, count)])
    azimuth = _azimuth(antenna.site, place)
    time = antenna.begin(turn) + azimuth / (2 * np.pi) * video.period_s
    order = np.argsort(time, kind="stable")
    order = order[(time[order] >= EPOCH) & (time[order] < EPOCH + seconds)]
    place, target, turn = place[order], target[order], turn[order]
    real = target >= 0
    plots = Plots.build(
        len(order),
        time=time[order],
        scan=turn,
        east=place[:, 0],
        north=place[:, 1],
        covariance=looking.noise_m**2 * np.eye(2),
        range=np.hypot(place[:, 0] - antenna.site.east, place[:, 1] - antenna.site.north),
        azimuth=azimuth[order],
        range_extent=np.where(real, LENGTH_M, RANGE_STEP_M),
        azimuth_extent=video.beamwidth_rad,
        length=np.where(real, LENGTH_M, RANGE_STEP_M),
        width=np.where(real, WIDTH_M, RANGE_STEP_M),
        cells=np.where(real, CELLS, FALSE_CELLS),
        mean_amplitude=80.0,
        peak_amplitude=120.0,
    )
    return Seen(plots, target)


def behind(seen: Seen, targets: Targets, site: RadarSite, shadow: Shadow) -> Seen:
    """What is left of it when a building stands there: no plot of a target in its shadow. False plots stay."""
    plots = seen.plots
    there = targets.start[seen.target] + targets.velocity[seen.target] * (plots.time - EPOCH)[:, None]
    azimuth, away = _azimuth(site, there), np.hypot(there[:, 0] - site.east, there[:, 1] - site.north)
    hidden = (azimuth >= shadow.first) & (azimuth <= shadow.last) & (away >= shadow.distance) & (seen.target >= 0)
    return Seen(plots[~hidden], seen.target[~hidden])


def sectors(radar: int, antenna: Antenna, seen: Seen, seconds: float, count: int) -> Iterator[SectorPlots]:
    """The plots as `count` equal sectors a turn, in order of time; the first ends after EPOCH, the last by `seconds`.

    radar: index of the radar in the tracker. Raises ValueError unless count divides the azimuths of the radar.
    """
    video, plots = antenna.site.video, seen.plots
    if video.azimuths % count:
        raise ValueError(f"{video.azimuths} azimuths do not make {count} equal sectors")
    sector = np.asarray(plots.scan * count + (plots.azimuth / (2 * np.pi) * count).astype(np.int64))
    rows = video.azimuths // count
    first = math.floor(antenna.phase * count)
    last = math.floor((antenna.phase + seconds / video.period_s) * count)
    edges = np.searchsorted(sector, np.arange(first, last + 1))
    for k, number in enumerate(range(first, last)):
        turn = number // count
        end = float(antenna.begin(0)) + (number + 1) / count * video.period_s
        mine = plots[edges[k] : edges[k + 1]]
        yield SectorPlots(radar, turn, end, number * rows, (number + 1) * rows, mine)


def interleaved(
    antennas: Sequence[Antenna], seen: Sequence[Seen], seconds: float, count: int
) -> tuple[SectorPlots, ...]:
    """The sectors of all radars in the order in which they end."""
    made = [
        one
        for radar, (antenna, its) in enumerate(zip(antennas, seen, strict=True))
        for one in sectors(radar, antenna, its, seconds, count)
    ]
    return tuple(sorted(made, key=lambda one: (one.time, one.radar)))


def _azimuth(site: RadarSite, place: Floats) -> Floats:
    """rad (...) clockwise from north of places (..., 2) m."""
    return np.asarray(np.arctan2(place[..., 0] - site.east, place[..., 1] - site.north) % (2 * np.pi))


def _half_north(lanes: int) -> float:
    """Half the width of the area, m."""
    return 0.5 * (lanes - 1) * LANE_M
