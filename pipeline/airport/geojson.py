"""The map as GeoJSON in, the `Airport` of the rest of the system out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from shapely.errors import ShapelyError
from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, Feature, HoldingPosition, Runway, RunwayEnd
from pipeline.airport.protection import protection_areas
from pipeline.airport.runway_access import taxi_lanes
from pipeline.airport.taxi_graph import build_taxi_graph


class AirportFault(ValueError):
    """The document is not a usable airport map; the message names the feature and what is wrong with it."""


def airport_from_geojson(
    document: dict[str, Any],
    *,
    normal_distance: float | None = None,
    low_visibility_distance: float | None = None,
    beyond_ends: float = 60.0,
) -> Airport:
    """The airport in local metres. `features` keeps the order and the number of the document's features.

    normal_distance, low_visibility_distance: metres from the centreline that the runway protection areas reach; by
    default those of each runway (by its code number: 90 and 150 m at code 4). beyond_ends: metres they reach beyond
    both ends. Raises AirportFault.
    """
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        raise AirportFault('not an airport map: a GeoJSON object with "type": "FeatureCollection" is wanted')
    raw = document.get("features")
    if not isinstance(raw, list) or not raw:
        raise AirportFault('the map has no "features"')
    frame = _frame(document)
    _check_elevation(document.get("elevation_m"))
    features = tuple(_feature(one, place, frame) for place, one in enumerate(raw))
    repeated = _repeated([one.id for one in features])
    if repeated:
        raise AirportFault(f"two features are called {repeated!r}")
    runways = _runways(features)
    holds = tuple(_hold(one, runways) for one in features if one.kind == "TaxiwayHoldingPosition")
    graph = build_taxi_graph(features)
    areas = protection_areas(
        runways,
        holds,
        taxi_lanes(features, graph),
        {one.id: _distances(features, one.id, normal_distance, low_visibility_distance) for one in runways},
        beyond_ends,
    )
    runways = tuple(Runway(one.id, one.ends, one.centreline, one.width, one.strip, areas[one.id]) for one in runways)
    icao = str(document.get("icao") or "")
    name = str(document.get("name") or icao)
    return Airport(icao, name, frame, runways, holds, features, graph, str(document.get("attribution") or ""))


def _frame(document: dict[str, Any]) -> LocalFrame:
    reference = document.get("reference")
    try:
        latitude, longitude = float(reference["latitude"]), float(reference["longitude"])  # type: ignore[index]
    except (TypeError, KeyError, ValueError) as error:
        raise AirportFault('the map has no "reference": {"latitude": ..., "longitude": ...}') from error
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise AirportFault(f"the reference point ({latitude}, {longitude}) is not on the earth")
    return LocalFrame(latitude, longitude)


def _check_elevation(value: Any) -> None:
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AirportFault(f'"elevation_m" must be metres above mean sea level, not {value!r}')


def _feature(raw: Any, place: int, frame: LocalFrame) -> Feature:
    if not isinstance(raw, dict) or not isinstance(raw.get("properties"), dict):
        raise AirportFault(f"feature {place} is not a GeoJSON feature with properties")
    properties = dict(raw["properties"])
    id, kind = str(properties.pop("id", raw.get("id") or "")), properties.pop("kind", None)
    if not id or not isinstance(kind, str):
        raise AirportFault(f'feature {place} has no "id" or no "kind"')
    name = str(properties.pop("name", "") or "")
    try:
        geometry = shapely.geometry.shape(raw["geometry"])
        local = shapely.transform(geometry, lambda points: np.column_stack(frame.to_local(points[:, 1], points[:, 0])))
    except (ShapelyError, ValueError, TypeError, AttributeError, KeyError, IndexError) as error:
        raise AirportFault(f"feature {id}: its geometry cannot be read ({error})") from error
    if local.is_empty or not np.isfinite(shapely.get_coordinates(local)).all():
        raise AirportFault(f"feature {id}: its geometry is empty or not finite")
    if isinstance(local, Polygon | MultiPolygon) and not local.is_valid:
        local = shapely.make_valid(local)
    return Feature(id, kind, name, local, properties)


def _repeated(ids: list[str]) -> str | None:
    seen: set[str] = set()
    for one in ids:
        if one in seen:
            return one
        seen.add(one)
    return None


def _runways(features: tuple[Feature, ...]) -> tuple[Runway, ...]:
    lines = {one.properties.get("runway"): one for one in features if one.kind == "PaintedCenterline"}
    thresholds = {
        (one.properties.get("runway"), one.properties.get("designator")): one
        for one in features
        if one.kind == "RunwayThreshold"
    }
    made: list[Runway] = []
    for element in features:
        if element.kind != "RunwayElement" or element.properties.get("status", "open") != "open":
            continue
        id = element.properties.get("runway")
        if not isinstance(id, str) or id not in lines:
            raise AirportFault(f"runway {element.id} has no PaintedCenterline with the same runway")
        if any(one.id == id for one in made):
            raise AirportFault(f"two runway elements say that they are runway {id}")
        line = _as(LineString, lines[id])
        strip = element.geometry
        if isinstance(strip, MultiPolygon):
            strip = max(strip.geoms, key=lambda one: one.area)
        if not isinstance(strip, Polygon) or line.length < 1.0:
            raise AirportFault(f"runway {id} needs a polygon and a centreline with length")
        names = element.properties.get("designators")
        if not isinstance(names, list) or len(names) != 2:
            raise AirportFault(f'runway {id} has no "designators" (two names)')
        ends = tuple(
            _end(id, str(name), thresholds, line, back) for name, back in zip(names, (False, True), strict=True)
        )
        width = _number(element, "width_m") if "width_m" in element.properties else strip.area / line.length
        made.append(Runway(id, (ends[0], ends[1]), line, width, strip, {}))
    return tuple(made)


def _end(
    id: str, designator: str, thresholds: dict[tuple[Any, Any], Feature], line: LineString, back: bool
) -> RunwayEnd:
    found = thresholds.get((id, designator))
    if found is None:
        raise AirportFault(f"runway {id} has no RunwayThreshold {designator}")
    first, last = (line.coords[-1], line.coords[0]) if back else (line.coords[0], line.coords[-1])
    heading = math.atan2(last[0] - first[0], last[1] - first[1]) % (2 * math.pi)
    return RunwayEnd(designator, _as(Point, found), heading)


def _hold(feature: Feature, runways: tuple[Runway, ...]) -> HoldingPosition:
    line = _as(LineString, feature)
    runway = feature.properties.get("runway")
    if runway not in {one.id for one in runways}:
        raise AirportFault(f"holding position {feature.id} guards {runway!r}, and no runway is called so")
    category = feature.properties.get("category", "CAT_I")
    if category not in ("CAT_I", "CAT_II_III"):
        raise AirportFault(f"holding position {feature.id}: category {category!r} is neither CAT_I nor CAT_II_III")
    heading = math.radians(_number(feature, "heading_deg")) % (2 * math.pi)
    position = line.interpolate(0.5, normalized=True)
    derived = bool(feature.properties.get("derived", False))
    return HoldingPosition(feature.id, feature.name, position, line, heading, str(runway), category, derived)


def _as(kind: type[Any], feature: Feature) -> Any:
    if not isinstance(feature.geometry, kind):
        raise AirportFault(f"{feature.kind} {feature.id} must be a {kind.__name__}, not a {feature.geometry.geom_type}")
    return feature.geometry


def _number(feature: Feature, key: str) -> float:
    value = feature.properties.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AirportFault(f'{feature.kind} {feature.id}: "{key}" must be a number, not {value!r}')
    return float(value)


def _distances(features: tuple[Feature, ...], id: str, normal: float | None, low: float | None) -> dict[str, float]:
    element = next(one for one in features if one.kind == "RunwayElement" and one.properties.get("runway") == id)
    made = {"normal": normal, "low": low}
    for visibility, key, default in (("normal", "hold_distance_m", 90.0), ("low", "low_visibility_distance_m", 150.0)):
        if made[visibility] is None:
            made[visibility] = _number(element, key) if key in element.properties else default
    return {key: float(value or 0.0) for key, value in made.items()}
