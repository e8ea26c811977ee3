"""A small Orly by hand: two runways, a taxiway, an apron, a stand; for tests that need no imported map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from shapely import transform
from shapely.geometry import LineString, Point, box, mapping

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, Feature, HoldingPosition, Runway, RunwayEnd, TaxiGraph

FRAME = LocalFrame(48.7233, 2.3794)


def _runway(name: str, a: tuple[float, float], b: tuple[float, float], width: float) -> Runway:
    line = LineString([a, b])
    first, second = name.split("/")
    heading = math.atan2(b[0] - a[0], b[1] - a[1]) % (2 * math.pi)
    ends = (
        RunwayEnd(first, Point(a), heading),
        RunwayEnd(second, Point(b), (heading + math.pi) % (2 * math.pi)),
    )
    strip = line.buffer(width / 2, cap_style="flat")
    protection = {"normal": line.buffer(90, cap_style="square"), "low": line.buffer(150, cap_style="square")}
    return Runway(name, ends, line, width, strip, protection)


def small_airport() -> Airport:
    """Runways 06/24 and 02/20, taxiway W, apron, one stand, one holding position."""
    main = _runway("06/24", (-1700.0, -800.0), (1500.0, 900.0), 45.0)
    cross = _runway("02/20", (900.0, -1500.0), (1600.0, 700.0), 60.0)
    taxi = LineString([(-1500.0, -500.0), (1300.0, 1000.0)])
    features = (
        Feature("rwy-06-24", "RunwayElement", "06/24", main.strip),
        Feature("rwy-02-20", "RunwayElement", "02/20", cross.strip),
        Feature("twy-w", "TaxiwayElement", "W", taxi.buffer(15)),
        Feature("apron-1", "ApronElement", "", box(-600.0, 200.0, 300.0, 600.0)),
        Feature("stand-a1", "ParkingStandArea", "A1", box(-500.0, 400.0, -440.0, 460.0)),
        Feature("terminal", "Building", "Terminal", box(-500.0, 620.0, 200.0, 720.0)),
    )
    hold = HoldingPosition(
        "hold-w1", "W1", Point(-1450.0, -560.0), LineString([(-1465.0, -545.0), (-1435.0, -575.0)]), 2.6, "06/24"
    )
    return Airport("LFPO", "Paris-Orly (by hand)", FRAME, (main, cross), (hold,), features, TaxiGraph((), ()), "tests")


def as_geojson(airport: Airport) -> dict[str, Any]:
    """The features in WGS 84, longitude first."""

    def to_degrees(points: Any) -> Any:
        latitude, longitude = airport.frame.to_geodetic(points[:, 0], points[:, 1])
        return np.column_stack([longitude, latitude])

    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "id": one.id,
                "properties": {"kind": one.kind, "name": one.name},
                "geometry": mapping(transform(one.geometry, to_degrees)),
            }
            for one in airport.features
        ],
    }


def as_document(airport: Airport) -> dict[str, Any]:
    """The whole map, like a shipped one: `airport_from_geojson` reads the runways and holding positions from it."""

    def feature(id: str, kind: str, geometry: Any, **properties: Any) -> dict[str, Any]:
        there = transform(geometry, lambda points: np.column_stack(airport.frame.to_geodetic(*points.T)[::-1]))
        return {"type": "Feature", "id": id, "properties": {"kind": kind, **properties}, "geometry": mapping(there)}

    made = []
    for one in airport.features:
        runway = next((it for it in airport.runways if it.id == one.name), None)
        words = {"runway": runway.id, "designators": [it.designator for it in runway.ends]} if runway else {}
        made.append(feature(one.id, one.kind, one.geometry, name=one.name, **words))
    for runway in airport.runways:
        made.append(feature(f"line-{runway.id}", "PaintedCenterline", runway.centreline, runway=runway.id))
        for end in runway.ends:
            words = {"runway": runway.id, "designator": end.designator}
            made.append(feature(f"threshold-{end.designator}", "RunwayThreshold", end.threshold, **words))
    for hold in airport.holding_positions:
        words = {"name": hold.name, "runway": hold.runway, "heading_deg": math.degrees(hold.heading)}
        made.append(feature(hold.id, "TaxiwayHoldingPosition", hold.line, **words))
    reference = {"latitude": airport.frame.latitude, "longitude": airport.frame.longitude}
    return {"type": "FeatureCollection", "icao": airport.icao, "name": airport.name, "reference": reference,
            "features": made}  # fmt: skip
