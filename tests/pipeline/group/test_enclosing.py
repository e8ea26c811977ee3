"""Which plots lie within the extent of an established track."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.contracts.associate import Expected
from pipeline.group.enclosing import enclosing_tracks

MARGIN = 4.0


def tracks(*rows: tuple[float, float, float], velocity: tuple[float, float] = (0.0, 0.0), sd: float = 1.0) -> Expected:
    """Tracks at (east, north), 40 m long and 10 m wide along a direction, at time 0."""
    n = len(rows)
    state = np.array([(east, north, *velocity) for east, north, _ in rows])
    extent = np.array([(40.0, 10.0, direction) for _, _, direction in rows])
    return Expected(np.zeros(n), state, np.tile(sd**2 * np.eye(4), (n, 1, 1)), np.zeros(n), extent, np.zeros(n))


def ask(known: Expected, *places: tuple[float, float], established: Any = True, **given: Any) -> list[int]:
    m = len(places)
    made = enclosing_tracks(
        known,
        np.broadcast_to(established, (len(known.time),)),
        np.full(m, given.get("time", 0.0)),
        np.array(places),
        np.tile(given.get("sd", 0.5) ** 2 * np.eye(2), (m, 1, 1)),
        np.tile((given.get("length", 3.0), 3.0, 0.0), (m, 1)),
        MARGIN,
    )
    return [int(one) for one in made]


@pytest.mark.parametrize(
    ("place", "owner"), [((0, 23), 0), ((0, 25), -1), ((8, 0), 0), ((10, 0), -1), ((0, -23), 0), ((7, 18), -1)]
)
def test_within_an_ellipse_wider_by_the_margin(place: tuple[float, float], owner: int) -> None:
    assert ask(tracks((0, 0, 0.0)), place) == [owner]


def test_the_extent_turns_with_its_direction() -> None:
    assert ask(tracks((0, 0, np.pi / 2)), (23, 0), (0, 23)) == [0, -1]


def test_the_track_is_moved_to_the_time_of_the_plot() -> None:
    moving = tracks((0, 0, 0.0), velocity=(0.0, 50.0))
    assert ask(moving, (0, 50), time=1.0) == [0]
    assert ask(moving, (0, 50), time=0.0) == [-1]


def test_of_two_the_nearer_to_its_middle() -> None:
    assert ask(tracks((0, 0, 0.0), (12, 0, 0.0)), (5, 0), (7, 0)) == [0, 1]


def test_only_established_tracks() -> None:
    assert ask(tracks((0, 0, 0.0), (12, 0, 0.0)), (2, 0), established=[False, True]) == [-1]
    assert ask(tracks((0, 0, 0.0)), (0, 0), established=False) == [-1]


def test_a_longer_plot_is_another_target() -> None:
    assert ask(tracks((0, 0, 0.0)), (0, 0), length=51.0) == [0]
    assert ask(tracks((0, 0, 0.0)), (0, 0), length=53.0) == [-1]


def test_what_is_less_sure_has_a_wider_margin_up_to_a_tenth_of_the_length() -> None:
    assert ask(tracks((0, 0, 0.0)), (0, 26)) == [-1]
    assert ask(tracks((0, 0, 0.0), sd=10.0), (0, 27.9), (0, 28.1)) == [0, -1]


def test_nothing_asked_nothing_answered() -> None:
    none = enclosing_tracks(
        tracks((0, 0, 0.0)), np.array([True]), np.empty(0), np.empty((0, 2)), np.empty((0, 2, 2)), np.empty((0, 3)), 4.0
    )
    assert none.tolist() == []
