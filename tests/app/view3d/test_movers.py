"""Pools: every track keeps its place, and the arrays say what the picture says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.view3d.movers import (
    ALARM,
    CAPACITY,
    COASTING,
    COLOURS,
    INFORMATION,
    MAST_M,
    RINGS,
    VECTOR_S,
    Frame,
    Instances,
    Movers,
    outline,
)
from app.view3d.slots import Slots
from pipeline.tables import TargetClass, TrackPhase
from tests.app.view3d.pictures import alert, picture, tracks


def shown(one: Instances) -> np.ndarray[Any, Any]:
    return np.flatnonzero(one.scales.any(axis=1))


def forward(wxyz: np.ndarray[Any, Any]) -> tuple[float, float]:
    """East and north of the +x axis turned by a quaternion."""
    w, x, y, z = (float(one) for one in wxyz)
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)


@given(st.lists(st.sets(st.integers(1, 40), max_size=12), max_size=30))
def test_an_id_keeps_its_place_as_long_as_it_is_there(turns: list[set[int]]) -> None:
    slots = Slots(12)
    before: dict[int, int] = {}
    for ids in turns:
        places, fresh = slots.assign(ids)
        assert set(places) == ids
        assert len(set(places.values())) == len(ids)
        assert slots.refused == 0
        for one in ids & set(before):
            assert places[one] == before[one]
        assert {places[one] for one in ids - set(before)} == set(fresh)
        assert all(slots.bearer(place) == one for one, place in places.items())
        before = dict(places)


@given(st.integers(1, 20), st.integers(0, 40))
def test_what_finds_no_place_is_counted_and_disturbs_nobody(capacity: int, wanted: int) -> None:
    slots = Slots(capacity)
    first, _ = slots.assign(range(min(capacity, wanted)))
    kept = dict(first)
    places, _ = slots.assign(range(wanted))
    assert len(places) == min(capacity, wanted)
    assert slots.refused == max(0, wanted - capacity)
    assert all(places[one] == kept[one] for one in kept)


def test_a_place_left_is_taken_again_last_so_a_late_click_still_finds_who_was_there() -> None:
    slots = Slots(3)
    slots.assign([7])
    slots.assign([])
    slots.assign([8])
    assert slots.bearer(0) == 7
    assert slots.bearer(1) == 8
    assert slots.bearer(None) is None
    assert slots.bearer(3) is None


def test_a_target_is_called_by_its_number_and_by_its_id_where_it_has_none() -> None:
    frame = Movers().arrange(picture(tracks([70_001, 70_002], number=np.array([17, 0]))))
    assert {id: one.number for id, one in frame.targets.items()} == {70_001: 17, 70_002: 70_002}


def test_instances_stay_when_others_come_and_go() -> None:
    movers = Movers()
    movers.arrange(picture(tracks([10, 11, 12], category=1, heading=0.0)))
    place = next(one for one in range(CAPACITY) if movers.slots.bearer(one) == 12)
    frame = movers.arrange(picture(tracks([5, 12], category=1, heading=0.0)))
    assert frame.bodies["aircraft"].positions[place].tolist() == [100.0, 0.0, 0.0]
    assert len(shown(frame.bodies["aircraft"])) == 2
    assert all(len(one.positions) == CAPACITY for one in (*frame.bodies.values(), frame.marks))


def test_free_places_have_no_size() -> None:
    frame = Movers().arrange(picture(tracks([1, 2])))
    free = np.setdiff1d(np.arange(CAPACITY), shown(frame.bodies["unknown"]))
    assert len(free) == CAPACITY - 2
    assert not frame.bodies["unknown"].scales[free].any()
    assert not frame.marks.scales[free].any()


def test_more_tracks_than_places_are_counted() -> None:
    movers = Movers()
    frame = movers.arrange(picture(tracks(list(range(1, CAPACITY + 6)))))
    assert movers.slots.refused == 5
    assert len(frame.targets) == CAPACITY


def test_a_state_that_is_no_number_is_left_out() -> None:
    state = np.array([[math.nan, 0, 0, 0], [1, 2, 0, 0], [0, math.inf, 0, 0]])
    frame = Movers().arrange(picture(tracks([1, 2, 3], state=state)))
    assert list(frame.targets) == [2]


@pytest.mark.parametrize("category", list(TargetClass))
def test_shape_colour_and_size_follow_the_class(category: TargetClass) -> None:
    frame = Movers().arrange(picture(tracks([1], category=category, heading=1.0, length=20.0, width=18.0)))
    name = category.name.lower()
    (place,) = shown(frame.bodies[name])
    assert [len(shown(one)) for key, one in frame.bodies.items() if key != name] == [0, 0, 0]
    assert frame.bodies[name].colours[place].tolist() == COLOURS[category].tolist()
    assert frame.bodies[name].scales[place, 0] == pytest.approx(20.0, abs=0.5)


@given(st.floats(0, 2 * math.pi))
def test_the_nose_points_where_the_heading_says(heading: float) -> None:
    frame = Movers().arrange(picture(tracks([1], category=1, heading=heading)))
    (place,) = shown(frame.bodies["aircraft"])
    east, north = forward(frame.bodies["aircraft"].wxyzs[place])
    assert east == pytest.approx(math.sin(heading), abs=0.01)
    assert north == pytest.approx(math.cos(heading), abs=0.01)


def test_without_a_heading_the_course_counts_then_the_last_known_and_else_the_shape_has_no_nose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("app.view3d.movers.CAPACITY", 3)
    movers = Movers()
    rolling, standing = np.array([[0, 0, 10.0, 0]]), np.zeros((1, 4))
    unknown = movers.arrange(picture(tracks([1], category=1, state=standing)))
    assert len(shown(unknown.bodies["round"])) == 1
    for state in (rolling, standing):
        frame = movers.arrange(picture(tracks([1], category=1, state=state)))
        (place,) = shown(frame.bodies["aircraft"])
        assert forward(frame.bodies["aircraft"].wxyzs[place]) == pytest.approx((1.0, 0.0), abs=1e-6)
    movers.arrange(picture(tracks([])))
    for _ in range(2):
        movers.arrange(picture(tracks([2])))
        movers.arrange(picture(tracks([])))
    again = movers.arrange(picture(tracks([3], category=1, state=standing)))
    assert len(shown(again.bodies["round"])) == 1, "a new track does not get the nose of one before it"


def test_a_coasting_track_is_grey_and_translucent() -> None:
    frame = Movers().arrange(picture(tracks([1, 2], category=2, phase=[TrackPhase.COASTING, TrackPhase.CONFIRMED])))
    a, b = shown(frame.bodies["vehicle"])
    assert frame.bodies["vehicle"].colours[a].tolist() == COASTING.tolist()
    assert frame.bodies["vehicle"].opacities[a] < 0.5
    assert frame.bodies["vehicle"].opacities[b] == 1.0


def test_height_is_that_of_what_flies() -> None:
    frame = Movers().arrange(
        picture(tracks([1, 2, 3], altitude=[300.0, 300.0, math.nan], on_ground=[False, True, False]))
    )
    assert [one.height for one in frame.targets.values()] == [300.0, 0.0, 0.0]


def test_a_vector_ends_where_the_target_will_be_and_the_slow_have_none() -> None:
    state = np.array([[0, 0, 6.0, -8.0], [50, 0, 0.3, 0.0]])
    frame = Movers().arrange(picture(tracks([1, 2], state=state)))
    length = np.hypot(*(frame.vectors.points[:, 1, :2] - frame.vectors.points[:, 0, :2]).T)
    assert sorted(length)[-2:] == pytest.approx([0.0, 10.0 * VECTOR_S])


def arranged(*alerts: Any, ids: tuple[int, ...] = (1, 2, 3), **outlines: Any) -> Frame:
    return Movers(outlines.get("outlines")).arrange(picture(tracks(list(ids), category=2), *alerts))


@pytest.mark.parametrize(("stage", "colour"), [("alarm", ALARM), ("information", INFORMATION)])
def test_a_ring_is_around_every_target_of_an_alert(stage: str, colour: tuple[int, int, int]) -> None:
    frame = arranged(alert([1, 3], stage))
    ring = frame.rings[stage]
    assert ring.positions[shown(ring)][:, 0].tolist() == [0.0, 200.0]
    assert ring.colours[shown(ring)].tolist() == [list(colour)] * 2
    other = {"alarm": "information", "information": "alarm"}[stage]
    assert len(shown(frame.rings[other])) == 0
    assert [one.stage for one in frame.targets.values()] == [stage, None, stage]


def test_the_graver_stage_wins_and_what_is_cleared_shows_nothing() -> None:
    frame = arranged(alert([1], "alarm"), alert([1, 2], "information", id=2), alert([3], "alarm", "cleared", id=3))
    assert [one.stage for one in frame.targets.values()] == ["alarm", "information", None]
    assert [len(shown(frame.rings[one])) for one in ("alarm", "information")] == [1, 1]


def test_an_alert_links_its_targets_raises_masts_and_outlines_its_runway() -> None:
    edge = outline(np.array([0.0, 10.0, 10.0, 0.0]), np.array([0.0, 0.0, 5.0, 0.0]))
    frame = arranged(alert([1, 2], runway="06/24"), outlines={"06/24": edge})
    drawn = np.flatnonzero(frame.alert_lines.colours.any(axis=(1, 2)))
    points = frame.alert_lines.points[drawn]
    assert len(points) == 1 + 2 + 3
    assert (points[:2, 1, 2] - points[:2, 0, 2]).tolist() == [MAST_M, MAST_M]
    assert points[2, :, 0].tolist() == [0.0, 100.0]
    assert np.array_equal(points[3:], edge)


def test_what_two_alerts_share_is_drawn_once_in_the_colour_of_the_graver() -> None:
    frame = arranged(alert([1, 2], "information"), alert([1, 2], "alarm", id=2))
    drawn = np.flatnonzero(frame.alert_lines.colours.any(axis=(1, 2)))
    assert len(drawn) == 3
    assert {tuple(one) for one in frame.alert_lines.colours[drawn, 0]} == {ALARM}


def test_an_alert_about_targets_that_are_gone_is_no_fault() -> None:
    frame = arranged(alert([77], runway="99/99"))
    assert not frame.alert_lines.points.any()


def test_more_alerted_targets_than_rings_do_no_harm() -> None:
    ids = tuple(range(1, RINGS + 10))
    frame = arranged(alert(list(ids)), ids=ids)
    assert len(shown(frame.rings["alarm"])) == RINGS


def test_an_empty_picture_is_an_empty_scene() -> None:
    frame = Movers().arrange(picture(tracks([])))
    assert not any(one.scales.any() for one in (*frame.bodies.values(), frame.marks, *frame.rings.values()))


@pytest.mark.parametrize(("axis", "wanted"), [(0.5, 0.5), (math.nan, 0.0)])
def test_what_has_no_heading_lies_along_its_axis_where_that_is_known(axis: float, wanted: float) -> None:
    made = Movers().arrange(picture(tracks([1], length=30.0, width=10.0, axis=axis)))
    (body,) = [one for one in made.bodies.values() if len(shown(one))]
    east, north = forward(body.wxyzs[shown(body)[0]])
    assert math.atan2(east, north) == pytest.approx(wanted, abs=0.01)
