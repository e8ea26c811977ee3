"""Which plots lie within the extent of an established track."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.tables.arrays import Array, Floats
from tests.pipeline.group.enclosing_track import enclosing_track

MARGIN = 4.0


class Known(NamedTuple):
    """Tracks at time 0."""

    mean: Floats
    covariance: Floats
    extent: Floats


def tracks(*rows: tuple[float, float, float], velocity: tuple[float, float] = (0.0, 0.0), sd: float = 1.0) -> Known:
    """Tracks at (east, north), 40 m long and 10 m wide along a direction, at time 0."""
    state = np.array([(east, north, *velocity) for east, north, _ in rows])
    extent = np.array([(40.0, 10.0, direction) for _, _, direction in rows])
    return Known(state, np.tile(sd**2 * np.eye(4), (len(rows), 1, 1)), extent)


def ask(known: Known, *places: tuple[float, float], established: Any = True, **words: Any) -> list[int]:
    n = len(known.mean)
    among = words.get("among", np.arange(n))
    return [
        enclosing_track(
            among,
            np.broadcast_to(established, (n,)).copy(),
            np.full(n, words.get("track_time", 0.0)),
            *known,
            words.get("time", 0.0),
            np.array(place, float),
            words.get("sd", 0.5) ** 2 * np.eye(2),
            words.get("length", 3.0),
            words.get("margin", MARGIN),
        )
        for place in places
    ]


@pytest.mark.parametrize(
    ("place", "owner"), [((0, 23), 0), ((0, 25), -1), ((8, 0), 0), ((10, 0), -1), ((0, -23), 0), ((7, 18), -1)]
)
def test_within_an_ellipse_wider_by_the_margin(place: tuple[float, float], owner: int) -> None:
    assert ask(tracks((0, 0, 0.0)), place) == [owner]


def test_the_extent_turns_with_its_direction() -> None:
    assert ask(tracks((0, 0, np.pi / 2)), (23, 0), (0, 23)) == [0, -1]
    slanting = np.array([np.sin(0.7), np.cos(0.7)])
    assert ask(tracks((0, 0, 0.7)), tuple(23 * slanting), tuple(23 * slanting * (-1, 1))) == [0, -1]


def test_the_track_is_moved_to_the_time_of_the_plot() -> None:
    moving = tracks((0, 0, 0.0), velocity=(0.0, 50.0))
    assert ask(moving, (0, 50), time=1.0) == [0]
    assert ask(moving, (0, 50), time=0.0) == [-1]
    assert ask(moving, (0, 50), time=1.0, track_time=1.0) == [-1]
    assert ask(tracks((0, 0, 0.0), velocity=(50.0, 0.0)), (-50, 0), time=1.0, track_time=2.0) == [0]


def test_of_two_the_nearer_to_its_middle() -> None:
    assert ask(tracks((0, 0, 0.0), (12, 0, 0.0)), (5, 0), (7, 0)) == [0, 1]


def test_only_established_tracks() -> None:
    assert ask(tracks((0, 0, 0.0), (12, 0, 0.0)), (2, 0), established=[False, True]) == [-1]
    assert ask(tracks((0, 0, 0.0)), (0, 0), established=False) == [-1]


def test_the_answer_is_the_place_among_the_tracks_asked_for() -> None:
    three = tracks((0, 0, 0.0), (100, 0, 0.0), (200, 0, 0.0))
    assert ask(three, (0, 0), (100, 0), (200, 0), among=np.array([2, 0])) == [1, -1, 0]
    assert ask(three, (0, 0), among=np.empty(0, np.int64)) == [-1]


def test_a_longer_plot_is_another_target() -> None:
    assert ask(tracks((0, 0, 0.0)), (0, 0), length=51.0) == [0]
    assert ask(tracks((0, 0, 0.0)), (0, 0), length=53.0) == [-1]


def test_what_is_less_sure_has_a_wider_margin_up_to_a_tenth_of_the_length() -> None:
    assert ask(tracks((0, 0, 0.0)), (0, 26)) == [-1]
    assert ask(tracks((0, 0, 0.0), sd=10.0), (0, 27.9), (0, 28.1)) == [0, -1]
    assert ask(tracks((0, 0, 0.0)), (0, 27.9), (0, 28.1), sd=10.0) == [0, -1]


def slow_twin(
    among: Array, established: Array, track_time: Floats, mean: Floats, covariance: Floats, extent: Floats,
    time: float, position: Floats, noise: Floats, length: float, least: float,
) -> int:  # fmt: skip
    """The same in matrices: a point of the ellipse (v / semi-axes) has the norm 1."""
    ratios = {}
    for place, row in enumerate(among):
        off = position - mean[row, :2] - (time - track_time[row]) * mean[row, 2:]
        long, wide, direction = extent[row]
        unsure = np.sqrt(2.0 * np.trace(covariance[row, :2, :2] + noise))
        margin = np.clip(unsure, least, least + 0.1 * long)
        axes = np.array([[np.sin(direction), np.cos(direction)], [np.cos(direction), -np.sin(direction)]])
        ratio = float((((axes @ off) / (np.array([long, wide]) / 2 + margin)) ** 2).sum())
        if established[row] and ratio < 1.0 and length <= 1.2 * long + margin:
            ratios[place] = ratio
    return min(ratios, key=lambda place: ratios[place], default=-1)


@settings(deadline=None, derandomize=True, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.integers(0, 9))
def test_any_scene_is_answered_as_by_the_slow_twin(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.uniform(-2, 2, (n, 4, 4))
    given_words = (
        rng.permutation(n)[: rng.integers(0, n + 1)],
        rng.random(n) < 0.8,
        rng.uniform(0, 2, n),
        np.column_stack([rng.uniform(-40, 40, (n, 2)), rng.uniform(-20, 20, (n, 2))]),
        root @ root.transpose(0, 2, 1),
        np.column_stack([rng.uniform(0, 60, (n, 2)), rng.uniform(0, np.pi, n)]),
        float(rng.uniform(0, 2)),
        rng.uniform(-30, 30, 2),
        np.diag(rng.uniform(0.1, 30, 2)),
        float(rng.uniform(0, 60)),
        float(rng.uniform(0, 6)),
    )
    assert enclosing_track(*given_words) == slow_twin(*given_words)
