"""Small hand-made extracts: drawn in metres about a reference point, given as Overpass would."""

from __future__ import annotations

import itertools
from typing import Any

from pipeline.airport.frame import LocalFrame

FRAME = LocalFrame(48.0, 2.0)
Points = list[tuple[float, float]]
_numbers = itertools.count(1)


def positions(points: Points) -> list[dict[str, float]]:
    latitude, longitude = FRAME.to_geodetic([p[0] for p in points], [p[1] for p in points])
    return [{"lat": float(lat), "lon": float(lon)} for lat, lon in zip(latitude, longitude, strict=True)]


def way(points: Points, **tags: str) -> dict[str, Any]:
    return {"type": "way", "id": next(_numbers), "geometry": positions(points), "tags": _tags(tags)}


def node(point: tuple[float, float], **tags: str) -> dict[str, Any]:
    return {"type": "node", "id": next(_numbers), **positions([point])[0], "tags": _tags(tags)}


def relation(members: list[tuple[str, Points]], **tags: str) -> dict[str, Any]:
    made = [
        {"type": "way", "ref": next(_numbers), "role": role, "geometry": positions(points)} for role, points in members
    ]
    return {"type": "relation", "id": next(_numbers), "members": made, "tags": {"type": "multipolygon", **_tags(tags)}}


def extract(*elements: Any) -> dict[str, Any]:
    return {"version": 0.6, "elements": list(elements)}


def runway(points: Points | None = None, **tags: str) -> dict[str, Any]:
    """Runway 09/27, 2400 m, unless told otherwise."""
    return way(points or [(-1200, 0), (1200, 0)], aeroway="runway", **({"ref": "09/27", "width": "45"} | tags))


def taxiway(points: Points, **tags: str) -> dict[str, Any]:
    return way(points, aeroway="taxiway", **tags)


def _tags(tags: dict[str, str]) -> dict[str, str]:
    return {key.replace("__", ":"): value for key, value in tags.items()}
