"""Is a target that only one of several radars sees confirmed as fast, and held as well, as with that radar alone?"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from pipeline.airport.zones import ZoneMap
from pipeline.lab.evaluate import Figure, Line, Row, Trial
from pipeline.lab.evaluate.statistics import mean_interval, wilson
from pipeline.lab.simulate.several_radars import (
    EPOCH,
    SHADOWS,
    Antenna,
    Looking,
    Seen,
    Targets,
    behind,
    interleaved,
    make_airport,
    make_antennas,
    make_targets,
    observe,
)
from pipeline.parts import build
from pipeline.tables import TrackPhase, Tracks
from pipeline.track.tracker import Tracker

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """radars: how many there are. hidden: buildings hide the targets from all but the first."""

    radars: int
    hidden: bool

    @property
    def name(self) -> str:
        """In words."""
        if self.radars == 1:
            return "1 radar"
        return f"{self.radars} radars, {'one sees' if self.hidden else 'all see'}"


CASES = (Case(1, False), Case(2, True), Case(3, True), Case(2, False), Case(3, False))
"""The first is what the others are measured against."""

REACH_M = 15.0
"""A track this near is the target's: more than 5 standard deviations of a plot, less than half the distance of two
lanes."""

SLOWER_S = 0.1
"""By so much may the median of the time to confirmation be longer than with one radar: less than the time of the
sector in which the deciding plot is delivered."""

SLOWER_TURNS = 1.0
"""By so many turns of the first radar may the longest time to confirmation be longer: one more look."""

WORSE_PERCENT = 1.0
"""By so much of all targets, or of the time, may what is confirmed, held and kept be worse: less than one target of
those that two trials have, and less than one second of a run."""

MORE_NUMBERS = 0.01
"""By so many changes of number a target may there be more, for the same reason."""

LOST_S = 1.0
"""s without a track after which a target counts as lost: a track that begins with a wrong velocity may stray out of
REACH_M for less than a turn."""


class Found(NamedTuple):
    """What became of each target (..., n).

    confirmed_s: from its first plot to its confirmation, inf when there was none. coasting, absent: fractions of the
    time after that at which its track coasted or was not there, nan when there was none. lost: it was absent for
    LOST_S or longer at least once. numbers: changes of its track number.
    """

    confirmed_s: Floats
    coasting: Floats
    absent: Floats
    lost: Floats
    numbers: Floats


@dataclass(frozen=True)
class RadarCoverage:
    """lifecycles: parts that confirm and end tracks. periods_s: of the antennas of three radars; a run with fewer has
    the first of them. each: targets of each speed. seconds: how long a run is. limit_s: by when a target should be
    confirmed. sectors: a turn. detection, noise_m, false_plots: see `Looking`.
    """

    title: ClassVar[str] = "A target that only one of several radars sees"
    source: ClassVar[str] = "Airside's own requirement; no paper"
    reading: ClassVar[str] = (
        "Up to three radars at different places, antennas in any phase; each covers the area by its range. One sees: "
        "buildings hide all targets from the second and third radar, whose false plots stay. Targets stand, taxi at "
        "4 m/s or leave a runway at 25 m/s, 40 m apart. The first radar's plots are the same with any number of "
        "radars. The tracker has its default parts but for the lifecycle, and is asked for its tracks after every "
        "sector. Wanted: as good as with the first radar alone, but for 0.1 s of the median and one turn of the "
        "longest time to confirmation, and one in a hundred of the others."
    )
    trials: int = 2
    lifecycles: tuple[str, ...] = ("m_of_n", "score")
    periods_s: tuple[tuple[float, float, float], ...] = ((1.0, 1.0, 1.0), (1.0, 0.5, 2.5), (2.5, 1.0, 0.5))
    each: int = 10
    seconds: float = 75.0
    limit_s: float = 60.0
    sectors: int = 4
    detection: float = 0.95
    noise_m: float = 2.0
    false_plots: float = 4.0

    def quick(self) -> Self:
        """One draw of radars that turn alike and a shorter run."""
        return replace(self, trials=1, periods_s=self.periods_s[:1], each=4, seconds=20.0, limit_s=15.0)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """The fields of `Found`, each (periods, lifecycles, CASES, targets)."""
        made = [self._periods(chance, periods) for periods in self.periods_s]
        return {name: np.stack([getattr(one, name) for one in made]) for name in Found._fields}

    def _periods(self, chance: np.random.Generator, periods: tuple[float, ...]) -> Found:
        """All lifecycles and cases on the same plots."""
        antennas, targets, clear, blocked = self.scene(chance, periods)
        found = []
        for lifecycle in self.lifecycles:
            for case in CASES:
                used = (blocked if case.hidden else clear)[: case.radars]
                found.append(self._run(lifecycle, antennas[: case.radars], targets, used))
        shape = (len(self.lifecycles), len(CASES), len(targets.start))
        return Found(*(np.stack(one).reshape(shape) for one in zip(*found, strict=True)))

    def scene(
        self, chance: np.random.Generator, periods: Sequence[float]
    ) -> tuple[tuple[Antenna, ...], Targets, tuple[Seen, ...], tuple[Seen, ...]]:
        """Antennas, targets, and what each radar sees: without, and with the buildings."""
        antennas = make_antennas(chance, periods)
        targets = make_targets(chance, self.each, self.seconds)
        looking = Looking(self.detection, self.noise_m, self.false_plots)
        clear = tuple(observe(chance, one, targets, self.seconds, looking) for one in antennas)
        blocked = tuple(
            seen if shadow is None else behind(seen, targets, antenna.site, shadow)
            for antenna, seen, shadow in zip(antennas, clear, SHADOWS, strict=True)
        )
        return antennas, targets, clear, blocked

    def _run(self, lifecycle: str, antennas: Sequence[Antenna], targets: Targets, seen: Sequence[Seen]) -> Found:
        """One tracker over the whole time."""
        airport = make_airport(len(targets.start))
        tracker = Tracker(
            airport,
            [one.site for one in antennas],
            (),
            filter=build("filter", "kalman"),
            associate=build("associate", "gnn"),
            lifecycle=build("lifecycle", lifecycle),
            classify=build("classify", "extent_speed"),
            zones=ZoneMap.build(airport, step=20.0),
        )
        follower = Follower(targets, first_plots(seen, len(targets.start)))
        for sector in interleaved(antennas, seen, self.seconds, self.sectors):
            tracker.sector(sector)
            follower.look(tracker.tracks(sector.time), sector.time)
        return follower.found()

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """For each choice of periods and each lifecycle: one radar, then the others against it."""
        found = self._all(results)
        made: list[Row] = []
        for p, periods in enumerate(self.periods_s):
            for k, lifecycle in enumerate(self.lifecycles):
                alone: list[Row] = []
                for c, case in enumerate(CASES):
                    name = f"{lifecycle}, periods {_listed(periods)} s, {case.name}"
                    rows = self._case(name, Found(*(one[p, k, c].ravel() for one in found)))
                    made += [_bounded(*pair, periods[0]) for pair in zip(rows, alone, strict=True)] if alone else rows
                    alone = alone or rows
        return tuple(made)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """How many targets are confirmed after how long."""
        after = self._all(results).confirmed_s
        x = np.linspace(0.0, self.limit_s, 121)
        made = []
        for p, periods in enumerate(self.periods_s):
            for k, lifecycle in enumerate(self.lifecycles):
                lines = tuple(
                    Line(case.name, x, 100.0 * (after[p, k, c].ravel()[:, None] <= x).mean(axis=0))
                    for c, case in enumerate(CASES)
                )
                title = f"Targets confirmed, {lifecycle}, periods {_listed(periods)} s"
                made.append(Figure(title, "time since the first plot, s", "% of the targets", lines))
        return tuple(made)

    def _all(self, results: Sequence[Trial]) -> Found:
        """Of all trials: (periods, lifecycles, CASES, trials, targets)."""
        return Found(*(np.stack([one[name] for one in results], axis=3) for name in Found._fields))

    def _case(self, name: str, found: Found) -> list[Row]:
        """The rows of one case; found: (targets of all trials)."""
        after, n = np.sort(found.confirmed_s), len(found.confirmed_s)
        in_time, kept = int((after <= self.limit_s).sum()), np.isfinite(found.confirmed_s)
        # the order statistics between which the median lies with 95 %
        low, high = (after[min(int(one), n - 1)] for one in binom.interval(0.95, n, 0.5))
        worst = float(after[-1])
        return [
            _percent(f"{name}: confirmed within {self.limit_s:g} s", in_time, n, "higher"),
            Row(f"{name}: time to confirmation, median", float(np.median(after)), low, high, "s", better="lower"),
            Row(f"{name}: time to confirmation, longest", worst, worst, worst, "s", better="lower"),
            _mean(f"{name}: coasting", 100.0 * found.coasting[kept], "% of the time"),
            _mean(f"{name}: without a track after confirmation", 100.0 * found.absent[kept], "% of the time"),
            _percent(f"{name}: lost for a second or longer", int(found.lost[kept].sum()), int(kept.sum()), "lower"),
            _mean(f"{name}: changes of track number", found.numbers[kept], "a target"),
        ]


EXPERIMENT = RadarCoverage


class Follower:
    """Compares the tracks with the targets after every sector. first: (n,) UTC s of each target's first plot."""

    def __init__(self, targets: Targets, first: Floats) -> None:
        n = len(first)
        self._targets, self._first = targets, first
        self._confirmed, self._number = np.full(n, np.inf), np.zeros(n, np.int64)
        self._last_number, self._changes = np.zeros(n, np.int64), np.zeros(n)
        self._coasts, self._lost = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
        self._time, self._watched, self._coasting = EPOCH, np.zeros(n), np.zeros(n)
        self._absent, self._absent_now = np.zeros(n), np.zeros(n)

    def look(self, tracks: Tracks, time: float) -> None:
        """Take the tracks as they are at `time`, UTC s, which does not run back."""
        passed, self._time = time - self._time, time
        known = np.isfinite(self._confirmed)
        self._watched += passed * known
        self._coasting += passed * (known & (self._number > 0) & self._coasts)
        absent = known & (self._number == 0)
        self._absent += passed * absent
        self._absent_now = np.where(absent, self._absent_now + passed, 0.0)
        self._lost |= self._absent_now >= LOST_S
        number, self._coasts = self._nearest(tracks, time)
        there = number > 0
        self._confirmed[there & ~known] = time
        self._changes += there & (self._last_number > 0) & (number != self._last_number)
        self._last_number = np.where(there, number, self._last_number)
        self._number = number

    def found(self) -> Found:
        """What became of the targets."""
        share: dict[str, Any] = {"out": np.full(len(self._first), np.nan), "where": self._watched > 0}
        coasting = np.divide(self._coasting, self._watched, **share)
        share["out"] = np.full(len(self._first), np.nan)
        absent = np.divide(self._absent, self._watched, **share)
        return Found(self._confirmed - self._first, coasting, absent, self._lost.astype(np.float64), self._changes)

    def _nearest(self, tracks: Tracks, time: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """For each target the number of the track that is nearest, 0 when none is in reach, and whether it coasts."""
        if not len(tracks):
            return np.zeros_like(self._number), np.zeros(len(self._number), np.bool_)
        away = self._targets.place(time)[:, None] - tracks.state[None, :, :2]
        distance = np.hypot(away[..., 0], away[..., 1])
        nearest = distance.argmin(axis=1)
        there = distance.min(axis=1) <= REACH_M
        coasts = there & (tracks.phase[nearest] == TrackPhase.COASTING)
        return np.where(there, tracks.id[nearest].astype(np.int64), 0), coasts


def first_plots(seen: Sequence[Seen], targets: int) -> Floats:
    """UTC s of the first plot of each target by any radar (targets,); inf when there is none."""
    first = np.full(targets, np.inf)
    for one in seen:
        real = one.target >= 0
        np.minimum.at(first, one.target[real], one.plots.time[real])
    return first


def _bounded(row: Row, alone: Row, period_s: float) -> Row:
    """The row with its bound, which follows from that of one radar."""
    figure = row.name.rpartition(": ")[2]
    margin = {
        "time to confirmation, median": SLOWER_S,
        "time to confirmation, longest": SLOWER_TURNS * period_s,
        "changes of track number": MORE_NUMBERS,
    }.get(figure, WORSE_PERCENT)
    return replace(row, wanted=alone.measured + (-margin if row.better == "higher" else margin))


def _percent(name: str, hits: int, tries: int, better: Literal["higher", "lower"]) -> Row:
    if not tries:
        return Row(name, math.nan, math.nan, math.nan, "%", better=better)
    low, high = wilson(hits, tries)
    return Row(name, 100.0 * hits / tries, 100.0 * low, 100.0 * high, "%", better=better)


def _mean(name: str, values: Floats, unit: str) -> Row:
    values = values[np.isfinite(values)]
    if not len(values):
        return Row(name, math.nan, math.nan, math.nan, unit, better="lower")
    low, high = mean_interval(values)
    return Row(name, float(values.mean()), max(low, 0.0), high, unit, better="lower")


def _listed(periods: Sequence[float]) -> str:
    *others, last = (f"{one:g}" for one in periods)
    return f"{', '.join(others)} and {last}"
