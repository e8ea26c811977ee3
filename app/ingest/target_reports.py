"""Target reports of cooperative sensors (ADS-B, multilateration, vehicle beacons) as JSON.

One object or an array of objects: `time` (Unix seconds or ISO 8601 with zone), `lat`, `lon` (degrees, WGS 84), and,
where known, `address` (24-bit, six hex digits), `callsign`, `speed_mps`, `course_deg`, `altitude_m` (above the
airport), `on_ground`, `category` (`aircraft`, `vehicle`, `unknown`), `accuracy_m`, `simulated`, `source` (the sensor or
feed that it came through, such as `adsb` or `mlat-1`: at most 16 ASCII letters, digits, `_`, `-` and `.`).
"""

from __future__ import annotations

import math
import re
from typing import Literal

import msgspec
import numpy as np

from app.ingest.wire_json import BadMessage, decode_rows, number, unix_time
from pipeline.airport.frame import LocalFrame
from pipeline.tables import TargetCategory, TargetReports

_ADDRESS = re.compile(r"[0-9a-fA-F]{6}")
_CALLSIGN = re.compile(r"[A-Z0-9 _.-]{0,8}")
_SOURCE = re.compile(r"[A-Za-z0-9_.-]{0,16}")


class TargetReportRow(msgspec.Struct, forbid_unknown_fields=True):
    """One report on the wire."""

    time: float | int | str
    lat: float | int
    lon: float | int
    address: str | None = None
    callsign: str | None = None
    speed_mps: float | int | None = None
    course_deg: float | int | None = None
    altitude_m: float | int | None = None
    on_ground: bool = True
    category: Literal["unknown", "aircraft", "vehicle"] = "unknown"
    accuracy_m: float | int = 7.5
    simulated: bool = False
    source: str | None = None


def parse_target_reports(body: bytes, frame: LocalFrame, limit: int = 1000) -> TargetReports:
    """The reports in a JSON body, in its order, in local metres.

    Raises BadMessage (a Refused) that says which entry is wrong and why; nothing is taken then.
    """
    rows = decode_rows(body, TargetReportRow, limit)
    where = [f"report {i}" for i in range(len(rows))]
    latitude = [number(row.lat, "lat", at, -90, 90) for row, at in zip(rows, where, strict=True)]
    longitude = [number(row.lon, "lon", at, -180, 180) for row, at in zip(rows, where, strict=True)]
    course = [number(row.course_deg, "course_deg", at, -360, 360) for row, at in zip(rows, where, strict=True)]
    east, north = frame.to_local(np.array(latitude), np.array(longitude))
    return TargetReports.build(
        len(rows),
        time=[unix_time(row.time, at) for row, at in zip(rows, where, strict=True)],
        address=[_address(row.address, at) for row, at in zip(rows, where, strict=True)],
        callsign=[_callsign(row.callsign, at) for row, at in zip(rows, where, strict=True)],
        east=east,
        north=north,
        accuracy=[number(row.accuracy_m, "accuracy_m", at, 0.01, 1e4) for row, at in zip(rows, where, strict=True)],
        altitude=[number(row.altitude_m, "altitude_m", at, -1e3, 3e4) for row, at in zip(rows, where, strict=True)],
        speed=[number(row.speed_mps, "speed_mps", at, 0, 1e3) for row, at in zip(rows, where, strict=True)],
        course=[math.radians(one % 360.0) for one in course],
        on_ground=[row.on_ground for row in rows],
        category=[TargetCategory[row.category.upper()] for row in rows],
        simulated=[row.simulated for row in rows],
        source=[_source(row.source, at) for row, at in zip(rows, where, strict=True)],
    )


def _address(text: str | None, where: str) -> str:
    if not text:
        return ""
    if not _ADDRESS.fullmatch(text):
        raise BadMessage("bad_value", f"{where}: address must be six hexadecimal digits")
    return text.lower()


def _callsign(text: str | None, where: str) -> str:
    trimmed = (text or "").strip().upper()
    if not _CALLSIGN.fullmatch(trimmed):
        raise BadMessage("bad_value", f"{where}: callsign must be at most eight letters and digits")
    return trimmed


def _source(text: str | None, where: str) -> str:
    if text is not None and not _SOURCE.fullmatch(text):
        raise BadMessage("bad_value", f"{where}: source must be at most 16 letters, digits, '_', '-' and '.'")
    return text or ""
