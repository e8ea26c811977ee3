"""Published designators stand, however they are written and whatever the direction says."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pipeline.airport.frame import LocalFrame
from pipeline.airport.geojson import airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.airport.osm import airport_geojson
from pipeline.airport.osm.designators import opposite_designator, read_designators
from tests.pipeline.airport.extracts import extract, node, runway, taxiway, way


def made(*elements: Any) -> tuple[dict[str, Any], Airport]:
    document = airport_geojson(extract(*elements), "TEST")
    return document, airport_from_geojson(document)


def along(degrees: float) -> list[tuple[float, float]]:
    """A runway of 2400 m in this direction, drawn from its start."""
    east, north = 1200 * math.sin(math.radians(degrees)), 1200 * math.cos(math.radians(degrees))
    return [(-east, -north), (east, north)]


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("06/24", ("06", "24")), ("6-24", ("06", "24")), ("RWY 09/27", ("09", "27")), ("Runway 09/27", ("09", "27")),
        ("09 / 27", ("09", "27")), ("09–27", ("09", "27")), ("09;27", ("09", "27")), ("24", ("24", "06")),
        ("RWY 24L", ("24L", "06R")), ("09L/27R;09/27", ("09L", "27R")), ("09 L/27 R", ("09L", "27R")),
        ("09T/27T", ("09T", "27T")), ("17w/35w", ("17W", "35W")), ("09G/27G", ("09G", "27G")), ("01U", ("01U", "19U")),
        ("09LS/27RS", ("09LS", "27RS")), ("NE/SW", ("NE", "SW")), ("e-w", ("E", "W")),
        ("", None), ("Piste 4", None), ("41/59", None), ("00/18", None), ("A1", None), ("W37", None), ("2019-05", None),
        ("Main", None), ("N", None),
    ],
)  # fmt: skip
def test_what_mappers_write(text: str, read: tuple[str, str] | None) -> None:
    assert read_designators(text) == read


@pytest.mark.parametrize(
    ("one", "other"), [("06", "24"), ("36", "18"), ("09L", "27R"), ("17RT", "35LT"), ("NNE", "SSW")]
)
def test_the_other_end(one: str, other: str) -> None:
    assert opposite_designator(one) == other
    assert opposite_designator(other) == one


@pytest.mark.parametrize("ref", ["09T/27T", "09W/27W", "09G/27G", "09U/27U", "09LS/27RS", "E/W", "10/28", "09L/27L"])
def test_letters_and_neighbouring_numbers_are_kept(ref: str) -> None:
    document, airport = made(runway(ref=ref))
    assert airport.runways[0].id == ref
    assert not document["import"]["derived"]
    assert math.degrees(airport.runways[0].ends[0].heading) == pytest.approx(90, abs=0.1)


@pytest.mark.parametrize("key", ["name", "official_name", "alt_name"])
def test_a_name_gives_the_designators_when_the_reference_does_not(key: str) -> None:
    document, airport = made(runway(ref="", **{key: "Runway 10/28 (North)"}))
    assert airport.runways[0].id == "10/28"
    assert not document["import"]["derived"]
    assert made(runway(ref="09/27", **{key: "Runway 10/28"}))[1].runways[0].id == "09/27"
    assert made(runway(ref="", **{key: "Runway 4"}))[1].runways[0].id == "09/27"


def test_the_area_gives_the_designators_when_the_line_does_not() -> None:
    ring = [(-1210, -30), (1210, -30), (1210, 30), (-1210, 30), (-1210, -30)]
    _, airport = made(runway(ref=""), way(ring, aeroway="runway", area="yes", ref="10/28"))
    assert [one.id for one in airport.runways] == ["10/28"]


@pytest.mark.parametrize("drawn_backwards", [False, True])
@pytest.mark.parametrize("variation", [-56, -30, 12, 40, 75])
def test_published_designators_stand_whatever_the_variation(variation: int, drawn_backwards: bool) -> None:
    """Designators count from magnetic north: at 56 degrees of variation runway 14 lies along 084 or 196 true."""
    points = along(140 + variation)
    document, airport = made(runway(points[::-1] if drawn_backwards else points, ref="14/32"))
    (one,) = airport.runways
    assert one.id == "14/32"
    assert math.degrees(one.end("14").heading) == pytest.approx((140 + variation) % 360, abs=0.2)
    assert not document["import"]["derived"]
    told = [line for line in document["import"]["to_check"] if "14/32" in line]
    assert bool(told) is (abs(variation) > 25)


def test_what_cannot_be_the_designators_of_a_runway_is_replaced_and_told() -> None:
    document, airport = made(runway(ref="18/36"))
    assert airport.runways[0].id == "09/27"
    assert any("18/36" in line and "09/27" in line for line in document["import"]["to_check"])


@pytest.mark.parametrize("longitude", [166.7, -68.0, 90.0])
@pytest.mark.parametrize("drawn_backwards", [False, True])
def test_grid_north_in_the_antarctic(longitude: float, drawn_backwards: bool) -> None:
    """Grid directions are true ones plus the longitude: runway 15 at McMurdo lies along 343 true, not 163."""
    frame, points = LocalFrame(-77.9, longitude), along(150 - longitude)[:: -1 if drawn_backwards else 1]
    latitude, east = frame.to_geodetic([p[0] for p in points], [p[1] for p in points])
    line = [{"lat": float(a), "lon": float(b)} for a, b in zip(latitude, east, strict=True)]
    strip = {"type": "way", "id": 1, "geometry": line, "tags": {"aeroway": "runway", "ref": "15/33"}}
    airport = airport_from_geojson(airport_geojson(extract(strip), "NZFX"))
    assert airport.runways[0].id == "15/33"
    assert math.degrees(airport.runways[0].end("15").heading) == pytest.approx((150 - longitude) % 360, abs=0.2)


def test_two_runways_of_one_name_are_told() -> None:
    document, airport = made(runway(), runway([(-600, -500), (600, -500)]))
    assert {one.id for one in airport.runways} == {"09/27", "09/27-2"}
    assert any("09/27-2" in line for line in document["import"]["to_check"])


@pytest.mark.parametrize("ref", ["09T-27T", "A1@09/27", "09/27"])
def test_a_holding_position_names_its_runway_with_or_without_the_letters(ref: str) -> None:
    _, airport = made(
        runway(ref="09T/27T"),
        runway([(-1200, -400), (1200, -400)], ref="08/26"),
        taxiway([(0, 0), (0, -400)], ref="X"),
        node((0, -230), aeroway="holding_position", holding_position__type="runway", ref=ref),
    )
    hold = next(one for one in airport.holding_positions if not one.derived)
    assert hold.runway == "09T/27T"
    assert hold.name == ("A1" if "@" in ref else "X")


def test_the_name_of_a_taxiway_is_no_runway() -> None:
    _, airport = made(
        runway([(0, -1200), (0, 1200)], ref="01/19"),
        taxiway([(0, 0), (300, 0)], ref="X"),
        node((110, 0), aeroway="holding_position", holding_position__type="runway", ref="1A"),
    )
    assert [one.name for one in airport.holding_positions] == ["1A"]
