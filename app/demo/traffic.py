"""Traffic records: the recorded rows that they are made of, and the compact files that are shipped."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

from pipeline.airport.model import Airport
from pipeline.lab.simulate.recording import Recording, RecordingError, cut, from_document, to_document
from pipeline.lab.simulate.traffic import CleaningReport, busiest_window, clean

SHIPPED = Path(__file__).resolve().parent.parent / "data" / "traffic"
LARGEST = 512 * 1024 * 1024


def read_gzip_json(path: Path) -> Any:
    """The value in a gzipped (or plain) JSON file. Raises RecordingError when it cannot be read."""
    try:
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            with gzip.open(path) as file:
                data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise RecordingError(f"{path}: larger than {LARGEST // 1024 // 1024} MiB")
        return json.loads(data)
    except (OSError, EOFError, ValueError, RecursionError) as error:
        raise error if isinstance(error, RecordingError) else RecordingError(f"{path}: {error}") from error


def load_recording(name_or_path: str, airport: Airport) -> Recording:
    """The shipped record of an airport by its ICAO code, or the file at a path. Raises RecordingError."""
    shipped = SHIPPED / f"{name_or_path.strip().upper()}.json.gz"
    path = shipped if shipped.is_file() else Path(name_or_path).expanduser()
    if not path.is_file():
        known = ", ".join(sorted(one.name.split(".")[0] for one in SHIPPED.glob("*.json.gz"))) or "none"
        raise RecordingError(f"no traffic {name_or_path!r}: it is neither shipped ({known}) nor a file")
    document = read_gzip_json(path)
    if not isinstance(document, dict):
        raise RecordingError(f"{path}: not a traffic record")
    return from_document(document, airport.frame)


def prepare(path: Path, airport: Airport, length: float, attribution: str) -> tuple[Recording, CleaningReport, float]:
    """Clean the rows of a file and cut its busiest window: (record, what was left out, s from the first row to it).

    Raises RecordingError when the file holds no rows, or none near the airport.
    """
    rows = read_gzip_json(path)
    if not isinstance(rows, list) or not all(isinstance(one, dict) for one in rows):
        raise RecordingError(f"{path}: a list of rows was expected")
    times = [one["timestamp"] for one in rows if isinstance(one.get("timestamp"), int | float)]
    if not times:
        raise RecordingError(f"{path}: no row has a timestamp")
    begin = min(times) / 1e3
    trajectories, report = clean(rows, airport.frame, begin)
    if not trajectories:
        raise RecordingError(f"{path}: no aircraft moves near {airport.icao}")
    window = busiest_window(trajectories, length)
    kept = tuple(cut(trajectories, window, length))
    return Recording(airport.icao, begin + window, length, kept, attribution), report, window


def write_recording(path: Path, recording: Recording, airport: Airport, report: CleaningReport) -> int:
    """Write the compact file; its size in octets. The same record makes the same file."""
    account = {
        "rows": report.rows,
        "kept": report.kept,
        "left_out": report.left_out,
        "ground_pressure_altitude_ft": report.ground_pressure_altitude_ft,
    }
    text = json.dumps(to_document(recording, airport.frame, account), separators=(",", ":"))
    data = gzip.compress(text.encode(), 9, mtime=0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return len(data)
