"""Extent and heading of a track, from the plots that it takes and the course that it holds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.filter.kalman import Kalman
from pipeline.tables.arrays import Array, Floats
from pipeline.track.plot_pool import POOL
from pipeline.track.settings import ExtentSettings
from pipeline.track.shape import SETTLED, extents, fill_extent, shape_row, shape_rule
from pipeline.track.store import TrackStore

RULE = ExtentSettings()
NAN = math.nan
NOW = 100.0


def track(**words: Any) -> Array:
    """The record of a track that has moved and stands at the origin, its speed known to 0.2 m/s."""
    store = TrackStore(1, 1, Kalman().columns)
    store.append(1)
    given: dict[str, Any] = {"moved": True, "covariance": np.diag([4.0, 4.0, 0.04, 0.04])}
    for name, value in (given | words).items():
        store.rows[name][0] = value
    return store.rows


def moving(speed: float, course: float, **words: Any) -> Array:
    """One at `speed` m/s along `course` in degrees."""
    way = math.radians(course)
    return track(state=(0.0, 0.0, speed * math.sin(way), speed * math.cos(way)), **words)


def take(
    rows: Array, extent: tuple[float, float, float] = (0.0, 0.0, NAN), *, since: float = 1.0, sd: float = 0.1,
    period: float = 1.0,
) -> Any:  # fmt: skip
    """The record once it took a plot of such a length, width (m) and direction (degrees), `since` s after another."""
    pool = np.zeros(1, POOL)
    pool["time"], pool["extent"], pool["bearing_sd"] = NOW, (*extent[:2], math.radians(extent[2])), sd
    shape_row(shape_rule(RULE), rows[0], NOW - since, period, pool[0])
    return rows[0]


def degrees(one: Any, name: str) -> float:
    return math.degrees(one[name])


def share(fraction: float, seconds: float) -> float:
    """Of a difference, of which `fraction` is taken in a second."""
    return float(1.0 - (1.0 - fraction) ** seconds)


def filled(*words: float) -> Floats:
    made = np.full(3, 9.0)
    fill_extent(*words, made)
    return made


def test_the_extent_that_the_extractor_gave_is_taken_as_it_is() -> None:
    assert filled(30.0, 10.0, 0.7, 99.0, 0.5, 100.0, 2.0).tolist() == [30.0, 10.0, 0.7]
    assert filled(300.0, 250.0, 0.7, 0.0, 0.0, 100.0, 2.0).tolist() == [200.0, 200.0, 0.7]
    assert filled(30.0, NAN, 0.7, 0.0, 0.0, 100.0, 2.0).tolist() == [30.0, 0.0, 0.7]
    assert filled(30.0, -1.0, 0.7, 0.0, 0.0, 100.0, 2.0).tolist() == [30.0, 0.0, 0.7]


@pytest.mark.parametrize("length", [NAN, 0.0, -1.0])
def test_without_one_the_polar_extent_stands_for_it(length: float) -> None:
    """20 m deep, and 0.05 rad wide at a distance of 100 or 1000 m."""
    assert filled(length, NAN, NAN, 20.0, 0.05, 100.0, 4.0) == pytest.approx([20.0, 5.0, 4.0 - math.pi])
    assert filled(length, NAN, NAN, 20.0, 0.05, 1000.0, 1.0) == pytest.approx([50.0, 20.0, 1.0 + 0.5 * math.pi])
    assert filled(length, NAN, NAN, 20.0, 0.05, 1000.0, 2.0) == pytest.approx([50.0, 20.0, 2.0 - 0.5 * math.pi])
    assert filled(length, NAN, NAN, 5.0, 0.05, 100.0, 1.0) == pytest.approx([5.0, 5.0, 1.0])
    assert filled(length, NAN, NAN, NAN, 0.05, 100.0, 1.0) == pytest.approx([5.0, 0.0, 1.0 + 0.5 * math.pi])
    assert filled(length, NAN, NAN, 20.0, NAN, 100.0, 1.0) == pytest.approx([20.0, 0.0, 1.0])


def test_the_extent_for_gating_is_that_of_the_track_or_of_what_its_fragments_span() -> None:
    assert extents(track()).tolist() == [[0.0, 0.0, 0.0]]
    assert extents(track(length=30.0, width=9.0, heading=1.0, axis_bearing=2.0)).tolist() == [[30.0, 9.0, 1.0]]
    assert extents(track(length=30.0, width=9.0, axis_bearing=2.0)).tolist() == [[30.0, 9.0, 2.0]]
    assert extents(track(length=30.0, width=9.0, least_half_extent=21.0)).tolist() == [[42.0, 42.0, 0.0]]
    assert extents(track(length=60.0, width=50.0, least_half_extent=21.0)).tolist() == [[60.0, 50.0, 0.0]]


def test_an_extent_is_settled_after_three_plots() -> None:
    rows = track()
    for _ in range(3):
        assert rows["extent_count"][0] < SETTLED
        take(rows, (30.0, 10.0, 45.0))
    assert rows["extent_count"][0] >= SETTLED


def test_the_first_extent_is_that_of_the_plot_and_later_ones_grow_faster_than_they_shrink() -> None:
    rows = track()
    one = take(rows, (30.0, 10.0, 45.0))
    assert (one["length"], one["width"], one["extent_count"]) == (30.0, 10.0, 1)
    one = take(rows, (40.0, 5.0, 45.0))
    assert (one["length"], one["width"]) == pytest.approx((30.0 + 0.2 * 10.0, 10.0 - 0.1 * 5.0))
    one = take(rows, (12.0, 11.5, 45.0))
    assert (one["length"], one["width"]) == pytest.approx((32.0 - 0.1 * 20.0, 9.5 + 0.2 * 2.0))
    assert one["extent_count"] == 3


@pytest.mark.parametrize(("since", "counts"), [(0.3, 0.3), (1.0, 1.0), (7.0, 1.0), (-1.0, 0.0), (math.inf, 0.5)])
def test_what_is_taken_depends_on_the_time_since_the_plot_before(since: float, counts: float) -> None:
    """A second at most; a period of the radar, here half a second, where there was none."""
    one = take(track(length=30.0, width=10.0, extent_count=4), (40.0, 10.0, NAN), since=since, period=0.5)
    assert one["length"] == pytest.approx(30.0 + share(0.2, counts) * 10.0)


def test_a_plot_without_an_extent_leaves_it_but_turns_the_heading() -> None:
    one = take(moving(10.0, 90.0, length=30.0, width=10.0, extent_count=4))
    assert (one["length"], one["width"], one["extent_count"]) == (30.0, 10.0, 4)
    assert degrees(one, "heading") == pytest.approx(90.0)


def test_the_long_axis_is_that_of_the_first_sure_plot_and_then_turns_the_short_way() -> None:
    rows = track()
    assert math.isnan(take(rows, (30.0, 10.0, 20.0), sd=0.26)["axis_bearing"])
    assert degrees(take(rows, (30.0, 10.0, 170.0), sd=0.25), "axis_bearing") == pytest.approx(170.0)
    assert degrees(take(rows, (30.0, 10.0, 20.0)), "axis_bearing") == pytest.approx(176.0)
    assert degrees(take(rows, (30.0, 10.0, 20.0), since=0.5), "axis_bearing") == pytest.approx(
        (176.0 + share(0.2, 0.5) * 24.0) % 180.0
    )
    assert degrees(take(rows, (30.0, 10.0, NAN)), "axis_bearing") == pytest.approx(
        (176.0 + share(0.2, 0.5) * 24.0) % 180.0
    )


def test_of_a_direction_without_a_stated_doubt_the_axis_is_taken() -> None:
    assert degrees(take(track(), (30.0, 10.0, 200.0), sd=NAN), "axis_bearing") == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("speed", "before", "sd", "moves"),
    [
        (2.4, False, 0.1, False), (2.6, False, 0.1, True), (1.3, True, 0.1, True), (1.1, True, 0.1, False),
        (2.9, False, 1.0, False), (3.1, False, 1.0, True), (1.3, True, 1.0, True),
    ],
)  # fmt: skip
def test_a_course_counts_from_a_speed_on_that_is_known(speed: float, before: bool, sd: float, moves: bool) -> None:
    spread = np.diag([4.0, 4.0, 1.5 * sd**2, 0.5 * sd**2])
    one = take(moving(speed, 60.0, moving=before, covariance=spread))
    assert one["moving"] == moves
    assert math.isfinite(one["heading"]) == moves


def test_what_never_left_its_birthplace_has_no_course() -> None:
    one = take(moving(10.0, 60.0, moved=False))
    assert not one["moving"]
    assert math.isnan(one["heading"])


@pytest.mark.parametrize("course", [60.0, 300.0])
def test_the_first_course_gives_the_heading_and_later_ones_turn_it_the_short_way(course: float) -> None:
    assert degrees(take(moving(10.0, course)), "heading") == pytest.approx(course)
    sign = 1 if course < 180 else -1
    before = math.radians(course - sign * 20.0)
    assert degrees(take(moving(10.0, course, heading=before)), "heading") == pytest.approx(course - sign * 10.0)
    one = take(moving(10.0, course, heading=before), since=0.5)
    assert degrees(one, "heading") == pytest.approx(course - sign * 20.0 * (1.0 - share(0.5, 0.5)))


def test_a_heading_turns_through_north() -> None:
    assert degrees(take(moving(10.0, 10.0, heading=math.radians(350.0))), "heading") % 360 == pytest.approx(
        0.0, abs=1e-9
    )
    assert degrees(take(moving(10.0, 350.0, heading=math.radians(20.0))), "heading") == pytest.approx(5.0)


@pytest.mark.parametrize(("turned", "taken"), [(33.0, 0.5), (36.0, 1.0), (-33.0, 0.5), (-36.0, 1.0), (100.0, 1.0)])
def test_a_course_that_differs_by_much_replaces_the_heading(turned: float, taken: float) -> None:
    """0.6 rad are 34.4 degrees."""
    one = take(moving(10.0, 150.0 + turned, heading=math.radians(150.0)))
    assert degrees(one, "heading") == pytest.approx(150.0 + taken * turned)


@pytest.mark.parametrize(
    ("speed", "course", "heading"),
    [
        (3.0, 270.0, 90.0), (3.0, 215.0, 35.0), (3.0, 205.0, 205.0), (4.5, 270.0, 270.0),
    ],
)  # fmt: skip
def test_a_slow_target_whose_course_lies_against_its_heading_is_pushed_back(
    speed: float, course: float, heading: float
) -> None:
    """The heading was 90 degrees: a course that differs by more than 120 turns it towards its opposite."""
    one = take(moving(speed, course, heading=math.radians(90.0)))
    assert degrees(one, "heading") == pytest.approx(heading)


@pytest.mark.parametrize(
    ("extent", "sd", "heading"),
    [
        ((30.0, 10.0, 70.0), 0.1, 65.0), ((30.0, 10.0, 250.0), 0.1, 65.0), ((30.0, 10.0, 45.0), 0.1, 52.5),
        ((30.0, 10.0, 85.0), 0.1, 60.0), ((30.0, 17.0, 70.0), 0.1, 60.0), ((30.0, 10.0, 70.0), 0.3, 60.0),
        ((30.0, 10.0, NAN), 0.1, 60.0),
    ],
)  # fmt: skip
def test_the_axis_of_a_long_plot_corrects_the_course_that_it_agrees_with(
    extent: tuple[float, float, float], sd: float, heading: float
) -> None:
    """The course is 60 degrees; half the difference is taken."""
    assert degrees(take(moving(10.0, 60.0), extent, sd=sd), "heading") == pytest.approx(heading)


@pytest.mark.parametrize(("direction", "turned"), [(50.0, False), (104.0, False), (106.0, True), (150.0, True)])
def test_a_plot_that_lies_across_the_heading_has_length_and_width_exchanged(direction: float, turned: bool) -> None:
    one = take(track(heading=math.radians(60.0), length=8.0, width=8.0, extent_count=5), (18.0, 13.0, direction))
    length, width = (13.0, 18.0) if turned else (18.0, 13.0)
    assert (one["length"], one["width"]) == pytest.approx((8.0 + 0.2 * (length - 8.0), 8.0 + 0.2 * (width - 8.0)))


def test_without_a_heading_the_own_axis_tells_what_lies_across() -> None:
    one = take(track(axis_bearing=math.radians(60.0), extent_count=0), (18.0, 13.0, 150.0), sd=0.3)
    assert (one["length"], one["width"]) == (13.0, 18.0)
