"""The byte form of values: they come back bit for bit, and nothing foreign is made of octets."""

from __future__ import annotations

import contextlib
import enum
import math
import struct
import subprocess
import sys
import zlib
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.picture import Alert, AlertChange, AlertTarget
from pipeline.tables import Source, Table, Tracks
from pipeline.tables.codec import OtherFormError
from pipeline.values import ValueCodec, is_value
from pipeline.values.differences import first_difference
from pipeline.values.reader import CLASS, FLOAT, HEAD, MAGIC, TAGGED, VERSION
from tests.pipeline.tables.made import table_of, tables


class Colour(enum.Enum):
    RED = "red"
    BOTH = (1, 2)


@dataclass(frozen=True, slots=True)
class Point:
    x: float
    y: float = 0.0


@dataclass(slots=True)
class Open:
    name: str
    seen: dict[int, Point] = field(default_factory=dict)
    made: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.made = 99


class Pair(NamedTuple):
    first: Any
    second: Any


CLASSES = (Colour, Source, Point, Open, Pair, Alert, AlertChange, AlertTarget)
codec = ValueCodec(CLASSES)

floats = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0])
scalars = st.one_of(
    st.none(), st.booleans(), st.integers(), floats, st.text(), st.binary(max_size=20), st.sampled_from(Colour),
    st.sampled_from([Source.RADAR, Source.RADAR | Source.NODE]), st.builds(Point, floats, floats),
    floats.map(np.float64), st.integers(0, 255).map(np.uint8), st.booleans().map(np.bool_),
    st.text(max_size=3).map(np.str_),
)  # fmt: skip
arrays = st.builds(
    lambda dtype, shape, seed: (
        np.random.default_rng(seed)
        .integers(0, 2 if dtype == "?" else 256, (*shape, np.dtype(dtype).itemsize), dtype=np.uint8)
        .view(dtype)
        .reshape(shape)
    ),
    st.sampled_from(["?", "i1", "<i4", ">f8", "f4", "c16", "M8[ns]", "S3", "u8"]),
    st.lists(st.integers(0, 3), max_size=3).map(tuple),
    st.integers(0, 2**32 - 1),
)
keys = st.one_of(st.integers(), st.text(max_size=5), st.tuples(st.integers(), st.text(max_size=2)))
values = st.recursive(
    st.one_of(scalars, arrays, tables),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.lists(inner, max_size=4).map(tuple), st.dictionaries(keys, inner, max_size=4),
        st.sets(keys, max_size=4), st.frozensets(keys, max_size=4), st.lists(inner, max_size=3).map(deque),
        st.lists(inner, max_size=3).map(lambda one: deque(one, 5)), st.builds(Pair, inner, inner),
        st.dictionaries(keys, st.integers(), max_size=4).map(Counter),
        st.builds(Open, st.text(max_size=4), st.dictionaries(st.integers(), st.just(Point(1.0)), max_size=2)),
    ),
    max_leaves=8,
)  # fmt: skip


@settings(max_examples=300)
@given(values)
def test_every_bit_and_type_comes_back(value: Any) -> None:
    data = codec.encode(value)
    back = codec.decode(data)
    assert first_difference(value, back) is None
    assert codec.encode(back) == data
    assert is_value(data)


@given(values, st.data())
def test_octets_cut_off_or_followed_by_more_are_refused(value: Any, draw: st.DataObject) -> None:
    data = codec.encode(value)
    with pytest.raises(ValueError):
        codec.decode(data[: draw.draw(st.integers(0, len(data) - 1))])
    with pytest.raises(ValueError):
        codec.decode(data + b"N")


@settings(max_examples=400)
@given(values, st.data())
def test_a_changed_octet_gives_a_value_or_a_value_error(value: Any, draw: st.DataObject) -> None:
    data = bytearray(codec.encode(value))
    data[draw.draw(st.integers(0, len(data) - 1))] ^= draw.draw(st.integers(1, 255))
    with contextlib.suppress(ValueError):
        codec.decode(bytes(data))


@given(st.binary(max_size=60))
def test_any_octets_behind_a_right_head_give_a_value_or_a_value_error(data: bytes) -> None:
    with contextlib.suppress(ValueError):
        codec.decode(codec.encode(None)[:-1] + data)


def test_fields_are_set_as_they_were_and_nothing_runs() -> None:
    one = Open("a", {3: Point(-0.0)})
    one.made = 7
    back = codec.decode(codec.encode(one))
    assert (back.made, back.seen) == (7, {3: Point(0.0)})
    assert math.copysign(1.0, back.seen[3].x) == -1.0


def test_arrays_and_tables_are_writable_and_own() -> None:
    array, table = np.arange(6).reshape(2, 3)[:, ::-1], table_of(Tracks, 3, 1)
    data = codec.encode([array, table])
    back, rows = codec.decode(data)
    back[0, 0] = 100
    rows.state[:] = 0.0
    assert codec.decode(data)[0].tolist() == array.tolist()


@pytest.mark.parametrize(
    "value", [object(), Pair, len, np.array([object()]), np.zeros(1, [("a", "f8")]), bytearray(b"x"), 1 + 2j]
)
def test_what_has_no_form_is_refused_at_encode(value: object) -> None:
    with pytest.raises(ValueError):
        codec.encode([value])


def test_a_class_that_is_not_registered_is_named_at_both_ends() -> None:
    with pytest.raises(ValueError, match="Point is not registered"):
        ValueCodec().encode({"a": Point(1.0)})
    with pytest.raises(OtherFormError, match="Point is not registered"):
        ValueCodec([Colour]).decode(codec.encode({"a": Point(1.0)}))


def test_a_class_whose_fields_have_changed_is_named_with_both() -> None:
    @dataclass
    class Other:
        x: float
        z: float

    Other.__qualname__ = "Point"
    with pytest.raises(
        OtherFormError, match=r"Point was written with the fields \['x', 'y'\]; here they are \['x', 'z'\]"
    ):
        ValueCodec([Other]).decode(codec.encode(Point(1.0)))
    with pytest.raises(ValueError, match="two classes are called Point"):
        ValueCodec([Point, Other])
    with pytest.raises(ValueError, match="int is neither"):
        ValueCodec([int])


def test_fields_that_were_not_written_take_their_defaults() -> None:
    @dataclass(slots=True)
    class Later:
        name: str
        kind: str = "car"
        seen: dict[int, Point] = field(default_factory=dict)
        made: int = field(init=False, default=0)
        places: list[int] = field(default_factory=lambda: [4])

    class LaterPair(NamedTuple):
        first: Any
        second: Any
        third: Any = "none"

    Later.__qualname__, LaterPair.__qualname__ = "Open", "Pair"
    later = ValueCodec([Later, LaterPair, Point])
    value = [Open("a", {1: Point(2.0)}), Pair(3, Open("b")), Pair(5, 6)]
    one, pair, plain = later.decode(codec.encode(value))
    assert (one.name, one.kind, one.seen, one.made, one.places) == ("a", "car", {1: Point(2.0)}, 99, [4])
    assert (type(pair), pair.first, pair.second.name, pair.third) == (LaterPair, 3, "b", "none")
    assert plain == (5, 6, "none")
    assert one.places is not pair.second.places
    assert later.encode([one, pair, plain]) == later.encode(later.decode(later.encode([one, pair, plain])))


@pytest.mark.parametrize("fields", ["y", "y x", "x y z", "x x", "x  ", "x y ", ""])
def test_no_other_change_of_fields_is_read(fields: str) -> None:
    """Point has x, without a default, and y, with one."""
    written = f"Point {fields}".encode()
    reference = zlib.crc32(written)
    data = HEAD.pack(MAGIC, VERSION, 1) + CLASS.pack(reference, len(written)) + written
    data += TAGGED.pack(b"D", reference) + FLOAT.pack(b"f", 1.0) * len(fields.split())
    if fields.split() == ["x"]:
        assert codec.decode(data) == Point(1.0, 0.0)
        with pytest.raises(ValueError, match="Point was written with") as caught:
            codec.decode(data.replace(struct.pack("<I", reference), b"abcd"))
        assert not isinstance(caught.value, OtherFormError), "damage"
        return
    with pytest.raises(OtherFormError, match="Point was written with"):
        codec.decode(data)


def test_a_value_that_holds_itself_or_nests_too_deep_is_refused() -> None:
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(ValueError, match="deep"):
        codec.encode(loop)
    with pytest.raises(ValueError, match="deep"):
        codec.decode(codec.encode(None)[:-1] + b"l\x01\0\0\0" * 100_000 + b"N")


def test_great_sizes_in_few_octets_take_no_memory() -> None:
    head = codec.encode(None)[:-1]
    array = b"a\x03<f8\x02" + struct.pack("<2Q", 2**40, 2**20)
    for body in (b"l\xff\xff\xff\xff", b"s\xff\xff\xff\x7f", array, b"a\x03<f8\x02" + struct.pack("<2Q", 0, 2**62)):
        with pytest.raises(ValueError):
            codec.decode(head + body)


def test_order_of_sets_and_of_classes_leaves_no_trace() -> None:
    script = (
        "from tests.pipeline.values.test_values import *\n"
        "print(codec.encode([{'a','b','c', Colour.RED, Source.NODE}, frozenset('xyz')]).hex())"
    )
    told = {
        subprocess.run(
            [sys.executable, "-c", script], env={"PYTHONHASHSEED": seed, "PATH": ""}, capture_output=True, check=True
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(told) == 1
    other = ValueCodec(reversed(CLASSES))
    assert other.encode([Point(1.0), Colour.RED]) == codec.encode([Point(1.0), Colour.RED])


NAN = float("nan")
OTHER_NAN = struct.unpack("<d", struct.pack("<Q", 0x7FF8_0000_0000_0001))[0]


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [
        (NAN, NAN, None),
        (0.0, -0.0, "value: 0.0 recorded, -0.0 replayed"),
        (NAN, OTHER_NAN, "value: nan (bits 7ff8000000000000) recorded, nan (bits 7ff8000000000001) replayed"),
        (1, 1.0, "value: 1 (int) recorded, 1.0 (float) replayed"),
        (1, True, "value: 1 (int) recorded, True (bool) replayed"),
        ({"a": [1, 2]}, {"a": [1, 3]}, "['a'][1]: 2 recorded, 3 replayed"),
        ({"a": 1}, {}, "['a']: 1 recorded, nothing replayed"),
        ({}, {"a": 1}, "['a']: nothing recorded, 1 replayed"),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, "keys in the order"),
        ([1], [1, 2], "value: 1 members recorded, 2 members replayed"),
        (deque([1], 2), deque([1], 3), "maximum length 2 recorded"),
        ({1, 2}, {1, 3}, "only the members 2 recorded, only the members 3 replayed"),
        ({0.0}, {-0.0}, "only the members 0.0 recorded, only the members -0.0 replayed"),
        ({1: 2}, {True: 2}, "keys in the order [1] recorded"),
        (frozenset("ab"), frozenset("ba"), None),
        (Open("a"), Open("b"), "name: 'a' recorded, 'b' replayed"),
        (Pair(1, Point(1.0)), Pair(1, Point(2.0)), "second.x: 1.0 recorded, 2.0 replayed"),
        (np.zeros(2), np.zeros(3), "<f8 of shape (2,) recorded"),
        (np.zeros((2, 2)), np.array([[0, 0], [0, -0.0]]), "value[1, 1]: 0.0 recorded, -0.0 replayed"),
        (np.float32(1.5), np.float32(2.5), "value: 1.5 recorded, 2.5 replayed"),
        (Colour.RED, Colour.BOTH, "RED"),
    ],
)
def test_the_first_difference_is_named(a: Any, b: Any, told: str | None) -> None:
    found = first_difference(a, b)
    assert (found is None) if told is None else (found is not None and told in found)


def test_a_difference_in_a_table_names_column_and_row() -> None:
    one = Tracks.build(20, id=np.arange(20), time=0.0, state=np.full((20, 4), 103.25), covariance=np.eye(4))
    state = one.state.copy()
    state[12, 0] = 103.26
    other = one.replace(state=state)
    found = first_difference({"tracks": one}, {"tracks": other})
    assert found == "['tracks'].state[12, 0]: 103.25 recorded, 103.26 replayed"
    assert first_difference(one, other, "tracks") == "tracks.state[12, 0]: 103.25 recorded, 103.26 replayed"
    assert first_difference(one, one[:19]) == "Tracks: 20 rows recorded, 19 rows replayed"


@given(tables, st.data())
def test_one_flipped_bit_of_a_table_is_found(table: Table, draw: st.DataObject) -> None:
    if not len(table):
        return
    name = draw.draw(
        st.sampled_from([n for n, one in type(table).columns().items() if np.dtype(one.dtype).kind in "iuf"])
    )
    changed = getattr(table, name).copy()
    octets = changed.reshape(-1).view(np.uint8)
    octets[draw.draw(st.integers(0, len(octets) - 1))] ^= 1 << draw.draw(st.integers(0, 7))
    found = first_difference(table, table.replace(**{name: changed}), "tracks")
    assert found is not None
    assert found.startswith(f"tracks.{name}[")
