"""Recorded positions made into clean trajectories; whatever is left out is counted by its reason."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from pipeline.airport.frame import LocalFrame

Floats = NDArray[np.float64]

FEET = 0.3048


@dataclass(frozen=True, slots=True)
class CleaningRules:
    """What is taken for impossible, and how far interpolation goes.

    radius: m about the reference point. ceiling: m above the airport. ground_speed, air_speed: m/s above which two
    positions cannot belong to one movement. gap: s without a sample at which a trajectory is split in two.
    standing: m/s below which a repeated position is a standing aircraft and not a stale one. smoothing: standard
    deviation in s of the smoothing along the trajectory. shortest: s below which a trajectory is not kept.
    """

    radius: float = 9000.0
    ceiling: float = 700.0
    ground_speed: float = 95.0
    air_speed: float = 140.0
    gap: float = 45.0
    standing: float = 1.5
    smoothing: float = 1.2
    shortest: float = 15.0


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """One aircraft, one sample a second: time s since the start of the record, metres, rad, m/s."""

    address: str
    callsign: str
    time: Floats
    east: Floats
    north: Floats
    altitude: Floats
    heading: Floats
    speed: Floats
    on_ground: NDArray[np.bool_]


@dataclass(slots=True)
class CleaningReport:
    """What went in, what was left out and why, what came out. `left_out` counts rows by reason."""

    rows: int = 0
    aircraft: int = 0
    kept: int = 0
    left_out: dict[str, int] = field(default_factory=dict)
    trajectories: int = 0
    splits: int = 0
    ground_pressure_altitude_ft: float = 0.0

    def drop(self, reason: str, rows: int = 1) -> None:
        """Count rows that are left out."""
        if rows:
            self.left_out[reason] = self.left_out.get(reason, 0) + rows


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The samples of one aircraft in ascending time."""

    time: Floats
    east: Floats
    north: Floats
    altitude: Floats
    on_ground: NDArray[np.bool_]

    def __getitem__(self, rows: Any) -> _Rows:
        return _Rows(self.time[rows], self.east[rows], self.north[rows], self.altitude[rows], self.on_ground[rows])

    def __len__(self) -> int:
        return len(self.time)


def clean(
    rows: Iterable[Mapping[str, Any]], frame: LocalFrame, start: float, rules: CleaningRules | None = None
) -> tuple[list[Trajectory], CleaningReport]:
    """Trajectories near the airport, in metres about the frame's origin, and the account of what was left out.

    rows: `timestamp` (ms), `icao24`, `callsign`, `latitude`, `longitude` (deg), `altitude` (ft, pressure), `onground`.
    start: UTC s that becomes time 0. Ground speed and track of the record are not used: its source repeats the last
    value heard, so that an aircraft at its stand may still claim a hundred knots; both are derived from positions.
    """
    rules = rules or CleaningRules()
    report = CleaningReport()
    by_address: dict[str, list[tuple[float, float, float, float, bool, str]]] = {}
    for row in rows:
        report.rows += 1
        sample = _sample(row, start)
        if sample is None:
            report.drop("invalid")
        else:
            by_address.setdefault(str(row["icao24"]).lower(), []).append(sample)
    report.aircraft = len(by_address)
    located = {address: _locate(samples, frame, rules, report) for address, samples in by_address.items()}
    reference = _ground_reference([one for one, _ in located.values()])
    report.ground_pressure_altitude_ft = reference / FEET
    made: list[Trajectory] = []
    for address in sorted(located):
        samples, callsigns = located[address]
        made += _trajectories(address, samples, callsigns, reference, rules, report)
    report.trajectories = len(made)
    return made, report


def _sample(row: Mapping[str, Any], start: float) -> tuple[float, float, float, float, bool, str] | None:
    try:
        time = float(row["timestamp"]) / 1e3 - start
        latitude, longitude = float(row["latitude"]), float(row["longitude"])
        altitude = row.get("altitude")
        height = math.nan if altitude is None else float(altitude) * FEET
        named = str(row["icao24"])
    except (KeyError, TypeError, ValueError):
        return None
    if not (math.isfinite(time) and abs(latitude) <= 90 and abs(longitude) <= 180 and named):
        return None
    return time, latitude, longitude, height, bool(row.get("onground")), str(row.get("callsign") or "").strip()


def _locate(
    samples: list[tuple[float, float, float, float, bool, str]],
    frame: LocalFrame,
    rules: CleaningRules,
    report: CleaningReport,
) -> tuple[_Rows, list[tuple[float, str]]]:
    samples = sorted(samples, key=lambda one: one[0])
    time = np.array([one[0] for one in samples])
    first = np.concatenate([[True], np.diff(time) > 0])
    report.drop("duplicate time", int(np.sum(~first)))
    kept = [one for one, is_first in zip(samples, first, strict=True) if is_first]
    east, north = frame.to_local([one[1] for one in kept], [one[2] for one in kept])
    rows = _Rows(
        np.array([one[0] for one in kept]),
        east,
        north,
        np.array([one[3] for one in kept]),
        np.array([one[4] for one in kept], bool),
    )
    near = np.hypot(east, north) <= rules.radius
    report.drop("outside the area", int(np.sum(~near)))
    return rows[near], [(one[0], one[5]) for one in kept if one[5]]


def _ground_reference(everyone: list[_Rows]) -> float:
    heights = np.concatenate([one.altitude[one.on_ground] for one in everyone] or [np.zeros(0)])
    heights = heights[np.isfinite(heights)]
    return float(np.median(heights)) if len(heights) else 0.0


def _trajectories(
    address: str,
    samples: _Rows,
    callsigns: list[tuple[float, str]],
    reference: float,
    rules: CleaningRules,
    report: CleaningReport,
) -> list[Trajectory]:
    altitude = np.where(samples.on_ground, 0.0, np.maximum(samples.altitude - reference, 0.0))
    known = np.isfinite(altitude)
    report.drop("airborne without altitude", int(np.sum(~known)))
    samples = _Rows(samples.time, samples.east, samples.north, altitude, samples.on_ground)[known]
    low = samples.altitude <= rules.ceiling
    report.drop("above the ceiling", int(np.sum(~low)))
    samples = samples[low]
    parts = [
        part
        for leg in _split_at_gaps(samples, rules.gap)
        for part in _without_jumps(_without_frozen(leg, rules, report), rules, report)
    ]
    made = []
    for number, part in enumerate(parts):
        if len(part) < 3 or part.time[-1] - part.time[0] < rules.shortest:
            report.drop("fragment", len(part))
            continue
        report.kept += len(part)
        report.splits += number > 0
        middle = float(part.time[len(part) // 2])
        callsign = min(callsigns, key=lambda one: abs(one[0] - middle))[1] if callsigns else ""
        made.append(_resampled(address, callsign, part, rules))
    return made


def _split_at_gaps(samples: _Rows, gap: float) -> list[_Rows]:
    cuts = np.flatnonzero(np.diff(samples.time) > gap) + 1
    return [samples[part] for part in np.split(np.arange(len(samples)), cuts) if len(part)]


def _without_frozen(samples: _Rows, rules: CleaningRules, report: CleaningReport) -> _Rows:
    """Leave out repeats of a stale position; a standing aircraft keeps the first and the last of its repeats."""
    n = len(samples)
    keep = np.ones(n, bool)
    changed = np.flatnonzero(np.concatenate([[True], np.hypot(np.diff(samples.east), np.diff(samples.north)) > 0.01]))
    for at, begin in enumerate(changed):
        end = changed[at + 1] if at + 1 < len(changed) else n
        if end - begin < 2:
            continue
        keep[begin + 1 : end] = False
        if end == n:
            # nothing follows: standing on the ground, stale in the air
            stands = bool(samples.on_ground[begin])
        else:
            moved = math.hypot(samples.east[end] - samples.east[begin], samples.north[end] - samples.north[begin])
            stands = moved < rules.standing * (samples.time[end] - samples.time[begin])
        if stands:
            keep[end - 1] = True
            report.drop("standing, repeated", int(end - begin - 2))
        else:
            report.drop("frozen while moving", int(end - begin - 1))
    return samples[keep]


def _without_jumps(samples: _Rows, rules: CleaningRules, report: CleaningReport) -> list[_Rows]:
    """Split at gaps; leave out samples that cannot be reached from both the sample before and the one after."""
    if not len(samples):
        return []
    parts: list[list[int]] = [[0]]
    for i in range(1, len(samples)):
        last = parts[-1][-1]
        elapsed = samples.time[i] - samples.time[last]
        standing = math.hypot(samples.east[i] - samples.east[last], samples.north[i] - samples.north[last]) < (
            rules.standing * elapsed
        )
        if elapsed > rules.gap and not standing:
            parts.append([i])
        elif _reachable(samples, last, i, rules):
            parts[-1].append(i)
        elif len(parts[-1]) <= 2 and i + 2 < len(samples) and _reachable(samples, i, i + 1, rules):
            # the jump is in the first samples, not here
            report.drop("impossible jump", len(parts[-1]))
            parts[-1] = [i]
        else:
            report.drop("impossible jump")
    return [samples[np.array(part)] for part in parts]


def _reachable(samples: _Rows, a: int, b: int, rules: CleaningRules) -> bool:
    elapsed = float(samples.time[b] - samples.time[a])
    distance = math.hypot(samples.east[b] - samples.east[a], samples.north[b] - samples.north[a])
    airborne = not (samples.on_ground[a] and samples.on_ground[b])
    # the time stamps are whole seconds: allow one more for the rounding
    return distance <= (rules.air_speed if airborne else rules.ground_speed) * (elapsed + 0.5) + 15.0


def _resampled(address: str, callsign: str, part: _Rows, rules: CleaningRules) -> Trajectory:
    time = np.arange(math.ceil(part.time[0]), math.floor(part.time[-1]) + 1.0)
    east = _smooth(PchipInterpolator(part.time, part.east)(time), rules.smoothing)
    north = _smooth(PchipInterpolator(part.time, part.north)(time), rules.smoothing)
    altitude = np.maximum(_smooth(np.interp(time, part.time, part.altitude), 2.0), 0.0)
    speed, heading = motion(east, north)
    return Trajectory(address, callsign, time, east, north, altitude, heading, speed, altitude < 5.0)


def _smooth(values: Floats, sigma: float) -> Floats:
    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest")) if sigma > 0 else values


def motion(east: Floats, north: Floats, step: float = 1.0) -> tuple[Floats, Floats]:
    """(speed, heading) along positions at equal time steps; the heading is kept where the aircraft does not move.

    The heading is the direction of the chord that reaches four metres to each side, so that the grain of the positions
    does not turn a slow aircraft; before the first movement it is that of the first movement.
    """
    n = len(east)
    speed = np.hypot(np.gradient(east, step), np.gradient(north, step)) if n > 1 else np.zeros(n)
    path = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(east), np.diff(north)))])
    back = np.searchsorted(path, path - 4.0)
    ahead = np.minimum(np.searchsorted(path, path + 4.0), n - 1)
    de, dn = east[ahead] - east[back], north[ahead] - north[back]
    known = (np.hypot(de, dn) > 3.0) & (speed > 0.4)
    heading = np.arctan2(de, dn)
    if not known.any():
        return np.where(speed < 0.15, 0.0, speed), np.zeros(n)
    held = np.where(known, np.arange(n), -1)
    held = np.maximum.accumulate(held)
    held[held < 0] = int(np.flatnonzero(known)[0])
    smooth = gaussian_filter1d(np.exp(1j * heading[held]), 1.5, mode="nearest")
    return np.where(speed < 0.15, 0.0, speed), np.mod(np.angle(smooth), 2 * np.pi)


def busiest_window(trajectories: list[Trajectory], length: float = 3600.0, step: float = 60.0) -> float:
    """Start of the window with the most movement during which the direction of the runways does not change.

    Movement: seconds faster than 1 m/s, with those faster than 30 m/s (runway, final, climb) counted three times. The
    direction counts as changed when more than a hundredth of the fast seconds goes against the rest; when no window is
    free of that, the busiest of all is taken.
    """
    if not trajectories:
        return 0.0
    time = np.concatenate([one.time for one in trajectories])
    speed = np.concatenate([one.speed for one in trajectories])
    heading = np.concatenate([one.heading for one in trajectories])
    worth = (speed > 1.0) + 2.0 * (speed > 30.0)
    fast = speed > 30.0
    axis = np.angle(np.sum(np.exp(2j * heading[fast]))) / 2 if fast.any() else 0.0
    forward = np.cos(heading - axis) > 0
    best, chosen = -1.0, 0.0
    latest = max(float(time.max()) - length, float(time.min()))
    # only where there is something: a single wrong clock must not make years of empty windows
    for start in np.unique(np.minimum(np.floor(time / step) * step, latest)):
        inside = (time >= start) & (time < start + length)
        ahead, all_fast = int(np.sum(inside & fast & forward)), int(np.sum(inside & fast))
        steady = min(ahead, all_fast - ahead) <= 0.01 * all_fast
        score = float(np.sum(worth[inside])) + (1e9 if steady else 0.0)
        if score > best:
            best, chosen = score, float(start)
    return chosen
