"""Which track is a fragment of which, and how far the whole reaches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.group.fragments import LONGEST_AIRCRAFT, Tracks, find_fragments, grow_extent

MARGIN = 4.0


def row(east: float, north: float, size: float = 5.0, **given: Any) -> dict[str, Any]:
    """A small track that stands on the apron, its velocity known to 0.3 m/s."""
    return {
        "state": (east, north, *given.pop("velocity", (0.0, 0.0))),
        "covariance": np.diag([1.0, 1.0, 0.09, 0.09]),
        "extent": (size, size, 0.0),
        "longest_side": size,
        "named": False,
        "aircraft": False,
        "on_apron": True,
        "standing": True,
        "rank": 0.0,
        **given,
    }


def find(*rows: dict[str, Any]) -> list[int]:
    tracks = Tracks(**{name: np.array([one[name] for one in rows]) for name in Tracks._fields})
    return [int(one) for one in find_fragments(tracks, MARGIN)]


def aircraft(east: float, north: float, **given: Any) -> dict[str, Any]:
    return row(east, north, 30.0, **{"aircraft": True, "named": True, "rank": 6.0, "standing": False, **given})


def test_two_that_stand_close_are_one_and_the_older_goes_on() -> None:
    assert find(row(0, 0), row(16, 0)) == [-1, 0]
    assert find(row(16, 0), row(0, 0)) == [-1, 0]


def test_the_higher_rank_goes_on_however_young() -> None:
    assert find(row(0, 0), row(16, 0, rank=1.0)) == [1, -1]


@pytest.mark.parametrize(("distance", "whole"), [(24.9, 0), (25.1, -1)])
def test_within_the_extent_of_an_aircraft_of_unknown_size(distance: float, whole: int) -> None:
    assert find(row(0, 0), row(0, distance)) == [-1, whole]


def test_a_car_that_moves_is_no_fragment_of_another_car() -> None:
    assert find(row(0, 0), row(10, 0, standing=False)) == [-1, -1]


def test_beside_an_aircraft_anything_without_an_address_that_moves_alike_is_a_fragment() -> None:
    assert find(aircraft(0, 0, on_apron=False), row(10, 0, standing=False, on_apron=False)) == [-1, 0]
    assert find(aircraft(0, 0), row(10, 0, named=True)) == [-1, -1]
    assert find(aircraft(0, 0), row(10, 0, velocity=(6.0, 0.0))) == [-1, -1]


def test_on_the_apron_a_hop_from_fragment_to_fragment_may_look_like_motion() -> None:
    hop = {"velocity": (4.5, 0.0), "standing": False}
    assert find(aircraft(0, 0), row(10, 0, **hop)) == [-1, 0]
    assert find(aircraft(0, 0, on_apron=False), row(10, 0, on_apron=False, **hop)) == [-1, -1]


def test_a_fast_aircraft_keeps_fragments_with_wild_velocities() -> None:
    fast, near = {"velocity": (70.0, 0.0), "on_apron": False}, {"on_apron": False, "standing": False}
    assert find(aircraft(0, 0, **fast), row(10, 0, velocity=(50.0, 0.0), **near)) == [-1, 0]
    assert find(aircraft(0, 0, **fast), row(10, 0, velocity=(0.0, 0.0), **near)) == [-1, -1]


def test_what_was_seen_long_is_a_target_of_its_own_unless_it_lies_inside() -> None:
    assert find(aircraft(0, 0, extent=(60.0, 60.0, 0.0)), row(20, 0, longest_side=26.0)) == [-1, 0]
    assert find(aircraft(0, 0, extent=(60.0, 60.0, 0.0)), row(22, 0, longest_side=26.0)) == [-1, -1]


def test_of_two_wholes_the_one_of_higher_rank() -> None:
    assert find(row(10, 0), aircraft(0, 0), aircraft(20, 0, rank=7.0)) == [2, -1, -1]


def test_the_extent_grows_to_the_far_edge_and_the_near_edge_stays() -> None:
    grown = grow_extent(np.array([10.0, 6.0, 0.0]), np.array([8.0, 4.0, 0.0]), np.array([0.0, 20.0]), 0.0)
    assert (grown.length, grown.width) == (5.0 + 20.0 + 4.0, 6.0)
    centre = grown.shift * 20.0
    assert centre - grown.length / 2 == pytest.approx(-5.0)
    assert centre + grown.length / 2 == pytest.approx(24.0)


@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(0, 6.28), st.floats(0, 70), st.floats(0, 70))
def test_it_never_shrinks_never_exceeds_an_aircraft_and_stays_between(
    east: float, north: float, direction: float, length: float, width: float
) -> None:
    grown = grow_extent(np.array([length, width]), np.array([8.0, 4.0]), np.array([east, north]), direction)
    assert length <= grown.length <= LONGEST_AIRCRAFT
    assert width <= grown.width <= LONGEST_AIRCRAFT
    assert 0.0 <= grown.shift <= 1.0
