"""The store of tracks: rows come, are copied, end and are removed in order; all of it is saved and restored."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.filter.kalman import Kalman
from pipeline.tables.arrays import Array
from pipeline.track.store import ENDED, NEVER, OTHER_SENSORS, TRACK, TrackStore
from tests.pipeline.track.scene import assert_same_store

RADARS = 2
RECORDS = ("rows", "filter", "evidence", "look")


def filled(capacity: int, rows: int, seed: int = 1) -> TrackStore:
    """A store whose numbers are all different."""
    store, rng = TrackStore(capacity, RADARS, Kalman().columns), np.random.default_rng(seed)
    store.append(rows)
    for kind in RECORDS:
        records = getattr(store, kind)
        for name in records.dtype.names:
            column = records[name]
            if name not in ("uid", "target", "phase") and column.dtype.kind in "fiu":
                column[:rows] = rng.integers(1, 200, column[:rows].shape)
    store.time[:rows] = rng.uniform(0, 100, rows)
    store.phase[:rows] = 1
    return store


def rows_of(store: TrackStore, rows: Any) -> list[bytes]:
    """All that is known of the rows, but for their uid and target."""
    made = []
    for row in np.atleast_1d(rows):
        one = store.rows[row : row + 1].copy()
        one["uid"] = one["target"] = 0
        made.append(one.tobytes() + store.evidence[row].tobytes() + store.look[row].tobytes())
    return made


def own(store: TrackStore, rows: Any) -> list[bytes]:
    return [store.filter[row].tobytes() + store.time[row].tobytes() for row in np.atleast_1d(rows)]


def test_new_rows_have_the_values_of_new_rows_whatever_was_there_before() -> None:
    store = filled(6, 6)
    store.phase[:] = ENDED
    made = store.append(4)
    assert (made, store.n) == (slice(0, 4), 4)
    for name, column in TRACK.items():
        if name not in ("uid", "target"):
            expected = np.broadcast_to(column.fill, store.rows[name][made].shape)
            np.testing.assert_array_equal(store.rows[name][made], expected, err_msg=name)
    assert store.uid[made].tolist() == store.target[made].tolist() == [7, 8, 9, 10]
    assert np.isnan(store.length[made]).all()
    assert (store.radar_time[made] == NEVER).all()
    assert store.filter["one_point"][made].all()
    assert not store.filter["state"][made].any()
    assert store.evidence.shape == (6, RADARS + OTHER_SENSORS)
    assert store.look.shape == (6, RADARS)
    for column in (store.evidence, store.look, store.time):
        assert not any(column[made].tobytes())


def test_a_full_store_makes_room_of_what_has_ended_and_no_more() -> None:
    store = filled(5, 5)
    store.phase[[1, 3]] = ENDED
    kept = rows_of(store, [0, 2, 4])
    made = store.append(3)
    assert (made, store.n) == (slice(3, 5), 5)
    assert rows_of(store, [0, 1, 2]) == kept
    assert store.uid.tolist() == [1, 3, 5, 6, 7]
    assert store.append(1) == slice(5, 5)
    assert store.last_uid == 7


def test_as_long_as_there_is_room_what_has_ended_stays_where_it_is() -> None:
    store = filled(5, 3)
    store.phase[1] = ENDED
    store.append(2)
    assert store.uid.tolist() == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("ended", [[], [0], [4], [0, 1, 2, 3, 4], [1, 3], [0, 4], [2]])
def test_clearing_keeps_the_order_and_all_columns_of_what_goes_on(ended: list[int]) -> None:
    store = filled(8, 5)
    kept = [row for row in range(5) if row not in ended]
    before, filters, uid = rows_of(store, kept), own(store, kept), store.uid[kept].tolist()
    store.phase[ended] = ENDED
    store.clear_ended()
    rows = np.arange(len(kept))
    assert (store.n, rows_of(store, rows), own(store, rows)) == (len(kept), before, filters)
    assert store.uid[: store.n].tolist() == uid
    assert (store.phase[store.n :] == ENDED).all()


def test_copies_are_rows_of_the_same_target_with_uids_of_their_own() -> None:
    store = filled(8, 4)
    into = store.copy_rows(np.array([3, 1, 3]))
    assert (into.tolist(), store.n) == ([4, 5, 6], 7)
    assert rows_of(store, into) == rows_of(store, [3, 1, 3])
    assert store.target[into].tolist() == [4, 2, 4]
    assert store.uid[into].tolist() == [5, 6, 7]
    assert not store.filter["state"][into].any()  # these the filter itself copies
    store.hits[into] = 999
    assert (store.hits[:4] < 999).all()


def test_copies_find_room_for_as_many_as_there_is_and_move_no_row() -> None:
    """Who asks for copies goes on with the numbers of its rows."""
    store = filled(6, 5)
    store.phase[0] = ENDED
    before = rows_of(store, range(5))
    into = store.copy_rows(np.array([4, 3, 2]))
    assert into.tolist() == [5]
    assert rows_of(store, range(5)) == before
    assert rows_of(store, into) == rows_of(store, [4])
    assert len(store.copy_rows(np.array([1]))) == 0


def test_what_was_saved_is_restored_and_nothing_of_it_is_shared() -> None:
    first = filled(6, 4)
    saved = first.save()
    state = first.state[0].copy()
    first.rows["state"][:] = -1.0
    first.filter["covariance"][:] = -1.0
    second = filled(9, 7, seed=2)
    second.restore(saved)
    np.testing.assert_array_equal(second.state[0], state)
    assert (second.n, second.last_uid) == (4, 4)
    assert (second.phase[4:] == ENDED).all()
    assert_same_store(second.save(), saved)
    second.rows["hits"][:] = -1
    assert (saved["rows"]["hits"] > 0).all()
    assert second.append(1) == slice(4, 5)
    assert second.uid[4] == 5


def without(saved: dict[str, Any], kind: str, name: str) -> dict[str, Any]:
    return {**saved, kind: {key: column for key, column in saved[kind].items() if key != name}}


def wider(saved: dict[str, Any], kind: str, name: str) -> dict[str, Any]:
    column: Array = saved[kind][name]
    return {**saved, kind: {**saved[kind], name: np.concatenate([column, column], axis=1)}}


@pytest.mark.parametrize(
    "change",
    [
        lambda saved: without(saved, "filter", "one_point"),
        lambda saved: without(saved, "rows", "target"),
        lambda saved: wider(saved, "filter", "state"),
        lambda saved: wider(saved, "evidence", "score"),
        lambda saved: wider(saved, "look", "row"),
    ],
)
def test_what_does_not_fit_is_refused_and_leaves_the_store_as_it_is(change: Any) -> None:
    store = filled(6, 4)
    before = store.save()
    with pytest.raises(ValueError, match="do not fit"):
        store.restore(change(filled(6, 5, seed=3).save()))
    assert_same_store(store.save(), before)
    with pytest.raises(ValueError, match="do not fit"):
        filled(3, 1).restore(before)


def test_columns_are_known_by_name() -> None:
    store = filled(3, 2)
    assert store.hits.base is store.rows
    with pytest.raises(AttributeError, match="hists"):
        store.hists  # noqa: B018
    records = store.records(np.array([1, 0]))
    assert records.tobytes() == store.rows[[1, 0]].tobytes()
    records["hits"] = -5
    assert (store.hits >= 0).all()
