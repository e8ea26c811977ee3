"""Labels: few, the important ones first, none over another."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.view3d.labels import MOST, Eye, choose, label_text
from app.view3d.movers import Target


def target(id: int, east: float = 0.0, north: float = 0.0, **values: object) -> Target:
    given = {
        "height": 0.0, "speed": 0.0, "size": 10.0, "name": f"AB{id}", "category": 1, "on_runway": False,
        "coasting": False, "simulated": False, "stage": None, **values,
    }  # fmt: skip
    return Target(id=id, number=id, row=0, east=east, north=north, **given)  # type: ignore[arg-type]


def eye_to_the_north(height: float = 60.0) -> Eye:
    """At the origin; right is east, down is down, ahead is north."""
    rotation = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    return Eye(np.array([0, 0, height]), rotation, math.radians(50), 1280.0, 800.0)


kinds = st.builds(
    target,
    id=st.integers(1, 10_000),
    east=st.floats(-3000, 3000),
    north=st.floats(-3000, 3000),
    speed=st.floats(0, 80),
    name=st.sampled_from(["", "AFR123", "TUG1"]),
    on_runway=st.booleans(),
    stage=st.sampled_from([None, "information", "alarm"]),
)


@given(st.lists(kinds, max_size=150, unique_by=lambda one: one.id), st.booleans())
def test_never_more_than_forty_and_no_target_twice(targets: list[Target], with_eye: bool) -> None:
    chosen = choose(targets, {1, 2, 3}, eye_to_the_north() if with_eye else None)
    assert len(chosen) <= MOST
    assert len({one.id for one in chosen}) == len(chosen)


def test_a_label_without_a_name_shows_the_number() -> None:
    assert label_text(replace(target(70_001, name=""), number=17)) == "#17"


def test_forty_is_forty() -> None:
    assert MOST == 40
    assert len(choose([target(i, east=i) for i in range(1, 300)], (), None)) == 40


def test_the_alerted_come_first_then_selected_runway_moving_nearest() -> None:
    others = [target(i, east=10.0 * i) for i in range(10, 100)]
    chosen = choose(
        [*others, target(5, east=5e3), target(4, speed=9, east=5e3), target(3, on_runway=True, east=5e3),
         target(2, east=5e3), target(1, stage="information", east=5e3), target(9, stage="alarm", east=5e3)],
        {2}, None,
    )  # fmt: skip
    assert [one.id for one in chosen[:6]] == [9, 1, 2, 3, 4, 10]
    assert 5 not in [one.id for one in chosen]


def test_a_standing_target_without_a_name_gets_no_label_unless_it_matters() -> None:
    quiet, alerted = target(1, name=""), target(2, name="", stage="alarm")
    assert [one.id for one in choose([quiet, alerted], (), None)] == [2]
    assert [one.id for one in choose([quiet, alerted], {1}, None)] == [2, 1]


def test_what_the_eye_does_not_see_gets_no_label() -> None:
    ahead, behind, aside = target(1, north=500), target(2, north=-500), target(3, east=5000, north=500)
    assert [one.id for one in choose([ahead, behind, aside], (), eye_to_the_north())] == [1]


def test_a_label_does_not_cover_a_weightier_one_but_alerts_are_never_left_out() -> None:
    eye = eye_to_the_north()
    near, over = target(1, north=800, on_runway=True), target(2, north=800, east=1)
    assert [one.id for one in choose([over, near], (), eye)] == [1]
    alarmed = [target(i, north=800, stage="alarm") for i in (3, 4)]
    assert {one.id for one in choose([over, near, *alarmed], (), eye)} >= {3, 4}


def test_points_are_put_on_the_screen() -> None:
    eye = eye_to_the_north()
    assert eye.pixel(0, 100, 60) == pytest.approx((640, 400))
    right = eye.pixel(20, 100, 60)
    up = eye.pixel(0, 100, 70)
    assert right is not None
    assert right[0] > 640
    assert up is not None
    assert up[1] < 400
    assert eye.pixel(0, -100, 60) is None


def test_the_text_says_gravity_speed_coasting_and_simulated() -> None:
    assert label_text(target(7, name="")) == "#7"
    assert label_text(target(7, speed=10.0)) == "AB7 19 kt"
    assert label_text(target(7, stage="alarm", simulated=True, coasting=True)) == "ALARM AB7 coasting (sim)"
    assert label_text(target(7, stage="information")).startswith("INFO ")
