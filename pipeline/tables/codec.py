"""The byte form of a table: what the journal, the bus and the recordings carry.

Layout, little endian, every part padded with zeros to a multiple of 8 octets:

    4s magic "ATBL" | u16 version | u16 length of the name | u32 fingerprint | u32 number of columns | u64 rows
    name of the table, ASCII
    each column in the order of its declaration, C order; text as UTF-32

The fingerprint is the CRC-32 of the declaration (name, dtype and row shape of every column), so that octets written for
another declaration are refused and never read as something else, but for one case: octets written before a table got
further columns, before integer columns got wider, or before text columns got one character more, are read when each
further column has a default, which it takes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from math import prod
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.tables.schema import Table

T = TypeVar("T", bound=Table)
Octets = bytes | bytearray | memoryview

MAGIC = b"ATBL"
VERSION = 1
"""The first octets of every table, and the version of the byte form."""

ALIGNMENT = 8
"""Octets; the greatest item of a column is 8 octets, so that columns can be used where they lie."""

UTF32_OCTETS = 4
"""Octets of one character of a text column."""

GREATEST_CODE_POINT = 0x10FFFF
"""Of Unicode; a UTF-32 unit above it is no text."""

MOST_CHANGES = 4
"""Columns added or widened since octets were written. The declaration is found by its fingerprint alone; of so many
changes to the largest table there are some ten thousand, which take 0.1 s to try, once for each fingerprint."""

KEPT_SEARCHES = 64
"""Fingerprints of which the outcome of the search is remembered."""

_HEAD = struct.Struct("<4sHHIIQ")


class OtherFormError(ValueError):
    """The octets were written for a declaration of tables or classes that this version of the program cannot read."""


class CodecError(ValueError):
    """The octets are not the byte form of the table wanted; the message says what is wrong."""


class OtherColumnsError(CodecError, OtherFormError):
    """The octets belong to a table that this version does not know, or declares with other columns."""


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    stored: np.dtype[Any]
    native: np.dtype[Any]
    shape: tuple[int, ...]
    row_bytes: int
    default: Any
    text: str
    """What the fingerprint is made of."""

    def narrower(self) -> list[_Field]:
        """The same column with each integer type of the same sign that has fewer octets, or with one character less."""
        kind, size = self.native.kind, self.native.itemsize
        if kind == "U" and size > UTF32_OCTETS:
            return [_field(self.name, f"U{size // UTF32_OCTETS - 1}", self.shape, self.default)]
        if kind not in "iu":
            return []
        return [_field(self.name, f"{kind}{octets}", self.shape, self.default) for octets in (1, 2, 4) if octets < size]


@dataclass(frozen=True, slots=True)
class _Layout:
    kind: type[Table]
    label: bytes
    fingerprint: int
    fields: tuple[_Field, ...]
    """Those that are written; all of the kind unless it is an older layout."""

    def size(self, rows: int) -> int:
        """Octets of the whole byte form."""
        return _HEAD.size + _padded(len(self.label)) + sum(_padded(one.row_bytes * rows) for one in self.fields)


_layouts: dict[type[Table], _Layout] = {}


def encode(table: Table) -> bytes:
    """The byte form of a table. The same values give the same octets."""
    layout = _layout(type(table))
    rows = len(table)
    parts = [
        _HEAD.pack(MAGIC, VERSION, len(layout.label), layout.fingerprint, len(layout.fields), rows),
        layout.label,
        _padding(len(layout.label)),
    ]
    for one in layout.fields:
        values = getattr(table, one.name)
        parts.append(values.astype(one.stored, copy=False).tobytes())
        parts.append(_padding(one.row_bytes * rows))
    return b"".join(parts)


def decode(data: Octets, kind: type[T] | None = None, *, copy: bool = False) -> T:
    """The table of a byte form. kind: the table wanted; None: whichever the octets name.

    Columns that were not yet written take their default; integers and texts that were written narrower become wider.
    copy: the columns are writable and own their octets; otherwise they are read-only views of `data` wherever the
    alignment allows. Raises CodecError for everything that is not exactly the byte form of one such table, and of these
    OtherColumnsError for tables and columns that this version does not declare.
    """
    name, fingerprint, columns, rows = _head(data)
    layout = _layout(kind) if kind is not None else _named(name)
    wanted = layout.label.decode()
    if name != wanted:
        raise CodecError(f"octets of the table {name!r}, {wanted} wanted")
    declared = layout.fields
    if fingerprint != layout.fingerprint or columns != len(declared):
        older = _older_layout(layout.kind, fingerprint, columns)  # type: ignore[arg-type]  # a class has a hash
        if older is None:
            raise OtherColumnsError(f"{name}: written with other columns than this version declares")
        layout = older
    size = layout.size(rows)
    if len(data) != size:
        what = "cut off" if len(data) < size else "followed by more"
        raise CodecError(f"{name}: {what}: {rows} rows take {size} octets, {len(data)} given")
    buffer = bytearray(data) if copy else data
    at = _HEAD.size + _padded(len(layout.label))
    made: dict[str, NDArray[Any]] = {}
    for one in layout.fields:
        made[one.name] = _column(buffer, at, one, rows, name)
        at += _padded(one.row_bytes * rows)
    if layout.fields is not declared:
        made = {one.name: _as_declared(made.get(one.name), one, rows) for one in declared}
    return layout.kind._of_good(made)  # type: ignore[return-value]


def table_name(data: Octets) -> str | None:
    """The name of the table of which these octets are the byte form; None when they are none. Reads the head only."""
    try:
        return _head(data)[0]
    except CodecError:
        return None


def layout_of(kind: type[Table]) -> list[dict[str, Any]]:
    """The columns as they lie in the byte form, as plain values: name, dtype, row shape, unit and meaning."""
    declared = kind.columns()
    return [
        {
            "name": one.name,
            "dtype": one.stored.str,
            "shape": list(one.shape),
            "unit": declared[one.name].unit,
            "meaning": declared[one.name].meaning,
        }
        for one in _layout(kind).fields
    ]


def known_tables() -> dict[str, type[Table]]:
    """All tables declared so far, by name."""
    found: dict[str, type[Table]] = {}
    waiting = list(Table.__subclasses__())
    while waiting:
        kind = waiting.pop()
        found.setdefault(kind.__name__, kind)
        waiting.extend(kind.__subclasses__())
    return found


def checked_items(values: NDArray[Any]) -> bool:
    """Whether every item is one that its dtype can hold: booleans 0 or 1, text of Unicode code points only."""
    if not values.size:
        return True
    if values.dtype.kind == "b":
        return bool(values.view(np.uint8).max() <= 1)
    if values.dtype.kind == "U":
        unit = np.dtype("u4").newbyteorder(values.dtype.byteorder)
        return bool(values.reshape(-1).view(unit).max() <= GREATEST_CODE_POINT)
    return True


def _head(data: Octets) -> tuple[str, int, int, int]:
    if len(data) < _HEAD.size:
        raise CodecError(f"no table: {len(data)} octets are fewer than the {_HEAD.size} of a head")
    magic, version, length, fingerprint, columns, rows = _HEAD.unpack_from(data)
    if magic != MAGIC:
        raise CodecError(f"no table: it begins with {magic!r} instead of {MAGIC!r}")
    if version != VERSION:
        raise CodecError(f"a table in version {version} of the byte form; this program reads version {VERSION}")
    label = bytes(data[_HEAD.size : _HEAD.size + length])
    if len(label) != length:
        raise CodecError("no table: cut off inside its name")
    try:
        return label.decode("ascii"), fingerprint, columns, rows
    except UnicodeDecodeError:
        raise CodecError(f"no table: its name {label!r} is not ASCII") from None


def _column(buffer: Octets, at: int, one: _Field, rows: int, table: str) -> NDArray[Any]:
    shape = (rows, *one.shape)
    values: NDArray[Any] = np.frombuffer(buffer, dtype=one.stored, count=prod(shape), offset=at).reshape(shape)
    if not values.flags.aligned:
        values = values.copy()
    if not checked_items(values):
        what = "booleans" if one.stored.kind == "b" else "text"
        raise CodecError(f"{table}.{one.name}: octets that are no {what}")
    return values.astype(one.native, copy=False)


def _layout(kind: type[Table]) -> _Layout:
    known = _layouts.get(kind)
    if known is None:
        fields = tuple(_field(name, one.dtype, one.shape, one.default) for name, one in kind.columns().items())
        label = kind.__name__.encode("ascii")
        known = _layouts[kind] = _Layout(kind, label, _fingerprint(fields), fields)
    return known


def _field(name: str, dtype: str, shape: tuple[int, ...], default: Any) -> _Field:
    native = np.dtype(dtype)
    stored = native.newbyteorder("<")
    text = f"{name} {stored.str} {list(shape)}"
    return _Field(name, stored, native, shape, native.itemsize * prod(shape), default, text)


def _fingerprint(fields: tuple[_Field, ...]) -> int:
    return zlib.crc32(";".join([one.text for one in fields]).encode())


@lru_cache(KEPT_SEARCHES)
def _older_layout(kind: type[Table], fingerprint: int, columns: int) -> _Layout | None:
    """The declaration that this fingerprint belonged to, before columns were added or widened; None when unknown."""
    layout = _layout(kind)
    added = len(layout.fields) - columns
    if not 0 <= added <= MOST_CHANGES:
        return None
    optional = [place for place, one in enumerate(layout.fields) if one.default is not None]
    for left_out in combinations(optional, added):
        kept = tuple(one for place, one in enumerate(layout.fields) if place not in left_out)
        for fields in _narrowed(kept, MOST_CHANGES - added):
            if _fingerprint(fields) == fingerprint:
                return _Layout(kind, layout.label, fingerprint, fields)
    return None


def _narrowed(fields: tuple[_Field, ...], most: int) -> Iterator[tuple[_Field, ...]]:
    """The fields with up to `most` of them narrower, those with few changes first."""
    choices = {place: narrower for place, one in enumerate(fields) if (narrower := one.narrower())}
    for count in range(most + 1):
        for places in combinations(choices, count):
            for chosen in product(*(choices[place] for place in places)):
                other = dict(zip(places, chosen, strict=True))
                yield tuple(other.get(place, one) for place, one in enumerate(fields))


def _as_declared(values: NDArray[Any] | None, one: _Field, rows: int) -> NDArray[Any]:
    if values is None:
        return np.full((rows, *one.shape), one.default, one.native)
    return values.astype(one.native, copy=False)


def _named(name: str) -> _Layout:
    kind = known_tables().get(name)
    if kind is None:
        raise OtherColumnsError(f"octets of a table {name!r}, which this version does not know")
    return _layout(kind)


def _padded(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT


def _padding(size: int) -> bytes:
    return bytes(-size % ALIGNMENT)
