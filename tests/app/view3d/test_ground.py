"""The ground: surfaces that cover what they should, once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import union_all
from shapely.geometry import MultiPolygon, Point, Polygon, box

from app.airports import load_airport
from app.view3d import cameras, shapes
from app.view3d.ground import Ground, Surface, build_ground, triangles
from app.view3d.paint import glyph
from pipeline.airport.model import Airport, Feature
from tests.support.small_airport import small_airport


@pytest.fixture(scope="module")
def orly() -> tuple[Airport, Ground]:
    airport, _ = load_airport("LFPO")
    return airport, build_ground(airport)


def area(one: Surface) -> float:
    a, b, c = (one.vertices[one.faces[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def surface(ground: Ground, name: str) -> Surface:
    return next(one for one in ground.surfaces if one.name == name)


@given(st.lists(st.tuples(st.floats(5, 60), st.floats(0.05, 0.6)), min_size=3, max_size=12))
def test_triangles_cover_a_polygon_exactly_and_face_up(steps: list[tuple[float, float]]) -> None:
    angle = np.cumsum([step for _, step in steps])
    shape = Polygon([(r * np.cos(a), r * np.sin(a)) for (r, _), a in zip(steps, angle, strict=True)])
    if not shape.is_valid or shape.area < 1.0:
        return
    made = triangles(shape)
    a, b, c = made[:, 0], made[:, 1], made[:, 2]
    signed = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (signed >= 0).all()
    assert signed.sum() == pytest.approx(shape.area, rel=1e-6)


def test_holes_and_several_parts_are_kept() -> None:
    ring = box(0, 0, 10, 10).difference(box(4, 4, 6, 6))
    whole = MultiPolygon([ring, box(20, 0, 22, 2)])
    made = triangles(whole)
    assert sum(Polygon(one).area for one in made) == pytest.approx(96 + 4)
    assert not any(Polygon(one).contains(Point(5, 5)) for one in made)


def test_the_pavements_of_orly_lie_once_and_nowhere_twice(orly: tuple[Airport, Ground]) -> None:
    airport, ground = orly
    names = ("runway-paint", "runway", "stopway", "taxiway", "stand", "apron")
    kinds = ("RunwayElement", "Stopway", "TaxiwayElement", "ParkingStandArea", "ApronElement")
    laid = sum(area(surface(ground, f"/ground/{one}")) for one in names)
    wanted = union_all([one.geometry for one in airport.features if one.kind in kinds])
    assert laid == pytest.approx(wanted.area, rel=0.005)


def test_buildings_stand_at_their_height(orly: tuple[Airport, Ground]) -> None:
    airport, ground = orly
    roofs = surface(ground, "/buildings/roofs").vertices[:, 2]
    heights = {round(float(one.properties["height_m"]), 1) for one in airport.features if one.kind == "Building"}
    assert {round(float(one), 1) for one in np.unique(roofs)} == heights
    assert surface(ground, "/buildings/walls").vertices[:, 2].max() == pytest.approx(max(heights))


@pytest.mark.parametrize("height", [None, "high", float("nan"), -5, 1e9])
def test_a_height_that_is_none_does_not_break_the_scene(height: Any) -> None:
    airport = small_airport()
    odd = Feature("odd", "Building", "", box(0, 0, 20, 20), {"height_m": height})
    roofs = surface(build_ground(replace(airport, features=(odd,))), "/buildings/roofs")
    assert 2.5 <= roofs.vertices[:, 2].max() <= 120


def test_every_runway_end_is_named_and_every_hold_has_its_bar(orly: tuple[Airport, Ground]) -> None:
    airport, ground = orly
    assert {text for text, _ in ground.notes} == {"06", "24", "07", "25", "02", "20"}
    bars = next(one for one in ground.lines if one.name == "/lines/hold")
    assert len(bars.points) == len(airport.holding_positions)


def test_an_airport_of_nothing_is_a_plane() -> None:
    ground = build_ground(replace(small_airport(), runways=(), features=(), holding_positions=()))
    assert [one.name for one in ground.surfaces] == ["/ground/grass"]
    for pose in (cameras.overview(ground), cameras.tower(ground)):
        assert np.isfinite([*pose.position, *pose.look_at]).all()


def test_the_overview_shows_all_runways_and_the_tower_stands_where_the_map_says(orly: tuple[Airport, Ground]) -> None:
    airport, ground = orly
    pose = cameras.overview(ground)
    eye, look = np.array(pose.position), np.array(pose.look_at)
    ahead = (look - eye) / np.linalg.norm(look - eye)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    for x, y in ground.corners:
        to = np.array([x, y, 0]) - eye
        depth = to @ ahead
        assert abs(to @ up) / depth <= np.tan(pose.fov / 2)
        assert abs(to @ right) / depth <= np.tan(pose.fov / 2) * cameras.ASPECT
    tower = next(one for one in airport.features if one.properties.get("use") == "tower").geometry
    at = cameras.tower(ground).position
    assert np.hypot(at[0] - tower.x, at[1] - tower.y) < 20


def test_digits_differ_and_strange_characters_are_nothing() -> None:
    drawn = {one: union_all(glyph(one)).normalize().wkt for one in "0123456789LCR"}
    assert len(set(drawn.values())) == len(drawn)
    assert glyph("?") == []


@pytest.mark.parametrize(
    "make", [shapes.aircraft, shapes.vehicle, shapes.unknown, shapes.puck, shapes.ring, shapes.alarm_ring]
)
def test_shapes_are_of_unit_size_and_well_formed(make: Any) -> None:
    shape = make()
    assert shape.faces.max() < len(shape.vertices)
    assert np.abs(shape.vertices[:, :2]).max() <= 1.0
    assert shape.vertices[:, 2].min() >= 0
    corners = shape.vertices[shape.faces]
    assert (np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 0).all()


def test_an_aircraft_has_its_nose_ahead_and_is_the_same_on_both_sides() -> None:
    vertices = np.round(shapes.aircraft().vertices.astype(float), 4)
    assert vertices[vertices[:, 0] > 0.45][:, 1].max() < 0.05
    assert vertices[vertices[:, 1] > 0.45][:, 0].max() < 0, "the wings are swept back"
    mirrored = {tuple(one * [1, -1, 1] + 0.0) for one in vertices}
    assert mirrored == {tuple(one + 0.0) for one in vertices}
