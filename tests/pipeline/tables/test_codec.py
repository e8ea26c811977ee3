"""The byte form of tables: every bit comes back, and nothing but a table is taken for one."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.tables import NodeEvents, Plots, Table, TargetReports, Tracks
from pipeline.tables.codec import (
    CodecError,
    OtherColumnsError,
    OtherFormError,
    decode,
    encode,
    known_tables,
    layout_of,
    table_name,
)
from tests.pipeline.tables.made import KINDS, same_bits, table_of, tables
from tests.support.older_forms import older_table


@given(tables, st.booleans(), st.booleans())
def test_every_bit_comes_back(table: Table, named: bool, copy: bool) -> None:
    back = decode(encode(table), type(table) if named else None, copy=copy)
    assert same_bits(table, back)
    assert encode(back) == encode(table)


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_table_comes_back(kind: type[Table]) -> None:
    assert same_bits(decode(encode(kind.empty())), kind.empty())


def test_special_numbers_keep_their_bits() -> None:
    odd = struct.unpack("<d", struct.pack("<Q", 0x7FF8_0000_DEAD_BEEF))[0]
    table = NodeEvents.build(4, time=[-0.0, odd, np.inf, 5e-324], node=0)
    assert decode(encode(table), NodeEvents).time.view("u8")[1] == 0x7FF8_0000_DEAD_BEEF
    assert np.signbit(decode(encode(table), NodeEvents).time[0])


def test_strided_columns_are_encoded_as_they_read() -> None:
    table = table_of(Tracks, 9, 1)
    assert encode(table[::2]) == encode(table[np.arange(0, 9, 2)])


def test_columns_lie_where_they_can_be_used_and_are_not_copied() -> None:
    data = encode(table_of(Plots, 5, 2))
    view = decode(data, Plots)
    for name in Plots.columns():
        column = getattr(view, name)
        assert column.flags.aligned
        assert not column.flags.writeable
        assert np.shares_memory(column, np.frombuffer(data, np.uint8))
    own = decode(data, Plots, copy=True)
    own.time[:] = 0.0
    assert decode(data, Plots).time.tobytes() == table_of(Plots, 5, 2).time.tobytes()


def test_octets_that_begin_at_an_odd_place_are_read_all_the_same() -> None:
    table = table_of(Tracks, 3, 3)
    shifted = memoryview(b"x" + encode(table))[1:]
    back = decode(shifted, Tracks)
    assert same_bits(back, table)
    assert back.state.flags.aligned


@given(tables, st.data())
def test_what_is_cut_off_or_too_long_is_refused(table: Table, draw: st.DataObject) -> None:
    data = encode(table)
    cut = draw.draw(st.integers(0, len(data) - 1))
    with pytest.raises(CodecError):
        decode(data[:cut])
    with pytest.raises(CodecError, match="more"):
        decode(data + b"\0" * draw.draw(st.integers(1, 9)))


@given(tables, st.data())
def test_a_changed_octet_gives_an_error_or_a_table_as_declared(table: Table, draw: st.DataObject) -> None:
    data = bytearray(encode(table))
    data[draw.draw(st.integers(0, len(data) - 1))] ^= draw.draw(st.integers(1, 255))
    try:
        back = decode(bytes(data), type(table))
    except CodecError:
        return
    type(table)(**{name: getattr(back, name) for name in type(table).columns()})
    for name in type(table).columns():
        getattr(back, name).tolist()


@given(st.binary(max_size=200))
def test_any_octets_give_an_error_only(data: bytes) -> None:
    with pytest.raises(CodecError):
        decode(data)
    assert table_name(data) is None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: b"XXXX" + data[4:], "begins with"),
        (lambda data: data[:4] + b"\x09\0" + data[6:], "version 9"),
        (lambda data: data[:8] + b"\0\0\0\0" + data[12:], "other columns"),
        (lambda data: data[:16] + b"\xff" * 8 + data[24:], "cut off"),
        (lambda data: data.replace(b"Tracks", b"Trucks"), "Trucks"),
        (lambda data: data.replace(b"Tracks", b"\xffracks"), "ASCII"),
    ],
)
def test_the_message_says_what_is_wrong(change, told: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(CodecError, match=told):
        decode(change(encode(table_of(Tracks, 2, 4))))


def test_another_table_than_wanted_is_refused() -> None:
    with pytest.raises(CodecError, match="Plots wanted"):
        decode(encode(Tracks.empty()), Plots)


def test_a_text_beyond_unicode_and_a_third_boolean_are_refused() -> None:
    table = TargetReports.build(1, time=1.0, east=0.0, north=0.0)
    for name, value in (("address", b"\xff\xff\xff\x7f"), ("on_ground", b"\x02")):
        marked = table.replace(address="x", on_ground=True)
        data = bytearray(encode(marked))
        view = np.frombuffer(data, np.uint8)
        at = next(
            place
            for place in range(0, len(view), 8)
            if place > 32 and bytes(data[place : place + len(value)]) == (b"x\0\0\0" if name == "address" else b"\x01")
        )
        broken = bytes(data[:at]) + value + bytes(data[at + len(value) :])
        with pytest.raises(CodecError, match=name):
            decode(broken)


def test_the_layout_tells_every_column_in_order() -> None:
    assert [one["name"] for one in layout_of(Tracks)] == list(Tracks.columns())
    assert layout_of(Tracks)[3] == {
        "name": "covariance", "dtype": "<f8", "shape": [4, 4], "unit": "m, m/s", "meaning": "covariance of state",
    }  # fmt: skip
    assert table_name(encode(Tracks.empty())) == "Tracks"
    assert {kind.__name__ for kind in KINDS} <= set(known_tables())


def test_the_octets_of_tests_are_those_of_the_codec() -> None:
    for kind in KINDS:
        assert older_table(table_of(kind, 3, 5)) == encode(table_of(kind, 3, 5))


@pytest.mark.parametrize("copy", [False, True])
@pytest.mark.parametrize("rows", [0, 1, 5])
def test_columns_that_were_not_yet_written_take_their_default(rows: int, copy: bool) -> None:
    reports = table_of(TargetReports, rows, 6)
    back = decode(older_table(reports, ("source", "altitude")), copy=copy)
    assert same_bits(back, reports.replace(source="", altitude=np.nan))
    back.replace(source="adsb")


@pytest.mark.parametrize("copy", [False, True])
@pytest.mark.parametrize(("narrow", "least", "most"), [("<i4", -(2**31), 2**31 - 1), ("<i2", -(2**15), 2**15 - 1)])
def test_integers_that_were_written_narrower_become_wider(narrow: str, least: int, most: int, copy: bool) -> None:
    tracks = table_of(Tracks, 3, 7).replace(id=[least, -1, most])
    back = decode(older_table(tracks, dtypes={"id": narrow}), Tracks, copy=copy)
    assert same_bits(back, tracks)
    assert back.id.tolist() == [least, -1, most]
    assert not copy or back.id.flags.writeable


def test_unsigned_integers_stay_positive_when_they_become_wider() -> None:
    tracks = table_of(Tracks, 2, 7).replace(number=[255, 0])
    assert decode(older_table(tracks, dtypes={"number": "|u1"}), Tracks).number.tolist() == [255, 0]


def test_texts_that_were_written_one_character_shorter_are_read() -> None:
    reports = table_of(TargetReports, 3, 7).replace(address=["4b1815", "", "abcdef"])
    assert same_bits(decode(older_table(reports, dtypes={"address": "<U6"})), reports)


def test_columns_are_added_and_widened_at_once_in_a_table_of_rows() -> None:
    tracks = table_of(Tracks, 4, 8).replace(id=np.arange(4), hits=7, number=0, sources=0)
    data = older_table(tracks, ("number", "sources"), {"id": "<i4", "hits": "<i2"})
    assert same_bits(decode(data), tracks)


@pytest.mark.parametrize(
    ("without", "dtypes"),
    [
        (("state",), {}),
        ((), {"time": "<f4"}),
        ((), {"zone": "<i8"}),
        ((), {"id": "<u4"}),
        ((), {"number": "<i1"}),
        ((), {"callsign": "<U4"}),
        (("number", "runway", "zone", "simulated", "sources"), {}),
        (("number", "runway", "zone"), {"id": "<i4", "hits": "<i2"}),
    ],
)
def test_other_declarations_are_refused(without: tuple[str, ...], dtypes: dict[str, str]) -> None:
    """No default, narrower reals, much shorter texts, wider integers, another sign, more than MOST_CHANGES."""
    data = older_table(table_of(Tracks, 1, 9).replace(callsign="", id=1, zone=1, time=1.0), without, dtypes)
    with pytest.raises(OtherColumnsError, match="Tracks: written with other columns than this version declares"):
        decode(data)


def test_an_older_table_that_is_cut_off_is_told_as_that() -> None:
    data = older_table(table_of(Tracks, 2, 9), ("number",))
    for octets, told in ((data[:-8], "cut off"), (data + bytes(8), "followed by more")):
        with pytest.raises(CodecError, match=told) as caught:
            decode(octets)
        assert not isinstance(caught.value, OtherFormError)


def test_a_table_that_is_not_known_is_of_another_form() -> None:
    with pytest.raises(OtherFormError, match="Trucks"):
        decode(encode(table_of(Tracks, 2, 4)).replace(b"Tracks", b"Trucks"))
