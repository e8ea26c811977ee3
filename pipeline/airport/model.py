"""What an airport is to the rest of the system; made from GeoJSON by `pipeline.airport.geojson`."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.airport.frame import LocalFrame


class SurfaceKind(IntEnum):
    """What the ground is made of, as a radar sees it."""

    GRASS = 0
    RUNWAY = 1
    TAXIWAY = 2
    APRON = 3
    BUILDING = 4
    ROAD = 5
    WATER = 6


@dataclass(frozen=True)
class Feature:
    """One feature of the map. kind: AMDB name (RunwayElement, TaxiwayElement, ...). geometry: local metres."""

    id: str
    kind: str
    name: str
    geometry: BaseGeometry
    properties: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RunwayEnd:
    """One direction of a runway. heading: rad from true north of a landing in this direction."""

    designator: str
    threshold: Point
    heading: float


@dataclass(frozen=True)
class Runway:
    """A runway with both ends; `ends[0]` is at the start of `centreline`.

    id: "06/24". strip: the paved polygon. protection: runway protection area by visibility, "normal" and "low"
    (laterally to the holding positions of that visibility, longitudinally beyond both ends).
    """

    id: str
    ends: tuple[RunwayEnd, RunwayEnd]
    centreline: LineString
    width: float
    strip: Polygon
    protection: dict[str, Polygon]

    def end(self, designator: str) -> RunwayEnd:
        """The end called `designator`. Raises KeyError."""
        for one in self.ends:
            if one.designator == designator:
                return one
        raise KeyError(designator)


@dataclass(frozen=True)
class HoldingPosition:
    """Where traffic stops before a runway. heading: rad, of traffic that crosses it towards the runway.

    line: the bar across the taxiway. category: "CAT_I" or "CAT_II_III". derived: not in the source, put at the
    runway-code distance.
    """

    id: str
    name: str
    position: Point
    line: LineString
    heading: float
    runway: str
    category: str = "CAT_I"
    derived: bool = False


@dataclass(frozen=True)
class TaxiGraph:
    """The taxiway network. nodes: (east, north). edges: (from, to, length m, feature index, polyline)."""

    nodes: tuple[tuple[float, float], ...]
    edges: tuple[tuple[int, int, float, int, LineString], ...]


@dataclass(frozen=True)
class Airport:
    """The whole airport in local metres."""

    icao: str
    name: str
    frame: LocalFrame
    runways: tuple[Runway, ...]
    holding_positions: tuple[HoldingPosition, ...]
    features: tuple[Feature, ...]
    graph: TaxiGraph
    attribution: str = ""

    def runway(self, id: str) -> Runway:
        """The runway called `id`. Raises KeyError."""
        for one in self.runways:
            if one.id == id:
                return one
        raise KeyError(id)
