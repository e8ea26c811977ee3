from __future__ import annotations

import math
from typing import Any

import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapely.geometry import shape

from pipeline.airport.geojson import airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.airport.osm import ImportFault, airport_geojson
from tests.pipeline.airport.extracts import extract, node, positions, relation, runway, taxiway, way


def made(*elements: Any) -> tuple[dict[str, Any], Airport]:
    document = airport_geojson(extract(*elements), "TEST")
    return document, airport_from_geojson(document)


def of_kind(document: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    return [one["properties"] for one in document["features"] if one["properties"]["kind"] == kind]


def test_a_plain_runway() -> None:
    document, airport = made(runway())
    (one,) = airport.runways
    assert one.id == "09/27"
    assert [end.designator for end in one.ends] == ["09", "27"]
    assert math.degrees(one.ends[0].heading) == pytest.approx(90, abs=0.1)
    assert math.degrees(one.ends[1].heading) == pytest.approx(270, abs=0.1)
    assert one.centreline.length == pytest.approx(2400, abs=0.5)
    assert one.strip.area == pytest.approx(2400 * 45, rel=1e-3)
    assert one.ends[0].threshold.distance(shapely.Point(one.centreline.coords[0])) < 0.1
    assert document["reference"] == {"latitude": pytest.approx(48, abs=1e-5), "longitude": pytest.approx(2, abs=1e-5)}
    assert "OpenStreetMap" in document["attribution"]


@pytest.mark.parametrize("points", [[(-1200, 0), (1200, 0)], [(1200, 0), (-1200, 0)]])
def test_the_first_end_is_the_lower_designator_whichever_way_it_was_drawn(points: Any) -> None:
    _, airport = made(runway(points, ref="27/09"))
    assert airport.runways[0].ends[0].designator == "09"
    assert airport.runways[0].ends[0].threshold.x < airport.runways[0].ends[1].threshold.x


@pytest.mark.parametrize(
    ("text", "width", "derived"),
    [("45", 45, False), ("60 m", 60, False), ("150 ft", 45.72, False), ("148'", 45.11, False), ("45;60", 45, False),
     ("", 45, True), ("wide", 45, True), ("4500", 45, True), ("-3", 45, True)],
)  # fmt: skip
def test_widths(text: str, width: float, derived: bool) -> None:
    document, _ = made(runway(width=text))
    (element,) = of_kind(document, "RunwayElement")
    assert element["width_m"] == pytest.approx(width, abs=0.01)
    assert element["width_derived"] is derived


@pytest.mark.parametrize("ref", ["", "Piste 4", "18/36", "41/59", "09/28"])
def test_missing_and_odd_designators_come_from_the_heading(ref: str) -> None:
    document, airport = made(runway(ref=ref))
    assert airport.runways[0].id == "09/27"
    assert of_kind(document, "RunwayElement")[0]["designators_derived"] is True


def test_one_designator_gives_the_other() -> None:
    _, airport = made(runway(ref="9L"))
    assert airport.runways[0].id == "09L/27R"


def test_unnamed_parallel_runways_are_told_apart_by_side() -> None:
    _, airport = made(runway(ref=""), runway([(-1200, -800), (1200, -800)], ref=""))
    north = next(one for one in airport.runways if one.centreline.centroid.y > 0)
    assert north.id == "09L/27R"
    assert {one.id for one in airport.runways} == {"09L/27R", "09R/27L"}


def test_a_runway_cut_in_several_ways_is_one() -> None:
    parts = [[(-1200, 0), (-300, 0)], [(-300, 0), (10, 0)], [(10, 0), (1200, 0)]]
    _, airport = made(*(runway(points) for points in parts))
    assert len(airport.runways) == 1
    assert airport.runways[0].centreline.length == pytest.approx(2400, abs=0.5)


def test_the_same_name_elsewhere_is_not_joined() -> None:
    _, airport = made(runway(), runway([(-1000, 900), (1000, 900)]))
    assert len(airport.runways) == 2
    assert len({one.id for one in airport.runways}) == 2


def test_displaced_threshold_and_stopway() -> None:
    document, airport = made(
        runway([(-900, 0), (1200, 0)]),
        way([(-1200, 0), (-900, 0)], aeroway="runway", runway="displaced_threshold"),
        way([(1200, 0), (1260, 0)], aeroway="stopway"),
    )
    (one,) = airport.runways
    assert one.centreline.length == pytest.approx(2400, abs=0.5)
    assert one.ends[0].threshold.x == pytest.approx(one.centreline.coords[0][0] + 300, abs=0.5)
    assert one.ends[1].threshold.distance(shapely.Point(one.centreline.coords[-1])) < 0.1
    assert len(of_kind(document, "Stopway")) == 1
    assert len(of_kind(document, "RunwayDisplacedArea")) == 1


def test_a_threshold_node_displaces_its_own_end_only() -> None:
    _, airport = made(runway(), node((-1050, 1), aeroway="threshold", ref="09"))
    first, second = airport.runways[0].ends
    assert first.threshold.x == pytest.approx(airport.runways[0].centreline.coords[0][0] + 150, abs=0.5)
    assert second.threshold.distance(shapely.Point(airport.runways[0].centreline.coords[-1])) < 0.1


def test_runway_drawn_as_an_area_only() -> None:
    area = [(-1200, -22), (1200, -22), (1200, 22), (-1200, 22), (-1200, -22)]
    _, airport = made(runway(area, width=""))
    assert airport.runways[0].id == "09/27"
    assert airport.runways[0].width == pytest.approx(44, abs=0.2)
    assert airport.runways[0].centreline.length == pytest.approx(2400, abs=1)


def test_runway_drawn_as_line_and_area_is_one() -> None:
    area = [(-1210, -30), (1210, -30), (1210, 30), (-1210, 30), (-1210, -30)]
    _, airport = made(runway(), way(area, aeroway="runway", area="yes"))
    assert len(airport.runways) == 1
    assert airport.runways[0].strip.area == pytest.approx(2420 * 60, rel=1e-3)


def test_runways_out_of_use_are_no_runways() -> None:
    document, airport = made(
        runway(),
        way([(-600, 500), (600, 500)], disused__aeroway="runway", ref="08/26"),
        way([(-600, 700), (600, 700)], aeroway="runway", disused="yes"),
        way([(-600, 900), (600, 900)], aeroway="construction", construction="runway"),
        way([(-600, 1100), (600, 1100)], proposed__aeroway="runway"),
    )
    assert [one.id for one in airport.runways] == ["09/27"]
    assert [one["status"] for one in of_kind(document, "RunwayElement")] == ["closed", "closed", "open"]
    assert len(of_kind(document, "ConstructionArea")) == 2


def test_helicopter_and_short_runways_are_left_out_and_counted() -> None:
    document, airport = made(
        runway(),
        way([(0, 300), (400, 300)], aeroway="runway", ref="H01/H19"),
        way([(0, 400), (100, 400)], aeroway="runway"),
        way([(0, 500), (20, 500), (20, 520), (0, 500)], aeroway="helipad"),
    )
    assert len(airport.runways) == 1
    assert document["import"]["left_out"] == {"runway for helicopters or models": 1, "runway too short": 1}


def test_multipolygon_with_split_outer_ways_and_a_hole() -> None:
    document, _ = made(
        runway(),
        relation(
            [
                ("outer", [(0, 200), (400, 200), (400, 500)]),
                ("outer", [(0, 200), (0, 500), (400, 500)]),
                ("inner", [(100, 300), (200, 300), (200, 400), (100, 400), (100, 300)]),
            ],
            aeroway="apron",
            name="K",
        ),
    )
    airport = airport_from_geojson(document)
    (apron,) = (one for one in airport.features if one.kind == "ApronElement")
    assert apron.geometry.area == pytest.approx(400 * 300 - 100 * 100, rel=1e-3)


def test_a_multipolygon_that_does_not_close_is_counted() -> None:
    document, _ = made(runway(), relation([("outer", [(0, 200), (400, 200), (400, 500)])], aeroway="apron"))
    assert document["import"]["left_out"] == {"no usable shape": 1}


def test_building_heights() -> None:
    def building(north: float, **tags: str) -> dict[str, Any]:
        return way([(0, north), (50, north), (50, north + 40), (0, north + 40), (0, north)], **tags)

    document, _ = made(
        runway(),
        building(300, building="yes", height="23 m"),
        building(400, building="office", building__levels="5"),
        building(500, aeroway="hangar", building="yes"),
        building(600, building="yes", location="underground"),
    )
    told, levels, hangar = of_kind(document, "Building")
    assert (told["height_m"], told["height_derived"]) == (23.0, False)
    assert (levels["height_m"], levels["height_derived"]) == (18.0, True)
    assert hangar["use"] == "hangar"
    assert hangar["height_derived"] is True


def test_stands_get_a_stop_and_an_area_at_the_end_away_from_the_taxiway() -> None:
    document, airport = made(
        runway(),
        taxiway([(-500, 200), (500, 200)], ref="A"),
        way([(100, 280), (100, 200)], aeroway="parking_position", ref="12"),
    )
    (stop,) = (one for one in airport.features if one.kind == "ParkingStandLocation")
    (area,) = (one for one in airport.features if one.kind == "ParkingStandArea")
    assert stop.name == area.name == "12"
    assert stop.geometry.y == pytest.approx(280 + airport.runways[0].centreline.coords[0][1], abs=0.5)
    assert stop.properties["heading_deg"] == pytest.approx(0, abs=0.5)
    assert area.geometry.covers(stop.geometry)
    assert document["import"]["derived"]["ParkingStandArea"] == 1


def test_what_belongs_to_a_neighbour_or_lies_far_away_is_left_out() -> None:
    def aerodrome(west: float, **tags: str) -> dict[str, Any]:
        box = [(west, -600), (west + 3000, -600), (west + 3000, 600), (west, 600), (west, -600)]
        return way(box, aeroway="aerodrome", **tags)

    document, airport = made(
        aerodrome(-1500, icao="TEST", name="Test Field"),
        aerodrome(1600, icao="NEAR"),
        runway(),
        runway([(1700, 100), (4000, 100)], ref="08/26"),
        way([(0, 4000), (30, 4000), (30, 4030), (0, 4000)], building="yes"),
        way([(0, 90000), (30, 90000), (30, 90030), (0, 90000)], building="yes"),
    )
    assert [one.id for one in airport.runways] == ["09/27"]
    assert airport.name == "Test Field"
    left_out = document["import"]["left_out"]
    assert left_out["belongs to another aerodrome"] >= 1
    assert left_out["not near the pavement"] == 1
    assert left_out["far away"] == 1


@pytest.mark.parametrize(
    "document",
    [None, [], {}, {"elements": {}}, {"elements": []}, {"elements": [1, None, "x"]}, extract(way([(0, 0), (9, 0)]))],
    ids=str,
)
def test_what_is_no_airport_is_refused_with_a_reason(document: Any) -> None:
    with pytest.raises(ImportFault, match=r"extract"):
        airport_geojson(document, "TEST")


def test_a_wrong_icao_code_is_refused() -> None:
    with pytest.raises(ImportFault, match="ICAO"):
        airport_geojson(extract(runway()), "../etc")


def test_broken_elements_are_dropped_and_counted() -> None:
    cut_off = runway([(-1200, 0), (0, 0), (1200, 0)])
    cut_off["geometry"].insert(1, None)
    lost = {"type": "way", "id": 9, "tags": {"aeroway": "taxiway"}, "geometry": [{"lat": float("nan"), "lon": 2.0}]}
    document, airport = made(cut_off, lost, {"type": "area"}, cut_off, {"type": "node", "id": 1, "lat": 1, "lon": 1})
    assert len(airport.runways) == 1
    assert document["import"]["left_out"] == {
        "element repeated": 1,
        "no geometry": 1,
        "no tags": 1,
        "not an element": 1,
    }


coordinate = st.one_of(st.none(), st.floats(), st.integers(-200, 200), st.floats(47.98, 48.02), st.text(max_size=2))
position = st.one_of(
    st.none(),
    st.fixed_dictionaries({}, optional={"lat": coordinate, "lon": coordinate}),
    st.tuples(st.floats(-2000, 2000), st.floats(-2000, 2000)).map(lambda point: positions([point])[0]),
)
words = st.sampled_from(
    ["runway", "taxiway", "taxilane", "apron", "parking_position", "holding_position", "stopway", "aerodrome",
     "terminal", "hangar", "tower", "threshold", "helipad", "displaced_threshold", "yes", "no", "disused",
     "construction", "ILS", "09/27", "09L", "36/18", "45", "45 m", "1e9", "-1", "0", "", "H1", "multipolygon"]
)  # fmt: skip
keys = st.sampled_from(
    ["aeroway", "ref", "width", "runway", "building", "height", "building:levels", "area", "disused", "disused:aeroway",
     "construction", "holding_position:type", "highway", "layer", "type", "area:aeroway", "name", "icao"]
)  # fmt: skip
tags = st.dictionaries(
    keys, st.one_of(words, st.text(max_size=5), st.none(), st.integers(), st.lists(words)), max_size=5
)
geometry = st.one_of(st.none(), st.lists(position, max_size=6), st.text(max_size=3)).map(
    lambda found: [*found, found[0]] if isinstance(found, list) and len(found) > 3 else found
)
member = st.one_of(
    st.none(),
    st.fixed_dictionaries({"type": st.sampled_from(["way", "node"]), "role": st.sampled_from(["outer", "inner", ""])},
                          optional={"geometry": geometry}),
)  # fmt: skip
anything = st.one_of(
    st.none(),
    st.fixed_dictionaries(
        {"type": st.sampled_from(["node", "way", "relation", "x"])},
        optional={"id": st.integers(0, 99), "tags": st.one_of(tags, st.none()), "geometry": geometry, "lat": coordinate,
                  "lon": coordinate, "members": st.one_of(st.none(), st.lists(member, max_size=4))},
    ),
)  # fmt: skip


@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(anything, max_size=12), st.booleans())
def test_any_extract_gives_a_valid_map_or_a_clear_refusal(elements: list[Any], with_runway: bool) -> None:
    if with_runway:
        elements = [runway(), taxiway([(0, 0), (0, 300)]), *elements]
    try:
        document = airport_geojson({"elements": elements}, "TEST")
    except ImportFault:
        return
    for feature in document["features"]:
        assert shape(feature["geometry"]).is_valid or feature["geometry"]["type"] in ("Polygon", "MultiPolygon")
    airport_from_geojson(document)
