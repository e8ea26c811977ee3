"""How good the picture is: a simulated world through chain and engine, scored against the truth once a second.

The rows and their bounds follow the words of EUROCAE ED-87 (probability of target report, position and velocity
accuracy, continuity, identification, false target reports) as hpuhr/COMPASS transcribes them for the manoeuvring area;
they are targets for this program, not a proof of compliance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import SurfaceKind
from pipeline.airport.zones import ZoneMap
from pipeline.chain import RadarChain
from pipeline.engine import SurfaceEngine
from pipeline.lab.simulate.nodes import NodeSimulator
from pipeline.lab.simulate.paths import Truth
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.lab.simulate.world import World
from pipeline.picture import AlertChange
from pipeline.tables import Sweeps, TargetClass, Tracks

Array = NDArray[Any]
BLOCKS = 32
FALSE_M = 60.0
"""A report farther from every target is a false target report (manoeuvring area)."""

STRAY_M = 40.0
"""A track farther from every target is counted as a false track."""

APPEARED, VANISHED = 10.0, 15.0
"""Seconds granted to a target that the simulator puts on the airport or takes away."""

MANOEUVRING = (SurfaceKind.RUNWAY, SurfaceKind.TAXIWAY)
APRON = (SurfaceKind.APRON, SurfaceKind.ROAD)


@dataclass(frozen=True)
class QualityRow:
    """One line of the result. value: nan when there was nothing to measure. bound: what is wanted, at least or most.

    at_least: the value must not be less than the bound, otherwise not more. unit: "" for a probability. note: what was
    measured, where the name does not say it.
    """

    name: str
    value: float
    unit: str = ""
    bound: float | None = None
    at_least: bool = False
    note: str = ""

    def document(self) -> dict[str, Any]:
        """The row as JSON has it; a value that is not finite is None."""
        return {
            "name": self.name,
            "value": self.value if np.isfinite(self.value) else None,
            "unit": self.unit,
            "bound": self.bound,
            "at_least": self.at_least,
            "met": self.met,
            "note": self.note,
        }

    @property
    def met(self) -> bool | None:
        """The bound is kept; None without a bound or a value."""
        if self.bound is None or not np.isfinite(self.value):
            return None
        return self.value >= self.bound if self.at_least else self.value <= self.bound


@dataclass(eq=False)
class Score:
    """What was counted so far; `rows` makes figures of it."""

    seconds: int = 0
    asked: dict[str, int] = field(default_factory=dict)
    seen: dict[str, int] = field(default_factory=dict)
    error: dict[str, list[float]] = field(default_factory=dict)
    speed: list[float] = field(default_factory=list)
    course: list[float] = field(default_factory=list)
    heading: list[float] = field(default_factory=list)
    still_turn: list[float] = field(default_factory=list)
    reports: int = 0
    false_reports: int = 0
    false_tracks: set[int] = field(default_factory=set)
    false_on_pavement: set[int] = field(default_factory=set)
    doubles: int = 0
    named: int = 0
    should_be_named: int = 0
    wrong_name: int = 0
    changes: int = 0
    gaps: dict[int, int] = field(default_factory=dict)
    ended_gaps: list[int] = field(default_factory=list)
    alert_delay: list[float] = field(default_factory=list)
    missed_incidents: int = 0
    other_alerts: set[str] = field(default_factory=set)

    def rows(self) -> list[QualityRow]:
        """The figures beside what ED-87 wants on the manoeuvring area (or on aprons, where it says so)."""
        reports, minutes = max(self.reports, 1), max(self.seconds, 1) / 60.0
        gap = np.array(self.ended_gaps + [one for one in self.gaps.values() if one], float)
        asked = max(sum(self.asked.values()), 1)
        return [
            QualityRow("target report, manoeuvring area", self._share("manoeuvring"), "", 0.99, True),
            QualityRow("target report, apron", self._share("apron"), "", 0.90, True),
            QualityRow("position, manoeuvring area, 95 %", _part(self.error.get("manoeuvring"), 95), "m", 12.0),
            QualityRow("position, apron, 95 %", _part(self.error.get("apron"), 95), "m", 20.0),
            QualityRow("velocity, 90 %", _part(self.speed, 90), "m/s", 5.0),
            QualityRow("course of what moves, 90 %", _part(self.course, 90), "deg", 15.0),
            QualityRow("heading of moving aircraft, 90 %", _part(self.heading, 90), "deg", 15.0),
            QualityRow("turning of standing aircraft, 99 %", _part(self.still_turn, 99), "deg/s", 3.0),
            QualityRow("gap of 3 to 5 s", float(((gap >= 3) & (gap <= 5)).sum()) / asked, "", 1e-3),
            QualityRow("gap of more than 5 s", float((gap > 5).sum()) / asked, "", 1e-6),
            QualityRow("longest gap", float(gap.max(initial=0.0)), "s"),
            QualityRow("identification", self.named / max(self.should_be_named, 1), "", 0.999, True),
            QualityRow("false identification", self.wrong_name / reports, "", 1e-4),
            QualityRow("false target report", self.false_reports / reports, "", 1e-4),
            QualityRow("false tracks a minute", len(self.false_tracks) / minutes, "", 1.0),
            QualityRow("of these on the pavement", len(self.false_on_pavement) / minutes, "", 0.0),
            QualityRow("second track of a target", self.doubles / reports, "", 0.01),
            QualityRow("changes of number, per target and hour", self.changes / asked * 3600.0, ""),
            QualityRow("alert after passing the hold, latest", _part(self.alert_delay, 100), "s", 2.0),
            QualityRow("incidents without an alert", float(self.missed_incidents), "", 0.0),
            QualityRow("alerts outside the incidents", float(len(self.other_alerts)), ""),
        ]

    def _share(self, area: str) -> float:
        return self.seen.get(area, 0) / self.asked[area] if self.asked.get(area) else float("nan")


def _part(values: list[float] | None, percent: float) -> float:
    return float(np.percentile(values, percent)) if values else float("nan")


def in_sight(video: VideoSimulator, truth: Truth) -> Array:
    """(n,) whether each target is in range of the radar and stands out of the shadow of buildings."""
    site, slope = video.site, video.clutter.slope
    east, north = truth.east - site.east, truth.north - site.north
    ground = np.hypot(east, north)
    row = (np.arctan2(east, north) % (2 * np.pi) / site.video.azimuth_step_rad).astype(int) % site.video.azimuths
    cell = (ground - site.video.first_range_m) / site.video.range_step_m
    inside = (cell >= 8) & (cell < site.video.ranges - 8)
    column = np.clip(cell.astype(int), 0, site.video.ranges - 1)
    lift = (truth.altitude + 0.3 * truth.height - site.height) / np.maximum(ground, 1.0)
    return np.asarray(inside & (lift * 16384.0 >= slope[row, column]))


class PictureScorer:
    """Compares pictures with the truth. settle: s after the start that are not counted."""

    def __init__(self, world: World, video: VideoSimulator, settle: float = 30.0) -> None:
        self.world, self.video = world, video
        self.score = Score()
        self._from = world.start + settle
        self._zones = ZoneMap.build(world.airport)
        self._since: dict[int, float] = {}
        self._before: dict[int, tuple[float, float, str]] = {}
        self._gone: list[tuple[float, float, float, str]] = []
        self._number: dict[int, int] = {}
        self._pointing: dict[int, float] = {}
        self._alerts: dict[str, float] = {}

    def alerts(self, changes: tuple[AlertChange, ...], time: float) -> None:
        """Take the alert changes of one look."""
        intruders = {one.vehicle.callsign for one in self.world.incidents}
        for change in changes:
            if change.operation != "raise":
                continue
            names = {str(one.callsign or "") for one in change.alert.targets}
            for name in names & intruders:
                self._alerts.setdefault(f"{name}@{int(time // 60)}", time)
            if not names & intruders and time >= self._from:
                self.score.other_alerts.add(change.alert.text)

    def incidents(self, until: float) -> None:
        """Compare the alerts with the incidents from the settling until `until`."""
        for time, one in self.world.incident_times(self._from, until - 5.0):
            name = one.vehicle.callsign
            after = [
                at - time for key, at in self._alerts.items() if key.startswith(f"{name}@") and -30 < at - time < 30
            ]
            if after:
                self.score.alert_delay.append(max(min(after), 0.0))
            else:
                self.score.missed_incidents += 1

    def look(self, tracks: Tracks, time: float) -> None:
        """Score one picture (UTC s); once a second."""
        truth = self.world.truth(time)
        self._follow(truth, time)
        near, away, target = self._match(tracks, truth)
        if time < self._from:
            return
        self.score.seconds += 1
        self._false(tracks, near)
        self._targets(tracks, truth, away, target, time)

    def _follow(self, truth: Truth, time: float) -> None:
        """Note what appeared and what the simulator took away."""
        now = {
            int(id): (float(e), float(n), str(c))
            for id, e, n, c in zip(truth.id, truth.east, truth.north, truth.callsign, strict=True)
        }
        for id in now.keys() - self._since.keys():
            self._since[id] = time
        for id in self._before.keys() - now.keys():
            self._gone.append((time, *self._before[id]))
        self._gone = [one for one in self._gone if one[0] > time - VANISHED]
        self._before = now

    def _match(self, tracks: Tracks, truth: Truth) -> tuple[Array, Array, Array]:
        """For each track, at its own time: m to the nearest of all targets, and (n, targets) m to each of `truth`."""
        n = len(tracks)
        near, away = np.full(n, np.inf), np.full((n, len(truth)), np.inf)
        for k in range(n):
            then = self.world.truth(float(tracks.time[k]))
            apart = np.hypot(then.east - tracks.state[k, 0], then.north - tracks.state[k, 1])
            near[k] = apart.min(initial=np.inf)
            _, a, b = np.intersect1d(then.id, truth.id, assume_unique=True, return_indices=True)
            away[k, b] = apart[a]
        reach = np.maximum(12.0, 0.5 * truth.length.astype(np.float64) + 5.0)
        target = np.where((away <= reach).any(axis=1), np.argmin(away / reach, axis=1), -1) if n else np.zeros(0, int)
        return near, away, target

    def _false(self, tracks: Tracks, near: Array) -> None:
        score = self.score
        score.reports += len(tracks)
        paved = np.isin(self._zones.kind(tracks.state[:, 0], tracks.state[:, 1]), MANOEUVRING + APRON)
        for k in np.flatnonzero(near > STRAY_M):
            place = tracks.state[k, :2]
            name = str(tracks.callsign[k])
            if any(np.hypot(place[0] - e, place[1] - n) < 100.0 or (name and name == c) for _, e, n, c in self._gone):
                continue
            score.false_tracks.add(int(tracks.id[k]))
            score.false_reports += int(near[k] > FALSE_M)
            if paved[k]:
                score.false_on_pavement.add(int(tracks.id[k]))

    def _targets(self, tracks: Tracks, truth: Truth, away: Array, target: Array, time: float) -> None:
        score = self.score
        kind = self._zones.kind(truth.east, truth.north)
        seen = in_sight(self.video, truth)
        old = np.array([time - self._since[int(id)] >= APPEARED for id in truth.id], bool)
        for j in np.flatnonzero(truth.on_ground & seen & old):
            area = "manoeuvring" if kind[j] in MANOEUVRING else "apron" if kind[j] in APRON else ""
            if not area:
                continue
            score.asked[area] = score.asked.get(area, 0) + 1
            mine = np.flatnonzero(target == j)
            id = int(truth.id[j])
            if not len(mine):
                score.gaps[id] = score.gaps.get(id, 0) + 1
                continue
            gap = score.gaps.pop(id, 0)
            if gap:
                score.ended_gaps.append(gap)
            score.seen[area] = score.seen.get(area, 0) + 1
            score.doubles += len(mine) - 1
            k = int(mine[np.argmin(away[mine, j])])
            score.error.setdefault(area, []).append(float(away[k, j]))
            self._kinematics(tracks, k, truth, int(j))
            self._identity(tracks, k, truth, int(j))

    def _kinematics(self, tracks: Tracks, k: int, truth: Truth, j: int) -> None:
        score, id = self.score, int(truth.id[j])
        earlier, after = self.world.truth(float(tracks.time[k]) - 0.25), self.world.truth(float(tracks.time[k]) + 0.25)
        a, b = np.flatnonzero(earlier.id == id), np.flatnonzero(after.id == id)
        if not len(a) or not len(b):
            return
        true = np.array([after.east[b[0]] - earlier.east[a[0]], after.north[b[0]] - earlier.north[a[0]]]) / 0.5
        velocity = tracks.state[k, 2:4]
        score.speed.append(float(np.hypot(*(velocity - true))))
        pace = float(np.hypot(*true))
        heading = float(tracks.heading[k])
        aircraft = truth.category[j] == TargetClass.AIRCRAFT
        if pace > 3.0:
            score.course.append(_degrees(np.arctan2(*velocity) - np.arctan2(*true)))
            if aircraft and np.isfinite(heading):
                score.heading.append(_degrees(heading - float(truth.heading[j])))
        number = int(tracks.id[k])
        if pace < 0.1 and aircraft and np.isfinite(heading) and number in self._pointing:
            score.still_turn.append(_degrees(heading - self._pointing[number]))
        self._pointing[number] = heading if np.isfinite(heading) else self._pointing.get(number, heading)
        if not np.isfinite(self._pointing[number]):
            del self._pointing[number]

    def _identity(self, tracks: Tracks, k: int, truth: Truth, j: int) -> None:
        score, id, number = self.score, int(truth.id[j]), int(tracks.id[k])
        score.changes += self._number.get(id, number) != number
        self._number[id] = number
        name = str(tracks.callsign[k])
        alone = np.sort(np.hypot(truth.east - truth.east[j], truth.north - truth.north[j]))[1:2].min(initial=1e9) > 40.0
        if truth.reporting[j] and not (id % 9 == 0 and not truth.simulated[j]):
            score.should_be_named += 1
            score.named += name == str(truth.callsign[j])
        if name and alone:
            score.wrong_name += name != str(truth.callsign[j])


def _degrees(angle: Any) -> float:
    """Size of an angle (rad) in degrees."""
    return float(abs(np.degrees((angle + np.pi) % (2 * np.pi) - np.pi)))


def picture_quality(
    world: World,
    chain: RadarChain,
    engine: SurfaceEngine,
    video: VideoSimulator,
    nodes: NodeSimulator,
    reports: ReportSimulator,
    scans: int,
    settle: float = 30.0,
    progress: Callable[[int], None] | None = None,
) -> Score:
    """Run `scans` turns of the world's radar video through chain and engine, four looks a turn, and score them.

    All are seeded, so the figures are the same every time. progress: called with the number of each finished turn.
    """
    scorer = PictureScorer(world, video, settle)
    azimuths, period = video.site.video.azimuths, video.site.video.period_s
    time = world.start
    for scan in range(scans):
        for block in range(BLOCKS):
            first, last = azimuths * block // BLOCKS, azimuths * (block + 1) // BLOCKS
            rows = np.arange(first, last, dtype=np.int32)
            at = (world.start + (scan + (rows + 0.5) / azimuths) * period).astype(np.float64)
            sweeps = video.sweeps(scan, first, last, world.truth)
            azimuth = ((rows + 0.5) * video.site.video.azimuth_step_rad).astype(np.float64)
            engine.sector(chain.process(Sweeps(0, scan, rows, azimuth, at, sweeps, block == BLOCKS - 1)))
            if block % 8 == 7:
                since, time = time, world.start + (scan + (block + 1) / BLOCKS) * period
                engine.node_events(nodes.events(since, time, world.truth))
                engine.target_reports(reports.reports(since, time, world.truth))
                picture, changes = engine.look()
                scorer.alerts(changes, picture.time)
        scorer.look(picture.tracks, picture.time)
        if progress is not None:
            progress(scan)
    scorer.incidents(time)
    return scorer.score
