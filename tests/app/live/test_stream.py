"""The stream's deltas against the obvious: a client that applies them holds what a filter of the newest rows holds."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.live.stream import Stream, TooManyViews, TrackFilter

Row = dict[str, Any]
CLASSES = ("aircraft", "vehicle", "unknown")
FILTERS = (
    TrackFilter(),
    TrackFilter(frozenset({"aircraft"})),
    TrackFilter(bbox=(0.0, 0.0, 2.0, 2.0)),
)

row_values = st.tuples(st.sampled_from(CLASSES), st.integers(0, 4), st.integers(0, 4), st.integers(0, 1))
pictures = st.lists(st.dictionaries(st.integers(1, 6), row_values, max_size=6), min_size=1, max_size=14)


def rows_of(picture: dict[int, tuple[str, int, int, int]]) -> tuple[list[Row], list[float]]:
    rows = [{"id": id, "class": c, "lat": float(y), "lon": float(x)} for id, (c, x, y, _) in picture.items()]
    return rows, [float(birth) for *_, birth in picture.values()]


def apply(held: dict[int, Row], delta: tuple[list[Row], list[Row], list[Row]]) -> None:
    updated, added, deleted = delta
    for one in deleted:
        held.pop(one["id"], None)
    for one in added:
        held[one["id"]] = dict(one)
    for one in updated:
        held[one["id"]].update(one)


@settings(max_examples=200, deadline=None)
@given(pictures, st.sampled_from(FILTERS), st.lists(st.booleans(), min_size=14, max_size=14))
def test_a_client_at_any_pace_holds_what_the_filter_admits(
    sequence: list[dict[int, Any]], filter: TrackFilter, takes: list[bool]
) -> None:
    stream = Stream(60.0)
    view = stream.view(filter)
    view.clients = 1
    held: dict[int, Row] = {}
    place = 0
    for seq, (picture, take) in enumerate(zip(sequence, takes, strict=False), start=1):
        stream.take(*rows_of(picture), seq, float(seq))
        if take or seq == len(sequence):
            apply(held, stream.delta(view, place))
            place = seq
            assert held == {row["id"]: row for row in rows_of(picture)[0] if filter.admits(row)}


@settings(max_examples=200, deadline=None)
@given(pictures, st.sampled_from(FILTERS), st.integers(0, 13), st.integers(0, 13))
def test_a_delta_from_an_earlier_place_repairs_as_well(
    sequence: list[dict[int, Any]], filter: TrackFilter, left_at: int, earlier: int
) -> None:
    """A resumed client is served from before where it stood: what it is told twice does no harm."""
    stream = Stream(1000.0)
    view = stream.view(filter)
    view.clients = 1
    held: dict[int, Row] = {}
    left_at = min(left_at, len(sequence))
    for seq, picture in enumerate(sequence, start=1):
        stream.take(*rows_of(picture), seq, float(seq))
        if seq <= left_at:
            apply(held, stream.delta(view, seq - 1))
    apply(held, stream.delta(view, min(earlier, left_at)))
    assert held == {row["id"]: row for row in rows_of(sequence[-1])[0] if filter.admits(row)}


def test_a_number_with_another_birth_is_another_track() -> None:
    stream = Stream(60.0)
    view = stream.view(TrackFilter())
    row = {"id": 1, "class": "aircraft", "lat": 1.0, "lon": 1.0}
    stream.take([row], [10.0], 1, 1.0)
    stream.take([row], [20.0], 2, 2.0)
    assert stream.delta(view, 1) == ([], [row], [{"id": 1, "reason": "ended"}])


def test_places_are_forgotten_after_their_time() -> None:
    stream = Stream(5.0)
    for seq in range(1, 21):
        stream.take([], [], seq, float(seq))
    assert stream.place_before(10, 1.0) is None
    assert stream.place_before(18, 1.0) == 17
    assert stream.place_before(20, 100.0) == 15


def test_views_without_clients_are_forgotten() -> None:
    stream = Stream(5.0)
    stream.take([], [], 1, 1.0)
    view = stream.view(FILTERS[1], 1.0)
    view.idle_since = 1.0
    stream.take([], [], 2, 3.0)
    assert stream.view(FILTERS[1], 3.0) is view
    stream.take([], [], 3, 10.0)
    assert stream.view(FILTERS[1], 10.0) is not view


def boxes(count: int) -> list[TrackFilter]:
    return [TrackFilter(bbox=(0.0, 0.0, 1.0 + i, 1.0)) for i in range(count)]


def test_views_of_clients_are_bounded_and_one_may_be_exchanged_for_another() -> None:
    stream = Stream(60.0, max_views=2)
    first, second, third = boxes(3)
    for one in (first, second):
        stream.view(one).clients += 1
    with pytest.raises(TooManyViews):
        stream.view(third)
    assert stream.view(first) is stream.view(first)
    stream.view(TrackFilter())
    shared = stream.view(first)
    shared.clients += 1
    with pytest.raises(TooManyViews):
        stream.view(third, instead_of=shared)  # another client keeps it
    shared.clients -= 1
    assert stream.view(third, instead_of=shared).filter == third


def test_of_views_without_clients_the_newest_are_kept() -> None:
    stream = Stream(1e9, max_views=3)
    wanted = boxes(20)
    made = [stream.view(one, float(i)) for i, one in enumerate(wanted)]
    assert len(stream._views) <= 1 + 3 + 1
    assert stream.view(wanted[-2], 20.0) is made[-2]
    assert stream.view(wanted[0], 20.0) is not made[0]
