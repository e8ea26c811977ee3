"""Tables check what they are given and slice like one thing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.parts import PartError, available, build
from pipeline.tables import Plots, Sweeps, TableError, Tracks


def tracks(n: int) -> Tracks:
    return Tracks.build(n, id=np.arange(n), time=0.0, state=np.zeros((n, 4)), covariance=np.eye(4))


def test_defaults_fill_what_is_not_given() -> None:
    table = tracks(3)
    assert np.isnan(table.heading).all()
    assert table.zone.tolist() == [-1, -1, -1]


@given(st.lists(st.booleans(), max_size=20))
def test_a_mask_cuts_every_column(mask: list[bool]) -> None:
    table = tracks(len(mask))
    cut = table[np.array(mask, dtype=bool)]
    assert cut.id.tolist() == [i for i, kept in enumerate(mask) if kept]
    assert all(len(getattr(cut, name)) == sum(mask) for name in Tracks.columns())


def test_concatenate_keeps_order_and_empty_is_neutral() -> None:
    both = Tracks.concatenate([tracks(2), Tracks.empty(), tracks(1)])
    assert both.id.tolist() == [0, 1, 0]
    assert len(Tracks.concatenate([])) == 0


@pytest.mark.parametrize(
    "change",
    [{"id": np.zeros(1)}, {"state": np.zeros((1, 3))}, {"time": np.zeros(2)}, {"hits": [1]}],
    ids=["dtype", "shape", "length", "not an array"],
)
def test_a_wrong_column_is_refused(change: dict[str, object]) -> None:
    good = tracks(1)
    columns = {name: getattr(good, name) for name in Tracks.columns()}
    with pytest.raises(TableError):
        Tracks(**{**columns, **change})


def test_a_missing_column_is_named() -> None:
    with pytest.raises(TableError, match="time"):
        Plots.build(1)


def test_sweeps_ascend() -> None:
    with pytest.raises(TableError, match="ascend"):
        Sweeps(0, 0, np.array([2, 1], np.int32), np.zeros(2), np.zeros(2), np.zeros((2, 8), np.uint8))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, -(2**60), [0.0, float("nan")], "ten"])
def test_no_setting_takes_a_number_that_is_none(value: object) -> None:
    for verb, name, setting in (("detect", "adaptive", "most_offset_db"), ("extract", "manhattan", "ring_m")):
        with pytest.raises(PartError, match=name):
            build(verb, name, {setting: value})


def test_an_unknown_part_names_the_nearest() -> None:
    with pytest.raises(PartError, match="detect"):
        available("detekt")
    with pytest.raises(PartError):
        build("detect", "no-such-method")
