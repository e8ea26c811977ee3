"""What must hold for the airports that are shipped, and for one that is not."""

from __future__ import annotations

import copy
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from app.airports import AirportNotFound, load_airport, shipped_airports
from app.cli import app
from pipeline.airport.geojson import AirportFault, airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.airport.osm import airport_geojson
from pipeline.airport.surfaces import surface_of_radar, surface_raster
from pipeline.airport.taxi_graph import components, nearest_node, shortest_path
from pipeline.airport.zones import ZoneMap
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

EXTRACT = Path(__file__).parent / "data" / "EHLE.osm.json"


@cache
def airport(code: str) -> Airport:
    if code == "EHLE":
        return airport_from_geojson(airport_geojson(json.loads(EXTRACT.read_text()), "EHLE"))
    return load_airport(code)[0]


@cache
def zone_map(code: str) -> ZoneMap:
    return ZoneMap.build(airport(code))


every = pytest.mark.parametrize("code", ["LFPO", "LSZH", "EHLE"])


def test_the_runways_that_are_there_in_truth() -> None:
    assert {one.id for one in airport("LFPO").runways} == {"06/24", "07/25", "02/20"}
    assert {one.id for one in airport("LSZH").runways} == {"10/28", "14/32", "16/34"}
    assert {one.id for one in airport("EHLE").runways} == {"05/23"}
    lengths = {one.id: one.centreline.length for one in airport("LFPO").runways}
    assert lengths == pytest.approx({"06/24": 3650, "07/25": 3320, "02/20": 2400}, abs=5)


@every
def test_runway_ends_agree_with_their_designators(code: str) -> None:
    for runway in airport(code).runways:
        assert runway.strip.is_valid
        for end in runway.ends:
            assert runway.end(end.designator) is end
            turn = math.degrees(end.heading) - 10 * int(end.designator[:2])
            assert abs((turn + 180) % 360 - 180) < 15
        assert math.cos(runway.ends[0].heading - runway.ends[1].heading) == pytest.approx(-1)
        first = shapely.Point(runway.centreline.coords[0])
        assert first.distance(runway.ends[0].threshold) < first.distance(runway.ends[1].threshold)


@every
def test_every_hold_lies_beside_its_runway_and_looks_towards_it(code: str) -> None:
    assert len(airport(code).holding_positions) >= 10
    for hold in airport(code).holding_positions:
        runway = airport(code).runway(hold.runway)
        assert 25 < runway.strip.distance(hold.position) + runway.width / 2 < 300, hold.id
        nearest = runway.strip.exterior.interpolate(runway.strip.exterior.project(hold.position))
        towards = math.atan2(nearest.x - hold.position.x, nearest.y - hold.position.y)
        assert math.cos(hold.heading - towards) > -0.25, hold.id
        assert hold.line.distance(hold.position) < 0.1
        along = np.subtract(hold.line.coords[-1], hold.line.coords[0])
        assert abs(along @ [math.sin(hold.heading), math.cos(hold.heading)]) < 0.05 * hold.line.length
        assert not any(one.strip.intersects(hold.line) for one in airport(code).runways), hold.id


@every
def test_who_waits_at_a_hold_is_outside_the_protection_area(code: str) -> None:
    for hold in airport(code).holding_positions:
        if hold.category == "CAT_I":
            runway = airport(code).runway(hold.runway)
            behind = shapely.Point(
                hold.position.x - 20 * math.sin(hold.heading), hold.position.y - 20 * math.cos(hold.heading)
            )
            assert not runway.protection["normal"].covers(behind), hold.id
            if runway.centreline.distance(hold.position) < 180:
                ahead = shapely.Point(2 * hold.position.x - behind.x, 2 * hold.position.y - behind.y)
                assert runway.protection["normal"].covers(ahead), hold.id


@every
def test_protection_covers_the_runway_and_grows_in_low_visibility(code: str) -> None:
    for runway in airport(code).runways:
        for area in runway.protection.values():
            assert area.is_valid
            assert area.covers(runway.strip.buffer(-1))
        assert runway.protection["low"].area > runway.protection["normal"].area


@pytest.mark.parametrize("code", ["LFPO", "LSZH"])
def test_every_named_stand_reaches_every_runway(code: str) -> None:
    graph = airport(code).graph
    part = components(graph)
    kinds = {one: airport(code).features[edge[3]].kind for edge in graph.edges for one in edge[:2]}
    assert np.mean(part == 0) > 0.99
    runway_nodes = {
        node for edge in graph.edges for node in edge[:2] if airport(code).features[edge[3]].kind == "PaintedCenterline"
    }
    assert all(part[one] == 0 for one in runway_nodes)
    stands = [edge for edge in graph.edges if airport(code).features[edge[3]].kind == "StandGuidanceLine"]
    assert np.mean([part[edge[0]] == 0 for edge in stands]) > 0.98
    assert len(kinds) == len(graph.nodes)


@every
def test_edges_join_their_nodes(code: str) -> None:
    graph = airport(code).graph
    for start, end, length, feature, line in graph.edges:
        assert line.coords[0] == pytest.approx(graph.nodes[start])
        assert line.coords[-1] == pytest.approx(graph.nodes[end])
        assert length == pytest.approx(line.length)
        owner = airport(code).features[feature].geometry
        if airport(code).features[feature].kind != "StandGuidanceLine":
            assert owner.distance(line.interpolate(0.5, normalized=True)) < 40


def test_a_route_from_a_stand_to_a_runway_is_joined_and_no_longer_than_scipy_finds() -> None:
    from scipy.sparse.csgraph import dijkstra

    from pipeline.airport.taxi_graph import adjacency

    field = airport("LFPO")
    stand = next(one for one in field.features if one.kind == "ParkingStandLocation" and one.name)
    threshold = field.runway("06/24").ends[1].threshold
    start = nearest_node(field.graph, stand.geometry.x, stand.geometry.y)
    goal = nearest_node(field.graph, threshold.x, threshold.y)
    route = shortest_path(field.graph, start, goal)
    assert route is not None
    assert route.line is not None
    assert route.line.length == pytest.approx(route.length)
    assert route.line.coords[0] == pytest.approx(field.graph.nodes[start])
    assert route.line.coords[-1] == pytest.approx(field.graph.nodes[goal])
    assert len(route.edges) == len(route.nodes) - 1
    assert route.length == pytest.approx(dijkstra(adjacency(field.graph), indices=start)[goal])


def test_no_route_between_parts_that_do_not_meet() -> None:
    from pipeline.airport.model import TaxiGraph

    line = shapely.LineString([(0, 0), (1, 0)])
    graph = TaxiGraph(((0.0, 0.0), (1.0, 0.0), (9.0, 0.0)), ((0, 1, 1.0, 0, line),))
    assert shortest_path(graph, 0, 2) is None
    own = shortest_path(graph, 1, 1)
    assert own is not None
    assert own.line is None


@given(st.floats(-4000, 4000), st.floats(-4000, 4000))
def test_frame_round_trip(east: float, north: float) -> None:
    frame = airport("LFPO").frame
    assert frame.to_local(*frame.to_geodetic(east, north)) == pytest.approx((east, north), abs=1e-3)


@every
def test_zone_look_ups_against_shapely(code: str) -> None:
    """Away from the borders by a cell, raster and geometry give one answer."""
    zones, field = zone_map(code), airport(code)
    random = np.random.default_rng(7)
    paved = [one.geometry for one in field.features if one.kind in ("TaxiwayElement", "ApronElement", "Building")]
    centres = shapely.get_coordinates(shapely.point_on_surface(paved))
    spots = np.vstack([centres + random.normal(0, 30, centres.shape), random.uniform(-2500, 2500, (500, 2))])
    points = shapely.points(spots)
    for index, runway in enumerate(field.runways):
        others = [one.strip for one in field.runways if one is not runway]
        clear = ~shapely.dwithin(points, runway.strip.buffer(5, join_style="mitre").exterior, 2.0)
        clear &= ~shapely.dwithin(points, shapely.unary_union(others), 8.0) if others else True
        inside = shapely.contains(runway.strip.buffer(5, join_style="mitre"), points)
        answer = zones.runway(spots[:, 0], spots[:, 1])
        assert np.array_equal((answer == index)[clear], inside[clear])
    found = zones.zone(spots[:, 0], spots[:, 1])
    step = zones.grid.step
    for spot, zone in zip(points, found, strict=True):
        if zone >= 0:
            assert field.features[zone].geometry.distance(spot) < step * 1.5
    assert (found >= 0).sum() > 50


def test_zone_look_ups_outside_the_map_and_of_nan() -> None:
    zones = zone_map("LFPO")
    for odd in (1e9, -1e9, math.nan, math.inf):
        assert zones.zone(odd, 0.0) == -1
        assert zones.runway(odd, 0.0) == -1
        assert zones.kind(0.0, odd) == 0
    assert zones.zone(np.zeros(3), np.zeros(3)).dtype == np.int32
    assert zones.runway(np.zeros(3), np.zeros(3)).dtype == np.int16


def test_the_middle_of_a_runway_is_that_runway() -> None:
    for index, runway in enumerate(airport("LFPO").runways):
        spot = runway.centreline.interpolate(0.25, normalized=True)
        assert zone_map("LFPO").runway(spot.x, spot.y) == index
        assert airport("LFPO").features[zone_map("LFPO").zone(spot.x, spot.y)].name == runway.id
        assert zone_map("LFPO").kind(spot.x, spot.y) == 1


def test_radar_surfaces_agree_with_the_square_raster() -> None:
    site = RadarSite("r", 100.0, -50.0, 20.0, VideoFormat(azimuths=512, ranges=256, range_step_m=12.0))
    polar = surface_of_radar(airport("LFPO"), site)
    assert polar.shape == (512, 256)
    square = surface_raster(airport("LFPO"), -3300, -3300, 3.0, (2200, 2200))
    row, cell = np.meshgrid(np.arange(512), np.arange(256), indexing="ij")
    azimuth = (row + 0.5) * 2 * np.pi / 512
    column = np.floor((100 + np.sin(azimuth) * cell * 12 + 3300) / 3).astype(int)
    line = np.floor((-50 + np.cos(azimuth) * cell * 12 + 3300) / 3).astype(int)
    assert np.mean(polar == square[line, column]) > 0.985
    assert set(np.unique(polar)) >= {0, 1, 2, 3, 4}


def test_shipped_airports_carry_their_licence() -> None:
    assert {"LFPO", "LSZH"} <= set(shipped_airports())
    for code in shipped_airports():
        loaded, document = load_airport(code.lower())
        assert "OpenStreetMap contributors" in document["attribution"]
        assert loaded.attribution == document["attribution"]
        assert loaded.icao == code
        assert [one.id for one in loaded.features] == [one["properties"]["id"] for one in document["features"]]


def test_an_unknown_airport_is_named_with_the_nearest() -> None:
    with pytest.raises(AirportNotFound, match="did you mean LFPO"):
        load_airport("LFPOO")


def test_a_file_that_is_no_map_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.geojson"
    path.write_text("{")
    with pytest.raises(AirportFault, match=r"x\.geojson"):
        load_airport(str(path))
    path.write_text("[]")
    with pytest.raises(AirportFault, match="FeatureCollection"):
        load_airport(str(path))


def _broken(change: str) -> Any:
    document = copy.deepcopy(airport_geojson(json.loads(EXTRACT.read_text()), "EHLE"))
    by_kind = {one["properties"]["kind"]: one for one in document["features"]}
    exec(change, {"document": document, "kind": by_kind, "nan": math.nan})
    return document


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("document.pop('reference')", "reference"),
        ("document['reference']['latitude'] = 123", "earth"),
        ("document['features'] = []", "features"),
        ("document['features'].append(3)", "not a GeoJSON feature"),
        ("document['features'].append(document['features'][0])", "two features"),
        ("document['features'][0]['properties'].pop('kind')", "kind"),
        ("document['features'][0]['geometry'] = None", "geometry"),
        ("document['features'][0]['geometry']['coordinates'] = [[[1, 'x']]]", "geometry"),
        ("kind['RunwayThreshold']['properties']['designator'] = '99'", "RunwayThreshold"),
        ("kind['PaintedCenterline']['properties']['runway'] = '01/19'", "PaintedCenterline"),
        ("kind['RunwayElement']['properties']['designators'] = '05'", "designators"),
        ("kind['RunwayElement']['properties']['width_m'] = 'wide'", "width_m"),
        ("kind['TaxiwayHoldingPosition']['properties']['runway'] = '01/19'", "01/19"),
        ("kind['TaxiwayHoldingPosition']['properties']['heading_deg'] = nan", "heading_deg"),
        ("kind['TaxiwayHoldingPosition']['properties']['category'] = 'CAT_9'", "CAT_9"),
        ("kind['TaxiwayHoldingPosition']['geometry'] = {'type': 'Point', 'coordinates': [5, 52]}", "LineString"),
    ],
)
def test_a_bad_map_is_refused_with_the_feature_and_the_fault(change: str, message: str) -> None:
    with pytest.raises(AirportFault, match=message):
        airport_from_geojson(_broken(change))


def test_command_line(tmp_path: Path) -> None:
    target = tmp_path / "EHLE.geojson"
    run = CliRunner().invoke(app, ["airport", "import", str(EXTRACT), "--icao", "ehle", "--output", str(target)])
    assert run.exit_code == 0, run.output
    assert "TaxiwayHoldingPosition" in run.output
    assert "Derived" in run.output
    shown = CliRunner().invoke(app, ["airport", "show", str(target)])
    assert "Runway 05/23  2700 x 45 m" in shown.output
    assert "LFPO  Paris-Orly" in CliRunner().invoke(app, ["airport", "list"]).output
    failed = CliRunner().invoke(app, ["airport", "import", str(target), "--icao", "EHLE"])
    assert failed.exit_code == 1
    assert "Overpass" in failed.output
