"""Recorded target reports for the experiments that work on some."""

from __future__ import annotations

import gzip
from pathlib import Path
from statistics import median

from app.airports import load_airport
from app.demo.traffic import LARGEST, load_recording
from app.evaluate.recorded import name_of
from app.ingest.recording import RecordingError
from app.ingest.target_reports import TargetReportRow, parse_target_reports
from app.ingest.wire_json import BadMessage, decode_rows
from pipeline.airport.frame import LocalFrame
from pipeline.lab.evaluate import RecordedReports
from pipeline.lab.evaluate.reported_tracks import reports_of

SHIPPED = "LFPO"
"""The airport whose traffic record is shipped."""

MOST_REPORTS = 5_000_000
"""Reports of one file; two hours of a large airport are a tenth of it."""


def shipped_reports() -> RecordedReports:
    """What the aircraft of the shipped traffic record report. Raises RecordingError."""
    airport, _ = load_airport(SHIPPED)
    return RecordedReports(reports_of(load_recording(SHIPPED, airport)), smoothed=True, name=SHIPPED)


def recorded_reports(path: Path) -> RecordedReports:
    """The reports of a file, plain or gzipped: JSON as the service takes it (an array), or one such object a line.

    Local metres are counted from the median position of what is on the ground. Raises RecordingError.
    """
    try:
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            with gzip.open(path) as file:
                data = file.read(LARGEST + 1)
    except (OSError, EOFError) as error:
        raise RecordingError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    if len(data) > LARGEST:
        raise RecordingError(f"{path}: larger than {LARGEST // 1024 // 1024} MiB")
    body = data.strip()
    if body[:1] == b"{":
        body = b"[" + b",".join(line for line in body.splitlines() if line.strip()) + b"]"
    try:
        rows = decode_rows(body, TargetReportRow, MOST_REPORTS, "report")
        if not rows:
            raise RecordingError(f"{path}: has no target reports")
        ground = [one for one in rows if one.on_ground or (one.on_ground is None and not one.altitude_m)] or rows
        # what lies beyond a pole is refused by the row that says it
        latitude = min(max(median(float(one.lat) for one in ground), -90.0), 90.0)
        longitude = min(max(median(float(one.lon) for one in ground), -180.0), 180.0)
        parsed = parse_target_reports(body, LocalFrame(latitude, longitude), MOST_REPORTS)
    except BadMessage as error:
        raise RecordingError(f"{path}: {error}") from error
    if parsed.bad:
        raise RecordingError(f"{path}: {parsed.bad[0].message}")
    return RecordedReports(parsed.rows, name=name_of(path))
