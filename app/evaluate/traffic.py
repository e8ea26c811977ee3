"""Recorded traffic for the experiments that work on some: the shipped record, or files of recorded rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from app.airports import load_airport, shipped_airports
from app.assembly import radar_site
from app.demo.scene import demo_radar
from app.demo.traffic import load_recording, read_gzip_json
from app.evaluate.recorded import name_of
from pipeline.airport.model import Airport
from pipeline.lab.evaluate import RecordedTraffic
from pipeline.lab.simulate.recording import Recording, RecordingError
from pipeline.lab.simulate.traffic import FEET, CleaningRules, Trajectory, clean
from pipeline.tables import TargetCategory, TargetReports

SHIPPED = "LFPO"
"""The airport whose traffic record is shipped."""

APART_S = 600.0
"""s without any movement after which what follows is a recording of its own, as for runs of different days."""

LEAST_S = 60.0
"""s that a recording lasts at least: the loop of a world must be longer than its movements."""

REPORTED_M = 20_000.0
"""m from the airport within which recorded rows are given as reports: beyond the final that is watched."""

KNOTS = 1852.0 / 3600.0


@cache
def shipped_airport(icao: str) -> Airport:
    """A shipped airport, read once."""
    return load_airport(icao)[0]


def shipped_traffic() -> tuple[RecordedTraffic, ...]:
    """The traffic record that is shipped. Raises RecordingError."""
    airport = shipped_airport(SHIPPED)
    radar = radar_site(demo_radar(airport, 0), airport)
    return (RecordedTraffic(airport, radar, load_recording(SHIPPED, airport), name=SHIPPED),)


def recorded_traffic(path: Path) -> tuple[RecordedTraffic, ...]:
    """The rows of a file, or of all files of a folder, near the shipped airports that have most of them on the ground.

    Rows have timestamp (ms), icao24, callsign, latitude, longitude, groundspeed (kt), track (deg), altitude (ft) and
    onground; a list of them, or columns. Raises RecordingError.
    """
    if not path.is_dir():
        return _of_file(path)
    files = sorted(one for one in path.iterdir() if one.name.endswith((".json", ".json.gz")))
    if not files:
        raise RecordingError(f"{path}: has no .json or .json.gz files")
    return tuple(part for one in files for part in _of_file(one))


def _of_file(path: Path) -> tuple[RecordedTraffic, ...]:
    rows = _rows(path)
    airport = _airport_of(path, rows)
    begin = min(float(one["timestamp"]) for one in rows) / 1e3
    trajectories, account = clean(rows, airport.frame, begin)
    if not trajectories:
        raise RecordingError(f"{path}: no aircraft moves near {airport.icao}")
    reports = _reports(rows, airport, account.ground_pressure_altitude_ft)
    radar = radar_site(demo_radar(airport, 0), airport)
    made = []
    for number, group in enumerate(_apart(trajectories)):
        first, last = min(float(one.time[0]) for one in group), max(float(one.time[-1]) for one in group)
        recording = Recording(airport.icao, begin + first, max(last - first + 1.0, LEAST_S), _from(group, first))
        during = (reports.time >= begin + first - 1.0) & (reports.time <= begin + last + 1.0)
        name = name_of(path) + (f" ({number + 1})" if number else "")
        made.append(RecordedTraffic(airport, radar, recording, reports[during], name))
    return tuple(made)


def _rows(path: Path) -> list[dict[str, Any]]:
    found = read_gzip_json(path)
    if isinstance(found, dict) and found and all(isinstance(one, dict) for one in found.values()):
        names = list(found.get("timestamp") or ())
        found = [{column: values.get(row) for column, values in found.items()} for row in names]
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise RecordingError(f"{path}: a list of rows was expected")
    rows = [one for one in found if isinstance(one.get("timestamp"), int | float)]
    if not rows:
        raise RecordingError(f"{path}: no row has a timestamp")
    return rows


def _airport_of(path: Path, rows: Sequence[dict[str, Any]]) -> Airport:
    places = [(one.get("latitude"), one.get("longitude")) for one in rows if one.get("onground")]
    places = [one for one in places if all(isinstance(value, int | float) for value in one)]
    latitude, longitude = np.array(places, np.float64).reshape(-1, 2).T
    best, most = None, 0
    for code in shipped_airports():
        airport = shipped_airport(code)
        east, north = airport.frame.to_local(latitude, longitude)
        near = int((np.hypot(east, north) < CleaningRules().radius).sum())
        if near > most:
            best, most = airport, near
    if best is None:
        raise RecordingError(f"{path}: nothing is on the ground at a shipped airport ({', '.join(shipped_airports())})")
    return best


def _reports(rows: Sequence[dict[str, Any]], airport: Airport, ground_ft: float) -> TargetReports:
    """The rows as a service would be told them: course and speed as recorded, altitude above the airport."""
    columns = np.array(
        [
            [
                _number(one.get(name))
                for name in ("timestamp", "latitude", "longitude", "groundspeed", "track", "altitude")
            ]
            for one in rows
        ]
    )
    milliseconds, latitude, longitude, knots, track, feet = columns.T
    known = np.isfinite(columns[:, :3]).all(axis=1)
    east, north = airport.frame.to_local(np.where(known, latitude, 0.0), np.where(known, longitude, 0.0))
    ground = np.array([bool(one.get("onground")) for one in rows])
    kept = known & (np.hypot(east, north) < REPORTED_M)
    altitude = np.where(ground, 0.0, np.maximum((feet - ground_ft) * FEET, 0.0))
    return TargetReports.build(
        len(rows), time=milliseconds / 1e3, address=[str(one.get("icao24") or "").lower()[:6] for one in rows],
        callsign=[str(one.get("callsign") or "").strip()[:8] for one in rows], east=east, north=north,
        altitude=altitude, speed=knots * KNOTS, course=np.radians(track), on_ground=ground,
        category=TargetCategory.AIRCRAFT,
    )[kept]  # fmt: skip


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan


def _apart(trajectories: Sequence[Trajectory]) -> list[list[Trajectory]]:
    """Groups that follow each other after a pause."""
    groups: list[list[Trajectory]] = []
    until = -math.inf
    for one in sorted(trajectories, key=lambda one: float(one.time[0])):
        if one.time[0] > until + APART_S:
            groups.append([])
        groups[-1].append(one)
        until = max(until, float(one.time[-1]))
    return groups


def _from(group: Sequence[Trajectory], first: float) -> tuple[Trajectory, ...]:
    return tuple(
        Trajectory(
            one.address, one.callsign, one.time - first, one.east, one.north, one.altitude, one.heading, one.speed,
            one.on_ground,
        )
        for one in group
    )  # fmt: skip
