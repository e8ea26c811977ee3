"""A small airport: one runway from west to east, a taxiway with a hold, an apron, a terminal; and a coarse radar."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, box

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, Feature, HoldingPosition, Runway, RunwayEnd, SurfaceKind, TaxiGraph
from pipeline.lab.simulate.paths import Truth
from pipeline.reference.types import NAMES, TYPES
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

FRAME = LocalFrame(48.7, 2.4)


def airport() -> Airport:
    line = LineString([(-1250.0, 0.0), (1250.0, 0.0)])
    strip = line.buffer(22.5, cap_style="flat")
    protection = {"normal": line.buffer(90.0), "low": line.buffer(150.0)}
    east, west = math.pi / 2, 3 * math.pi / 2
    runway = Runway(
        "09/27",
        (RunwayEnd("09", Point(-1250, 0), east), RunwayEnd("27", Point(1250, 0), west)),
        line,
        45.0,
        strip,
        protection,
    )
    hold = HoldingPosition("H1", "A1", Point(600, -90), LineString([(588, -90), (612, -90)]), 0.0, "09/27")
    taxi = LineString([(-800.0, -200.0), (600.0, -200.0)])
    spur = LineString([(600.0, -200.0), (600.0, 0.0)])
    features = (
        Feature("R", "RunwayElement", "09/27", strip),
        Feature("T", "TaxiwayElement", "A", taxi.buffer(12.0)),
        Feature("A", "ApronElement", "", box(-300, -500, 300, -215)),
        Feature("B", "Building", "", box(-150, -480, 150, -430), {"height_m": 15.0}),
        Feature("S", "StandGuidanceLine", "", LineString([(0, -330), (0, -410)])),
    )
    graph = TaxiGraph(
        ((-800.0, -200.0), (600.0, -200.0), (600.0, 0.0)),
        ((0, 1, taxi.length, 1, taxi), (1, 2, spur.length, 1, spur)),
    )
    return Airport("XXXX", "Test field", FRAME, (runway,), (hold,), features, graph)


def radar(azimuths: int = 512, ranges: int = 256, step: float = 6.0, height: float = 30.0) -> RadarSite:
    video = VideoFormat(azimuths, ranges, 0.0, step, math.radians(1.4), 1.0, 0.3125)
    return RadarSite("R1", 0.0, -900.0, height, video, simulated=True)


def uniform(site: RadarSite, kind: SurfaceKind = SurfaceKind.RUNWAY) -> NDArray[np.uint8]:
    return np.full((site.video.azimuths, site.video.ranges), int(kind), np.uint8)


def one_target(name: str, east: float, north: float, heading: float = 0.0, speed: float = 0.0, id: int = 1) -> Truth:
    kind = TYPES[name]
    return Truth.build(
        1,
        id=id,
        east=east,
        north=north,
        heading=heading,
        speed=speed,
        length=kind.length,
        width=kind.width,
        height=kind.height,
        type=NAMES.index(name),
        category=int(kind.category),
    )
