"""Free text decides nothing, no runway is an error, and whatever is lost is listed with the reason."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.airport.frame import LocalFrame
from pipeline.airport.geojson import AirportFault, airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.airport.osm import ImportFault, airport_geojson
from pipeline.airport.osm.elements import elevation_of
from tests.pipeline.airport.extracts import extract, node, runway, taxiway, way


def made(*elements: Any, **more: Any) -> tuple[dict[str, Any], Airport]:
    document = airport_geojson(extract(*elements), "TEST", **more)
    return document, airport_from_geojson(document)


FIELD = [(-1500, -600), (1500, -600), (1500, 600), (-1500, 600), (-1500, -600)]


@pytest.mark.parametrize("key", ["description", "note", "fixme", "comment", "name", "operator"])
@pytest.mark.parametrize("text", ["Main runway, also used by helicopters", "FATO", "model aircraft fly here", "closed"])
def test_free_text_decides_nothing(key: str, text: str) -> None:
    document, airport = made(runway(**{key: text}))
    assert [one.id for one in airport.runways] == ["09/27"]
    assert document["import"]["left_out"] == {}


@pytest.mark.parametrize(
    "tags",
    [{"ref": "H01/H19"}, {"ref": "14H/32H"}, {"sport": "model_aerodrome"}, {"runway": "fato"}, {"usage": "helicopter"}],
    ids=str,
)
def test_what_is_tagged_for_helicopters_or_models_is_left_out_and_named(tags: dict[str, str]) -> None:
    strip = way([(0, 300), (900, 300)], aeroway="runway", **tags)
    document, airport = made(runway(), strip)
    assert len(airport.runways) == 1
    assert document["import"]["left_out"] == {"runway for helicopters or models": 1}
    assert any(f"way/{strip['id']}" in line and "helicopters" in line for line in document["import"]["to_check"])
    assert len(made(runway(usage="aeroplane;helicopter"))[1].runways) == 1


def test_a_short_strip_without_designators_beside_a_runway_is_left_out_and_named() -> None:
    strip = way([(0, 300), (440, 300)], aeroway="runway", surface="grass")
    document, airport = made(runway(), strip)
    assert len(airport.runways) == 1
    assert document["import"]["left_out"] == {"short strip without designators": 1}
    assert any(f"way/{strip['id']}" in line for line in document["import"]["to_check"])
    assert [one.id for one in made(strip)[1].runways] == ["09/27"], "where it is all there is, it is the runway"
    named = way([(0, 300), (440, 300)], aeroway="runway", ref="08/26")
    assert len(made(runway(), named)[1].runways) == 2


@pytest.mark.parametrize("value", ["runway;taxiway", "taxiway;runway", "taxiway; runway", "parking_position;runway"])
def test_a_runway_that_is_something_else_as_well_is_a_runway(value: str) -> None:
    document, airport = made(way([(-1200, 0), (1200, 0)], aeroway=value, ref="09/27"))
    assert [one.id for one in airport.runways] == ["09/27"]
    (told,) = document["import"]["not_used"]
    assert told.endswith("beside runway")


@pytest.mark.parametrize(
    ("value", "kind"), [("taxiway;parking_position", "TaxiwayGuidanceLine"), ("hangar;apron", "ApronElement")]
)
def test_several_values_of_other_things(value: str, kind: str) -> None:
    points = [(0, 200), (60, 200), (60, 260), (0, 260), (0, 200)]
    document, _ = made(runway(), way(points, aeroway=value))
    assert document["import"]["counts"][kind] == 1


def test_what_the_map_has_no_use_for_is_listed() -> None:
    document, _ = made(
        runway(), node((0, 200), aeroway="windsock"), node((0, 210), aeroway="windsock"),
        way([(0, 300), (60, 300)], aeroway="taxyway"),
    )  # fmt: skip
    assert document["import"]["not_used"] == {"aeroway=taxyway": 1, "aeroway=windsock": 2}


def test_positions_drawn_twice_are_counted() -> None:
    twice = [node((0, 110 + step), aeroway="holding_position", holding_position__type="runway") for step in (0, 1)]
    document, _ = made(runway(), taxiway([(0, 0), (0, 300)]), *twice)
    assert document["import"]["left_out"] == {"holding position drawn twice": 1}


@pytest.mark.parametrize(
    ("elements", "reason"),
    [
        ([taxiway([(0, 0), (0, 300)])], "nothing"),
        ([way([(0, 300), (100, 300)], aeroway="runway"), taxiway([(0, 0), (0, 300)])], "1 x runway too short"),
        ([runway(ref="14H/32H"), taxiway([(0, 0), (0, 300)])], "1 x runway for helicopters"),
        ([runway(closed="yes"), taxiway([(0, 0), (0, 300)])], "1 x runway not in use"),
        ([runway(runway="closed"), taxiway([(0, 0), (0, 300)])], "1 x runway not in use"),
        ([node((0, 0), aeroway="runway"), taxiway([(0, 0), (0, 300)])], "1 x runway that is only a point"),
        ([{"type": "way", "id": 7, "tags": {"aeroway": "runway"}}, taxiway([(0, 0), (0, 300)])], "1 x no geometry"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_no_runway_is_an_error_that_says_what_was_left_out(elements: list[Any], reason: str) -> None:
    with pytest.raises(ImportFault, match=f"no runway in the result; left out:.*{reason}"):
        airport_geojson(extract(*elements), "TEST")


def test_without_taxiways_and_holding_positions_the_import_says_so() -> None:
    document, _ = made(runway())
    told = " ".join(document["import"]["to_check"])
    assert "no taxiway" in told
    assert "no holding position" in told


@pytest.mark.parametrize(("longitude", "latitude"), [(180.0, -16.7), (-179.995, 51.9), (179.98, 70.0), (0.0, 51.5)])
def test_an_airport_on_the_antimeridian_is_in_one_piece(longitude: float, latitude: float) -> None:
    frame = LocalFrame(latitude, longitude)

    def line(id: int, points: list[tuple[float, float]], **tags: str) -> dict[str, Any]:
        north, east = frame.to_geodetic([p[0] for p in points], [p[1] for p in points])
        geometry = [{"lat": float(a), "lon": float(b)} for a, b in zip(north, east, strict=True)]
        return {"type": "way", "id": id, "geometry": geometry, "tags": tags}

    document, airport = made(
        line(1, [(-1200, 0), (900, 0), (1200, 0)], aeroway="runway", ref="09/27", width="45"),
        line(2, [(-1200, 200), (0, 200), (1200, 200)], aeroway="taxiway", ref="A"),
        line(3, [(0, 0), (0, 200)], aeroway="taxiway", ref="A1"),
        line(4, [(-300, 250), (300, 250), (300, 450), (-300, 450), (-300, 250)], aeroway="apron"),
    )
    assert document["import"]["left_out"] == {}
    (one,) = airport.runways
    assert one.centreline.length == pytest.approx(2400, abs=0.5)
    assert abs(one.centreline.centroid.x) < 0.5
    assert [hold.name for hold in airport.holding_positions] == ["A1"]
    (apron,) = (feature for feature in airport.features if feature.kind == "ApronElement")
    assert apron.geometry.area == pytest.approx(600 * 200, rel=1e-3)
    off = (document["reference"]["longitude"] - longitude + 180) % 360 - 180
    assert abs(off) < 1e-4
    assert -180 <= document["reference"]["longitude"] <= 180


@pytest.mark.parametrize(
    ("text", "value"),
    [("432", 432.0), ("-3.7", -3.7), ("431,6 m", 431.6), ("1416 ft", 431.6), ("291'", 88.7), ("", None), (None, None),
     ("high", None), ("99999", None), ("-1000", None), ("12;13", None)],
)  # fmt: skip
def test_elevations_as_mappers_write_them(text: str | None, value: float | None) -> None:
    assert elevation_of(text) == (None if value is None else pytest.approx(value, abs=0.05))


def test_the_elevation_is_that_of_the_aerodrome_or_its_highest_runway_or_given() -> None:
    field = way(FIELD, aeroway="aerodrome", icao="TEST", ele="432")
    neighbour = way([(p[0] + 9000, p[1]) for p in FIELD], aeroway="aerodrome", icao="NEAR", ele="900")
    second = runway([(-600, 300), (600, 300)], ref="08/26", ele="428.5")
    hangar = way([(0, 400), (50, 400), (50, 450), (0, 400)], aeroway="hangar", building="yes", ele="500")
    assert made(runway(ele="427"), second, field, neighbour, hangar)[0]["elevation_m"] == 432.0
    of_a_runway, _ = made(runway(ele="427"), second, neighbour, hangar)
    assert of_a_runway["elevation_m"] == 428.5
    assert any("428.5 m is that of the highest runway" in line for line in of_a_runway["import"]["to_check"])
    assert made(runway(ele="427"), field, elevation=-3.0)[0]["elevation_m"] == -3.0
    unknown, _ = made(runway(), neighbour, hangar)
    assert "elevation_m" not in unknown
    assert any("--elevation" in line for line in unknown["import"]["to_check"])
    with pytest.raises(ImportFault, match="elevation"):
        made(runway(), elevation=30_000.0)


@pytest.mark.parametrize("elevation", ["432", True, float("nan"), [1]])
def test_a_map_whose_elevation_is_no_number_is_refused(elevation: Any) -> None:
    document, _ = made(runway())
    with pytest.raises(AirportFault, match="elevation_m"):
        airport_from_geojson({**document, "elevation_m": elevation})
    assert airport_from_geojson({**document, "elevation_m": None}).runways
