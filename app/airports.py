"""The airports: those that are shipped, by ICAO code, and imported ones, by path."""

from __future__ import annotations

import difflib
import json
from pathlib import Path
from typing import Any

from pipeline.airport.geojson import AirportFault, airport_from_geojson
from pipeline.airport.model import Airport

SHIPPED = Path(__file__).resolve().parent / "data" / "airports"


class AirportNotFound(AirportFault):
    """No airport is shipped under this code, and no file is at this path."""


def shipped_airports() -> dict[str, Path]:
    """The maps that come with the program, by ICAO code."""
    return {one.stem: one for one in sorted(SHIPPED.glob("*.geojson"))}


def load_airport(name_or_path: str) -> tuple[Airport, dict[str, Any]]:
    """The airport called so (ICAO code of a shipped one, or the path of a GeoJSON file), and its document.

    Raises AirportNotFound, or AirportFault when the file is no airport map; the message names the file.
    """
    path = _find(name_or_path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise AirportFault(f"{path}: cannot be read as GeoJSON ({error})") from error
    try:
        return airport_from_geojson(document), document
    except AirportFault as error:
        raise AirportFault(f"{path}: {error}") from error


def _find(name_or_path: str) -> Path:
    known = shipped_airports()
    code = name_or_path.strip().upper()
    if code in known:
        return known[code]
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return path
    close = difflib.get_close_matches(code, known, n=1, cutoff=0.5)
    hint = f"; did you mean {close[0]}?" if close else ""
    raise AirportNotFound(
        f"no airport {name_or_path!r}: it is neither a shipped one ({', '.join(known) or 'none'}) nor a file{hint} "
        "(make one with `airside airport import FILE.osm.json --icao CODE`)"
    )
