from __future__ import annotations

import math
from typing import Any

import pytest
from shapely.geometry import LineString, Point

from pipeline.airport.geojson import airport_from_geojson
from pipeline.airport.model import Airport, HoldingPosition
from pipeline.airport.osm import airport_geojson
from tests.pipeline.airport.extracts import extract, node, runway, taxiway


def made(*elements: Any) -> Airport:
    return airport_from_geojson(airport_geojson(extract(*elements), "TEST"))


def north_of_runway(hold: HoldingPosition, airport: Airport) -> float:
    return hold.position.y - airport.runways[0].centreline.coords[0][1]


ENTRY = taxiway([(0, 0), (0, 150), (0, 300)], ref="A1")
PARALLEL = taxiway([(-1200, 300), (0, 300), (1200, 300)], ref="A")


@pytest.mark.parametrize(("length", "distance"), [(2400, 90), (1600, 75), (1000, 40), (600, 40)])
def test_a_missing_hold_is_derived_at_the_distance_of_the_code(length: float, distance: float) -> None:
    airport = made(runway([(-length / 2, 0), (length / 2, 0)]), ENTRY, PARALLEL)
    (hold,) = airport.holding_positions
    assert hold.derived
    assert hold.name == "A1"
    assert hold.runway == "09/27"
    assert hold.category == "CAT_I"
    assert distance - 0.1 <= north_of_runway(hold, airport) <= distance + 4.1
    assert math.degrees(hold.heading) == pytest.approx(180, abs=0.5)
    start, end = (Point(one) for one in hold.line.coords)
    assert start.distance(end) == pytest.approx(hold.line.length)
    assert abs(start.y - end.y) < 0.2


def test_a_mapped_hold_is_taken_and_none_derived() -> None:
    hold_node = node((0, 110), aeroway="holding_position", holding_position__type="runway", ref="A1@09/27")
    (hold,) = made(runway(), ENTRY, PARALLEL, hold_node).holding_positions
    assert not hold.derived
    assert hold.name == "A1"
    assert math.degrees(hold.heading) == pytest.approx(180, abs=0.5)


def test_an_ils_hold_is_of_category_two_and_three_and_does_not_spare_the_other() -> None:
    airport = made(runway(), ENTRY, PARALLEL, node((0, 160), aeroway="holding_position", holding_position__type="ILS"))
    categories = {one.category: one for one in airport.holding_positions}
    assert set(categories) == {"CAT_I", "CAT_II_III"}
    assert categories["CAT_I"].derived
    assert not categories["CAT_II_III"].derived


def test_an_intermediate_hold_guards_no_runway() -> None:
    document = airport_geojson(
        extract(
            runway(),
            ENTRY,
            PARALLEL,
            node((500, 300), aeroway="holding_position", holding_position__type="intermediate"),
            node((900, 300), aeroway="holding_position"),
        ),
        "TEST",
    )
    kinds = [one["properties"]["kind"] for one in document["features"]]
    assert kinds.count("TaxiwayIntersectionMarking") == 2
    assert [one.derived for one in airport_from_geojson(document).holding_positions] == [True]


def test_a_hold_between_two_runways_guards_the_one_its_taxiway_leads_to_first() -> None:
    """The southern hold is nearer to the southern runway; each looks towards its own."""
    airport = made(
        runway(ref="09L/27R"),
        runway([(-1200, -500), (1200, -500)], ref="09R/27L"),
        taxiway([(0, 0), (0, -500)], ref="X"),
        node((0, -110), aeroway="holding_position", holding_position__type="runway"),
        node((0, -390), aeroway="holding_position", holding_position__type="runway"),
    )
    found = {one.runway: round(math.degrees(one.heading)) for one in airport.holding_positions}
    assert found == {"09L/27R": 0, "09R/27L": 180}
    assert not any(one.derived for one in airport.holding_positions)


def test_the_named_runway_wins_over_the_nearer_one() -> None:
    airport = made(
        runway(ref="09L/27R"),
        runway([(-1200, -400), (1200, -400)], ref="09R/27L"),
        taxiway([(0, 0), (0, -400)], ref="X"),
        node((0, -190), aeroway="holding_position", holding_position__type="runway", ref="09R-27L"),
    )
    hold = next(one for one in airport.holding_positions if not one.derived)
    assert hold.runway == "09R/27L"
    assert math.degrees(hold.heading) == pytest.approx(180, abs=1)
    assert hold.name == "X"


def test_a_rapid_exit_with_a_hold_further_out_needs_no_other() -> None:
    exit = taxiway([(-400, 0), (-300, 20), (0, 200), (0, 300)], ref="E")
    airport = made(
        runway(), exit, PARALLEL, node((0, 230), aeroway="holding_position", holding_position__type="runway")
    )
    assert [one.derived for one in airport.holding_positions] == [False]


def test_two_joining_taxiways_with_a_hold_each_need_no_other() -> None:
    airport = made(
        runway(),
        taxiway([(0, 0), (0, 120)]),
        taxiway([(0, 120), (-60, 200), (-60, 300)]),
        taxiway([(0, 120), (60, 200), (60, 300)]),
        PARALLEL,
        node((-60, 200), aeroway="holding_position", holding_position__type="runway"),
        node((60, 200), aeroway="holding_position", holding_position__type="runway"),
    )
    assert [one.derived for one in airport.holding_positions] == [False, False]


def test_a_taxiway_alongside_within_the_distance_is_not_cut_by_holds() -> None:
    """At small aerodromes the parallel taxiway lies within the hold distance: hold before it, not along it."""
    parallel = taxiway([(-1200, 70), (0, 70), (1200, 70)], ref="A")
    airport = made(runway(), parallel, taxiway([(0, 0), (0, 70)]), taxiway([(-1200, 0), (-1200, 70)]))
    assert len(airport.holding_positions) in (2, 3)
    for hold in airport.holding_positions:
        assert 30 < north_of_runway(hold, airport) < 70
        assert min(abs(hold.position.x - x) for x in (0, -1200)) < 3
    taxiing = Point(600, airport.runways[0].centreline.coords[0][1] + 70)
    assert not airport.runways[0].protection["normal"].covers(taxiing)


def test_without_taxiways_a_hold_looks_at_the_runway() -> None:
    airport = made(runway(), node((300, 95), aeroway="holding_position"), node((300, 2000), aeroway="holding_position"))
    (hold,) = airport.holding_positions
    assert math.degrees(hold.heading) == pytest.approx(180, abs=0.5)


def test_a_hold_given_twice_is_one() -> None:
    twice = [node((0, 110 + step), aeroway="holding_position", holding_position__type="runway") for step in (0, 1)]
    assert len(made(runway(), ENTRY, PARALLEL, *twice).holding_positions) == 1


def test_protection_reaches_to_the_holds_and_beyond_the_ends() -> None:
    airport = made(runway(), ENTRY, PARALLEL)
    (one,) = airport.runways
    middle = one.centreline.coords[0][1]
    normal, low = one.protection["normal"], one.protection["low"]
    for area, distance in ((normal, 90), (low, 150)):
        west, south, east, north = area.bounds
        assert (west, east) == pytest.approx((-1260, 1260), abs=1)
        assert (south - middle, north - middle) == pytest.approx((-distance, distance), abs=6)
    waiting = LineString([(0, middle + 115), (0, middle + 130)])
    assert not normal.intersects(waiting)
    assert not low.intersects(waiting), "who waits at the only hold of a taxiway is not inside in low visibility either"
    assert low.covers(Point(300, middle + 130))


@pytest.mark.parametrize("distance", [70, 110, 160])
def test_whoever_has_passed_the_hold_is_inside_wherever_it_was_painted(distance: float) -> None:
    """Some holds are painted far out (158 to 177 m at Orly): the area follows the taxiway to them, round a bend too."""
    bent = taxiway([(0, 0), (0, 100), (120, 220), (120, 300)], ref="A1")
    spot = (0, distance) if distance <= 100 else (distance - 100, distance)
    hold = node(spot, aeroway="holding_position", holding_position__type="runway")
    airport = made(runway(), bent, PARALLEL, hold)
    (found,) = airport.holding_positions
    ahead = (math.sin(found.heading), math.cos(found.heading))
    area = airport.runways[0].protection["normal"]
    for step in (12, 24, 36):
        assert area.covers(Point(found.position.x + step * ahead[0], found.position.y + step * ahead[1]))
        assert not area.covers(Point(found.position.x - step * ahead[0], found.position.y - step * ahead[1]))


def test_distances_are_parameters() -> None:
    document = airport_geojson(extract(runway()), "TEST")
    airport = airport_from_geojson(document, normal_distance=60, low_visibility_distance=120, beyond_ends=10)
    assert airport.runways[0].protection["normal"].area == pytest.approx(120 * 2420, rel=1e-3)
    assert airport.runways[0].protection["low"].area == pytest.approx(240 * 2420, rel=1e-3)
