"""Target reports of cooperative sensors (ADS-B, multilateration, vehicle beacons) as JSON.

One object or an array of objects: `time` (Unix seconds or ISO 8601 with zone), `lat`, `lon` (degrees, WGS 84), and,
where known, `address` (24-bit, six hex digits, with `~` before one not of ICAO; `000000` and `ffffff` are none),
`callsign`, `speed_mps`, `course_deg`, `altitude_m` (above the airport), `on_ground` (left out when unknown: then the
altitude decides, and without one the target is held to be on the ground), `category` (`aircraft`, `vehicle`,
`unknown`), `accuracy_m`, `simulated`, `source` (the sensor or feed that it came through, such as `adsb` or `mlat-1`: at
most 16 ASCII letters, digits, `_`, `-` and `.`). Other members are ignored.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from app.ingest.wire_json import BadMessage, Parsed, columns_of, number, parse_rows, unix_time
from pipeline.airport.frame import LocalFrame
from pipeline.tables import TargetCategory, TargetReports

_ADDRESS = re.compile(r"~?[0-9a-f]{6}")
_NO_ADDRESS = frozenset({"000000", "ffffff"})
"""What transmitters send whose address was never set, or cannot be read."""

_CALLSIGN_PADDING = "@_\0 \t\r\n"
"""What stands in a callsign where nothing is: the sign of value 0 in Mode S, as decoders write it, and blanks."""

_CALLSIGN = re.compile(r"[A-Z0-9 _.-]{0,8}")
_SOURCE = re.compile(r"[A-Za-z0-9_.-]{0,16}")


class TargetReportRow(msgspec.Struct):
    """One report on the wire; what is not known is left out or null."""

    time: Annotated[float | int | str, Meta(description="Unix seconds, or ISO 8601 with zone")]
    lat: Annotated[float | int, Meta(description="degrees, WGS 84")]
    lon: Annotated[float | int, Meta(description="degrees, WGS 84")]
    address: Annotated[
        str | None, Meta(description="24-bit address, six hexadecimal digits, with ~ before one not of ICAO")
    ] = None
    callsign: Annotated[str | None, Meta(description="at most eight letters and digits")] = None
    speed_mps: Annotated[float | int | None, Meta(description="over ground")] = None
    course_deg: Annotated[float | int | None, Meta(description="over ground, clockwise from true north")] = None
    altitude_m: Annotated[float | int | None, Meta(description="above the airport")] = None
    on_ground: Annotated[bool | None, Meta(description="null when unknown: the altitude decides")] = None
    category: Literal["unknown", "aircraft", "vehicle"] = "unknown"
    accuracy_m: Annotated[float | int, Meta(description="standard deviation of each coordinate")] = 7.5
    simulated: bool = False
    source: Annotated[
        str | None, Meta(description="sensor or feed: at most 16 ASCII letters, digits, `_`, `-` and `.`")
    ] = None


def parse_target_reports(body: bytes, frame: LocalFrame, limit: int = 1000) -> Parsed[TargetReports]:
    """The reports in a JSON body, in its order, in local metres.

    Raises BadMessage (a Refused) that says what is wrong, when nothing of it can be taken.
    """
    parsed = parse_rows(body, TargetReportRow, limit, "report", _columns)
    columns = columns_of(parsed.rows)
    east, north = frame.to_local(np.array(columns.pop("lat", [])), np.array(columns.pop("lon", [])))
    return parsed.holding(TargetReports.build(len(parsed.rows), east=east, north=north, **columns))


def _columns(row: TargetReportRow, where: str) -> dict[str, Any]:
    """The columns of one report, but with its place in degrees."""
    return {
        "time": unix_time(row.time, where),
        "lat": number(row.lat, "lat", where, -90, 90),
        "lon": number(row.lon, "lon", where, -180, 180),
        "address": _address(row.address, where),
        "callsign": _callsign(row.callsign, where),
        "accuracy": number(row.accuracy_m, "accuracy_m", where, 0.01, 1e4),
        "altitude": number(row.altitude_m, "altitude_m", where, -1e3, 3e4),
        "speed": number(row.speed_mps, "speed_mps", where, 0, 1e3),
        "course": math.radians(number(row.course_deg, "course_deg", where, -360, 360) % 360.0),
        "on_ground": row.on_ground is not False,
        "ground_known": row.on_ground is not None,
        "category": TargetCategory[row.category.upper()],
        "simulated": row.simulated,
        "source": _source(row.source, where),
    }


def _address(text: str | None, where: str) -> str:
    address = (text or "").strip().lower()
    if not address or address.removeprefix("~") in _NO_ADDRESS:
        return ""
    if not _ADDRESS.fullmatch(address):
        raise BadMessage("bad_value", f"{where}: address must be six hexadecimal digits, with ~ before one not of ICAO")
    return address


def _callsign(text: str | None, where: str) -> str:
    trimmed = (text or "").strip(_CALLSIGN_PADDING).upper()
    if not _CALLSIGN.fullmatch(trimmed):
        raise BadMessage("bad_value", f"{where}: callsign must be at most eight letters and digits")
    return trimmed


def _source(text: str | None, where: str) -> str:
    if text is not None and not _SOURCE.fullmatch(text):
        raise BadMessage("bad_value", f"{where}: source must be at most 16 letters, digits, '_', '-' and '.'")
    return text or ""
