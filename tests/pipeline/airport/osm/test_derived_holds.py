"""Derived holding positions: at the stated distance or with a warning, none where a mapped one guards."""

from __future__ import annotations

import math
from typing import Any

import pytest
from shapely.geometry import Point

from pipeline.airport.geojson import airport_from_geojson
from pipeline.airport.model import Airport, HoldingPosition
from pipeline.airport.osm import airport_geojson
from tests.pipeline.airport.extracts import extract, node, runway, taxiway

STATED = 90.0
STEP = 4.0
"""Metres between the points at which a derived position may lie."""


def made(*elements: Any) -> tuple[list[str], Airport]:
    document = airport_geojson(extract(*elements), "TEST")
    return document["import"]["to_check"], airport_from_geojson(document)


def away(hold: HoldingPosition, airport: Airport) -> float:
    return float(airport.runway(hold.runway).centreline.distance(hold.position))


def about(told: list[str]) -> list[str]:
    return [line for line in told if "holding position" in line]


def hold_node(*point: float, **tags: str) -> dict[str, Any]:
    return node((point[0], point[1]), aeroway="holding_position", **tags)


LAYOUTS = {
    "behind a junction": [
        taxiway([(0, 0), (0, 40)], ref="J"), taxiway([(0, 40), (-100, 200)], ref="K"),
        taxiway([(0, 40), (100, 200)], ref="L"),
    ],
    "behind a junction, one drawing away slowly": [
        taxiway([(0, 0), (0, 55)], ref="J"), taxiway([(0, 55), (-300, 120)], ref="K"),
        taxiway([(0, 55), (0, 200)], ref="L"),
    ],
    "on an exit of 12 degrees": [taxiway([(-600, 0), (-177, 90), (200, 170)], ref="X")],
    "off the end, straight on": [taxiway([(-1200, 0), (-1700, 0), (-1700, 400)], ref="E")],
    "off the end, to both sides": [
        taxiway([(-1200, 0), (-1250, 0)], ref="E"), taxiway([(-1250, -300), (-1250, 0), (-1250, 300)], ref="F")
    ],
    "off the end, round the corner": [
        taxiway([(-1180, 0), (-1210, 40), (-1250, 60), (-1290, 40), (-1300, 0), (-1300, -300)], ref="E")
    ],
}  # fmt: skip
HOLDS = {
    "behind a junction": ["K", "L"],
    "behind a junction, one drawing away slowly": ["K", "L"],
    "on an exit of 12 degrees": ["X"],
    "off the end, straight on": ["E"],
    "off the end, to both sides": ["F", "F"],
    "off the end, round the corner": ["E"],
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_one_on_each_lane_never_nearer_than_stated(layout: str) -> None:
    told, airport = made(runway(), *LAYOUTS[layout])
    assert sorted(one.name for one in airport.holding_positions) == HOLDS[layout]
    for hold in airport.holding_positions:
        assert STATED - 0.1 <= away(hold, airport) <= STATED + STEP + 0.1
    assert about(told) == []


@pytest.mark.parametrize("layout", LAYOUTS)
def test_who_has_passed_it_is_inside_and_who_waits_is_not(layout: str) -> None:
    _, airport = made(runway(), *LAYOUTS[layout])
    area = airport.runways[0].protection["normal"]
    for hold in airport.holding_positions:
        ahead = math.sin(hold.heading), math.cos(hold.heading)
        for metres in (8, 16, 24):
            inside = Point(hold.position.x + metres * ahead[0], hold.position.y + metres * ahead[1])
            waiting = Point(hold.position.x - metres * ahead[0], hold.position.y - metres * ahead[1])
            assert area.covers(inside), (hold.name, metres)
            assert not area.covers(waiting), (hold.name, metres)


def test_before_a_taxiway_alongside_it_is_nearer_and_the_import_says_so() -> None:
    """The parallel taxiway goes on beyond the end: a second position there would lie behind the first."""
    told, airport = made(
        runway(),
        taxiway([(-1500, 70), (-1200, 70), (0, 70), (1200, 70)], ref="A"),
        taxiway([(-1200, 0), (-1200, 70)], ref="A1"),
        taxiway([(0, 0), (0, 70)], ref="A2"),
    )
    assert sorted(one.name for one in airport.holding_positions) == ["A1", "A2"]
    for hold in airport.holding_positions:
        assert 30 < away(hold, airport) < 70
        (line,) = (one for one in about(told) if f"taxiway {hold.name} " in one)
        assert f"{away(hold, airport):.0f} m" in line
        assert "90 m" in line
    assert len(about(told)) == 2


def test_between_two_runways_without_room_none_is_made_and_the_import_says_so() -> None:
    told, airport = made(
        runway(ref="09L/27R"),
        runway([(-1200, -130), (1200, -130)], ref="09R/27L"),
        taxiway([(0, 0), (0, -130)], ref="X"),
    )
    assert airport.holding_positions == ()
    assert sum("taxiway X" in one and "no room" in one for one in told) == 2


def test_before_a_taxiway_between_two_runways_there_is_no_room() -> None:
    told, airport = made(
        runway(ref="09L/27R"),
        runway([(-1200, -130), (1200, -130)], ref="09R/27L"),
        taxiway([(0, 0), (0, -65)], ref="X"),
        taxiway([(-800, -65), (0, -65), (800, -65)], ref="P"),
    )
    assert airport.holding_positions == ()
    assert any("taxiway X" in one and "no room" in one for one in told)


def test_near_another_runway_it_lies_clear_of_both() -> None:
    """The ends of both runways are on one taxiway; at 90 m of the one, who waits would be 60 m from the other."""
    told, airport = made(
        runway([(0, 0), (2400, 0)]),
        runway([(0, -40), (2300, -840)], ref="11/29"),
        taxiway([(0, 0), (-60, 20), (-120, 0), (-120, -60), (-140, -400)], ref="A"),
        taxiway([(0, -40), (-60, -30), (-120, -60)], ref="A"),
    )
    assert {one.runway for one in airport.holding_positions} == {"09/27", "11/29"}
    for hold in airport.holding_positions:
        for one in airport.runways:
            assert one.centreline.distance(hold.position) >= STATED - 0.1, (hold.runway, one.id)
    assert not any("nearer than" in one for one in told)


@pytest.mark.parametrize(
    "elements",
    [
        [taxiway([(0, 0), (0, 700)], ref="A"), hold_node(0, 395, holding_position__type="runway")],
        [taxiway([(0, 0), (0, 300)], ref="A"), hold_node(0, 150)],
        [taxiway([(0, 0), (0, 300)], ref="A"), hold_node(30, 100, holding_position__type="runway")],
        [
            taxiway([(0, 0), (0, 120)]), taxiway([(0, 120), (-60, 200), (-60, 300), (0, 400)]),
            taxiway([(0, 120), (60, 200), (60, 300), (0, 400)]), taxiway([(-60, 200), (60, 200)]),
            taxiway([(0, 400), (0, 500)]), hold_node(0, 450, holding_position__type="runway", ref="09/27"),
            hold_node(0, 390, holding_position__type="runway"),
        ],
        [
            taxiway([(-300, 0), (0, 150), (300, 0)], ref="U"), taxiway([(0, 150), (0, 300)], ref="A"),
            hold_node(0, 180, holding_position__type="runway"),
        ],
    ],
    ids=["far out", "of no type, far out", "beside the taxiway", "ways part and meet", "the other way is an exit"],
)  # fmt: skip
def test_none_where_every_way_in_passes_a_mapped_one(elements: list[Any]) -> None:
    _, airport = made(runway(), *elements)
    assert len(airport.holding_positions) >= 1
    assert [one.name for one in airport.holding_positions if one.derived] == []
    assert {one.category for one in airport.holding_positions} == {"CAT_I"}


def test_one_where_a_way_in_passes_none() -> None:
    side = taxiway([(0, 150), (300, 150)], ref="B")
    _, airport = made(
        runway(),
        taxiway([(0, 0), (0, 150), (0, 300)], ref="A"),
        side,
        hold_node(0, 200, holding_position__type="runway"),
    )
    assert [one.derived for one in airport.holding_positions] == [False, True]


def test_one_where_the_way_in_comes_from_another_runway() -> None:
    _, airport = made(
        runway(ref="09L/27R"),
        runway([(-1200, -500), (1200, -500)], ref="09R/27L"),
        taxiway([(0, 0), (0, -500)], ref="X"),
        taxiway([(0, -500), (0, -800)], ref="Y"),
        hold_node(0, -600, holding_position__type="runway"),
        hold_node(0, -400, holding_position__type="runway"),
    )
    assert {(one.runway, one.derived) for one in airport.holding_positions} == {("09R/27L", False), ("09L/27R", True)}


def test_none_where_one_that_is_said_to_guard_another_runway_stops_all_the_same() -> None:
    """One taxiway leads to the ends of two runways; one position stops the traffic to both."""
    both = runway([(0, 0), (2400, 0)]), runway([(0, -40), (2300, -840)], ref="11/29")
    ways = [
        taxiway([(0, 0), (-40, -20)]), taxiway([(0, -40), (-40, -20)]), taxiway([(-40, -20), (-300, -20)], ref="A")
    ]  # fmt: skip
    _, airport = made(*both, *ways, hold_node(-200, -20, holding_position__type="runway", ref="09/27"))
    assert [(one.runway, one.derived) for one in airport.holding_positions] == [("09/27", False)]
    _, airport = made(*both, *ways)
    assert {one.runway for one in airport.holding_positions} == {"09/27", "11/29"}


def test_of_two_of_no_type_the_outer_is_for_low_visibility() -> None:
    _, airport = made(runway(), taxiway([(0, 0), (0, 300)], ref="A"), hold_node(0, 140), hold_node(0, 95))
    assert {round(away(one, airport)): one.category for one in airport.holding_positions} == {
        140: "CAT_II_III", 95: "CAT_I"
    }  # fmt: skip


def test_one_drawn_beside_its_taxiway_is_put_across_it() -> None:
    _, airport = made(
        runway(), taxiway([(0, 0), (0, 300)], ref="A"), hold_node(30, 100, holding_position__type="runway")
    )
    (hold,) = airport.holding_positions
    assert abs(hold.position.x) < 0.5
    assert hold.position.y - airport.runways[0].centreline.coords[0][1] == pytest.approx(100, abs=2.5)


def test_at_a_junction_the_area_reaches_to_the_bar() -> None:
    """Two taxiways part at the bar: the one that turns away takes nothing of the way in front of it."""
    _, airport = made(
        runway(), taxiway([(-60, 0), (0, 100)]), taxiway([(0, 100), (20, 140), (0, 300)]),
        taxiway([(0, 100), (60, 90), (300, 140)]), hold_node(0, 100, holding_position__type="runway"),
    )  # fmt: skip
    hold = next(one for one in airport.holding_positions if not one.derived)
    area = airport.runways[0].protection["normal"]
    for metres in (8, 16, 24):
        spot = hold.position.x + metres * math.sin(hold.heading), hold.position.y + metres * math.cos(hold.heading)
        assert area.covers(Point(spot)), metres
