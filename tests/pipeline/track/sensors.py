"""Several radars of any period and phase, and reports, delivered in the order in which a service would hear them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.sites import RadarSite
from pipeline.tables import SectorPlots, TargetReports, Tracks, VideoFormat
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, Target, block, scan_plots, truth_at


@dataclass(frozen=True)
class Antenna:
    """A radar that turns evenly. phase: s since T0 at which its turn 0 begins. false: false plots a turn on average."""

    site: RadarSite
    phase: float = 0.0
    false: float = 0.0
    sd: float = 2.0

    @property
    def period(self) -> float:
        return self.site.video.period_s

    def turns(self, since: float, until: float) -> range:
        """The turns that end in (since, until], s since T0."""
        ended = [math.floor((t - self.phase) / self.period + 1e-9) for t in (since, until)]
        return range(max(ended[0], 0), max(ended[1], 0))


def antenna(
    name: str = "smr", east: float = 0.0, north: float = 0.0, *, period: float = 1.0, azimuths: int = 4096,
    phase: float = 0.0, false: float = 0.0,
) -> Antenna:  # fmt: skip
    video = VideoFormat(azimuths=azimuths, range_step_m=4.0, period_s=period)
    return Antenna(RadarSite(name, east, north, 22.0, video), phase, false)


def even_cut(blocks: int) -> Callable[[int, int], Sequence[int]]:
    """Equal blocks, at most one a row: the rows at which they end, from 0 to the number of azimuths."""
    return lambda azimuths, scan: [azimuths * k // min(blocks, azimuths) for k in range(min(blocks, azimuths) + 1)]


def random_cut(seed: int, most: int = 40) -> Callable[[int, int], Sequence[int]]:
    """Blocks of random sizes, other ones each turn."""

    def ends(azimuths: int, scan: int) -> Sequence[int]:
        rng = np.random.default_rng((seed, scan))
        inner = rng.integers(1, azimuths, rng.integers(0, most))
        return [0, *np.unique(inner).tolist(), azimuths]

    return ends


def blocks_of(
    antennas: Sequence[Antenna], targets: Sequence[Target], since: float, until: float, *, seed: int = 1,
    cut: Callable[[int, int], Sequence[int]] | None = None,
) -> list[SectorPlots]:  # fmt: skip
    """The blocks of all turns that end in (since, until] s since T0, of all radars, in the order of their end times."""
    ends = cut or even_cut(8)
    made = []
    for radar, one in enumerate(antennas):
        for scan in one.turns(since, until):
            rng = np.random.default_rng((seed, radar, scan))
            plots = scan_plots(rng, targets, scan, one.sd, one.false, site=one.site, phase=one.phase)
            rows = ends(one.site.video.azimuths, scan)
            made += [block(plots, scan, low, high, one.site, radar, one.phase) for low, high in pairwise(rows)]
    return sorted(made, key=lambda each: (each.time, each.radar))


def play(
    tracker: Tracker, antennas: Sequence[Antenna], targets: Sequence[Target], until: float, *, every: float = 1.0,
    reports: Callable[[float], TargetReports | None] = lambda t: None, seed: int = 1,
    cut: Callable[[int, int], Sequence[int]] | None = None,
) -> Iterator[tuple[float, Tracks]]:  # fmt: skip
    """Feed radars and reports from T0 on; gives the time since T0 and the tracks every `every` s, after the reports.

    reports: what is heard at a time since T0; asked at the end of each step.
    """
    for step in range(round(until / every)):
        since, now = step * every, (step + 1) * every
        for sector in blocks_of(antennas, targets, since, now, seed=seed, cut=cut):
            tracker.sector(sector)
        heard = reports(now)
        if heard is not None and len(heard):
            tracker.target_reports(heard)
        yield now, tracker.tracks()


def report(
    target: Target, t: float, address: str, *, rng: np.random.Generator | None = None, sd: float = 0.0,
    latency: float = 0.0, source: int = 0, **words: Any,
) -> TargetReports:  # fmt: skip
    """A report with the time stamp T0 + t. latency: s by which the position is older than the stamp says.

    source: which sensor system it comes from.
    """
    place = truth_at(target, T0 + t - latency)[0] + (rng.normal(0, sd, 2) if rng is not None else 0.0)
    words = {"accuracy": max(sd, 1.0), **words}
    name = f"source-{source}"
    return TargetReports.build(1, time=T0 + t, address=address, east=place[0], north=place[1], source=name, **words)


def by_address(tracks: Tracks, address: str) -> Tracks:
    return tracks[tracks.address == address]


def off(tracks: Tracks, target: Target, row: int = 0) -> float:
    """m from the truth at the track's own time."""
    return float(np.hypot(*(truth_at(target, tracks.time[row])[0] - tracks.state[row, :2])))


def nearest(tracks: Tracks, target: Target) -> int:
    """The row of the track nearest to the target, each at its own time."""
    return int(np.argmin([off(tracks, target, row) for row in range(len(tracks))]))
