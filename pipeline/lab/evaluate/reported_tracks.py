"""Recorded target reports through the tracker: what a meaningless course or speed costs in numbers and identities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, TaxiGraph
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.filter.kalman import Kalman
from pipeline.lab.evaluate import Figure, Line, RecordedReports, Row, Trial
from pipeline.lab.evaluate.statistics import wilson
from pipeline.lab.simulate.recording import Recording
from pipeline.lab.simulate.reports import RECORD_SOURCE
from pipeline.lifecycle.score import Score
from pipeline.tables import TargetReports
from pipeline.track.tracker import Tracker

SAID = ("as recorded", "no course", "course reversed", "course random", "speed zero", "speed doubled")
"""What is said of course and speed, one trial each."""

UNHARMED = SAID[:2]
"""Those that give the tracker nothing wrong."""

VISIT_GAP_S = 10.0
"""s without a report of an address, after which its next one begins another visit: its track may have ended."""

QUICK_S = 600.0
"""s of the recording that the short version takes."""

STEP_S = 1.0
"""s of reports that are taken at a time, as a service does that asks its sensors once a second."""

TOLD_COUNTERS = ("identity_moved", "report_implausible", "report_ambiguous", "merged", "confirmed")
"""Counters of the tracker that are told."""


@dataclass(frozen=True)
class ReportedTracks:
    """Reports alone, without any radar, through the default tracker.

    reports: the recording. radius_m, ceiling_m: reports farther from the middle or higher are left out. spread_m:
    standard deviation of the noise added to each coordinate of a recording that was smoothed.
    """

    title: str = "Recorded target reports: numbers and identities when course or speed mean nothing"
    source: str = "Airside's own question; operational multilateration sends a course that is noise"
    reading: str = (
        "recorded reports alone, no radar, a second of them at a time; course and speed as recorded, left out,"
        " reversed, uniform noise, zero or doubled; wanted: no more moves than without a course. A visit of an address"
        " ends with ten seconds without a report. An address has no track when none bears it right after its report."
        " Positions of the shipped record, which was smoothed, get noise; those of a file stay as they are"
    )
    trials: int = len(SAID)
    reports: RecordedReports | None = None
    radius_m: float = 9000.0
    ceiling_m: float = 700.0
    spread_m: float = 3.0
    longest_s: float = float("inf")

    def quick(self) -> Self:
        """The first ten minutes."""
        return replace(self, longest_s=QUICK_S)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """One case of SAID: the counters told, hours, reports, visits, numbers, reports without a track, off (n) m
        between a report and its track, seconds spent. Raises ValueError without a recording or an empty one."""
        reports = said(self._usable(chance), SAID[number % len(SAID)], chance)
        tracker = make_tracker()
        begin, seconds = float(reports.time[0]), 0.0
        edges = np.arange(begin + STEP_S, float(reports.time[-1]) + 2 * STEP_S, STEP_S)
        ends = np.searchsorted(reports.time, edges)
        numbers: set[tuple[str, int]] = set()
        off, without, first = [], 0, 0
        for edge, last in zip(edges, ends, strict=True):
            batch = reports[first:last]
            first = int(last)
            started = clock()
            if len(batch):
                tracker.target_reports(batch)
            tracker.advance(float(edge))
            seconds += clock() - started
            apart, bare = _compared(tracker, batch, numbers)
            off.append(apart)
            without += bare
        made: dict[str, NDArray[Any]] = {name: np.array(tracker.counters.get(name, 0)) for name in TOLD_COUNTERS}
        told = {
            "hours": (float(reports.time[-1]) - begin) / 3600.0,
            "reports": len(reports),
            "visits": visits(reports),
            "numbers": len(numbers),
            "without": without,
            "seconds": seconds,
        }
        return made | {name: np.array(value) for name, value in told.items()} | {"off": np.concatenate(off)}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Of each case: identity moves, numbers a visit, implausible reports and those without a track, m, time."""
        rows: list[Row] = []
        plain = results[SAID.index("no course")] if len(results) > SAID.index("no course") else None
        for number, one in enumerate(results):
            name = SAID[number % len(SAID)]
            if number >= len(SAID):
                name = f"{name}, again {number // len(SAID)}"
            reports, hours = int(one["reports"]), max(float(one["hours"]), 1e-9)
            wanted = None if plain is None or number < len(UNHARMED) else float(plain["identity_moved"]) / hours
            rows += [
                _exact(f"{name}: identity moves", float(one["identity_moved"]) / hours, "1/h", wanted),
                _exact(f"{name}: numbers a visit", int(one["numbers"]) / max(int(one["visits"]), 1), ""),
                _share(f"{name}: implausible reports", int(one["report_implausible"]), reports),
                _share(f"{name}: reports whose address has no track", int(one["without"]), reports),
                _exact(f"{name}: between report and track, 95 %", _percentile(one["off"]), "m"),
                replace(
                    _exact(f"{name}: time a report", 1e6 * float(one["seconds"]) / reports, "us"), repeatable=False
                ),
            ]
        return tuple(rows)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """How far reports lie from their tracks."""
        shares = np.linspace(0.5, 1.0, 101)
        lines = [
            Line(SAID[number], shares, np.quantile(one["off"], shares))
            for number, one in enumerate(results[: len(SAID)])
            if len(one["off"])
        ]
        return (Figure("Between a report and its track", "share of reports", "m", tuple(lines), log_y=True),)

    def _usable(self, chance: np.random.Generator) -> TargetReports:
        """The reports near the airport in order of time, with noise where the recording wants some."""
        if self.reports is None:
            raise ValueError("this experiment works on recorded target reports: say which (--file)")
        reports = self.reports.reports
        near = np.hypot(reports.east, reports.north) < self.radius_m
        near &= ~(reports.altitude > self.ceiling_m) & np.isfinite(reports.time)
        reports = reports[near]
        reports = reports[np.argsort(reports.time, kind="stable")]
        if not len(reports):
            raise ValueError(f"{self.reports.name} has no target reports near the airport")
        reports = reports[reports.time <= reports.time[0] + self.longest_s]
        if not self.reports.smoothed:
            return reports
        noise = chance.normal(0.0, self.spread_m, (2, len(reports)))
        return reports.replace(east=reports.east + noise[0], north=reports.north + noise[1], accuracy=self.spread_m)


EXPERIMENT = ReportedTracks


def make_tracker() -> Tracker:
    """The default tracker of an airport without radars."""
    airport = Airport("NONE", "no map", LocalFrame(0.0, 0.0), (), (), (), TaxiGraph((), ()))
    return Tracker(
        airport, (), (), filter=Kalman(), associate=GlobalNearestNeighbour(), lifecycle=Score(), classify=ExtentSpeed()
    )


def said(reports: TargetReports, what: str, chance: np.random.Generator) -> TargetReports:
    """The reports with course and speed as one of SAID has them. Raises ValueError for another word."""
    match what:
        case "as recorded":
            return reports
        case "no course":
            return reports.replace(course=np.nan)
        case "course reversed":
            return reports.replace(course=(reports.course + np.pi) % (2 * np.pi))
        case "course random":
            return reports.replace(course=chance.uniform(0.0, 2 * np.pi, len(reports)))
        case "speed zero":
            return reports.replace(speed=0.0)
        case "speed doubled":
            return reports.replace(speed=2 * reports.speed)
    raise ValueError(f"reports cannot say {what!r}")


def visits(reports: TargetReports) -> int:
    """How many visits all addresses make. reports: in order of time."""
    named = reports[reports.address != ""]
    order = np.argsort(named.address, kind="stable")
    address, time = named.address[order], named.time[order]
    if not len(time):
        return 0
    return 1 + int(((address[1:] != address[:-1]) | (np.diff(time) > VISIT_GAP_S)).sum())


def reports_of(recording: Recording) -> TargetReports:
    """What the aircraft of a traffic record report once a second."""
    made = [
        TargetReports.build(
            len(one.time), time=recording.start + one.time, address=one.address, callsign=one.callsign, east=one.east,
            north=one.north, altitude=one.altitude, speed=one.speed, course=one.heading, on_ground=one.on_ground,
            source=RECORD_SOURCE,
        )
        for one in recording.trajectories
    ]  # fmt: skip
    reports = TargetReports.concatenate(made)
    return reports[np.argsort(reports.time, kind="stable")]


def _compared(tracker: Tracker, batch: TargetReports, numbers: set[tuple[str, int]]) -> tuple[NDArray[np.float64], int]:
    """(m between the newest report of each address and its track then, reports without a track); adds to `numbers`."""
    tracks = tracker.tracks()
    row = {str(address): k for k, address in enumerate(tracks.address) if address}
    numbers |= {(address, int(tracks.id[k])) for address, k in row.items()}
    newest = {str(address): k for k, address in enumerate(batch.address) if address}
    borne = [(k, row[address]) for address, k in newest.items() if address in row]
    of, at = (np.array([pair[side] for pair in borne], np.int64) for side in (0, 1))
    since = batch.time[of] - tracks.time[at]
    state = tracks.state[at]
    east, north = (state[:, side] + since * state[:, 2 + side] for side in (0, 1))
    return np.hypot(batch.east[of] - east, batch.north[of] - north), len(newest) - len(borne)


def _percentile(off: NDArray[Any]) -> float:
    return float(np.percentile(off, 95)) if len(off) else float("nan")


def _exact(name: str, measured: float, unit: str, wanted: float | None = None) -> Row:
    return Row(name, measured, measured, measured, unit, better="lower", wanted=wanted)


def _share(name: str, hits: int, tries: int) -> Row:
    low, high = wilson(hits, tries)
    return Row(name, 100 * hits / tries, 100 * low, 100 * high, "%", better="lower")
