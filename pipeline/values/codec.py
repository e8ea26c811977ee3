"""The byte form of nested values: snapshots of state, commands, alerts. Nothing in the octets can run or import code.

A `ValueCodec` knows the classes it was given, and no others. The layout, little endian:

    4s magic "AVAL" | u16 version | u16 number of classes
    for each class used: u32 reference | u16 length | its description, UTF-8: "Name field field ..."
    one value

A value is one octet that says its kind, and then:

    N none | T true | F false | i 8 octets signed | I u32 length, signed whole number | f 8 octets IEEE 754
    s u32 length, UTF-8 | b u32 length, octets
    l t S Z u32 count, values (list, tuple, set, frozenset; sets in the order of their members' octets)
    q maximum length (a value), u32 count, values (deque) | d c u32 count, key and value in turn (dict, Counter)
    e u32 reference, value (member of an enum) | D u32 reference, the fields' values in order (dataclass, named tuple)
    a u8 length, dtype, u8 dimensions, u64 each, items in C order (array) | n u8 length, dtype, item (numpy scalar)
    B u64 length, the byte form of a table (pipeline.tables.codec)

A reference is the CRC-32 of the description, so that a class whose fields have changed is known. It is refused, but for
one case: octets written before a class got further fields are read when each of these has a default, which it takes.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from collections import Counter, deque
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Any

import numpy as np

from pipeline.tables import codec
from pipeline.tables.schema import Table
from pipeline.values.reader import (
    CLASS,
    COUNT,
    DTYPE,
    FLOAT,
    HEAD,
    INT,
    INT64,
    LONG,
    MAGIC,
    TAGGED,
    VERSION,
    ValueReader,
)


def is_value(data: codec.Octets) -> bool:
    """Whether the octets claim to be the byte form of a value. Reads the magic only."""
    return bytes(data[:4]) == MAGIC


class ValueCodec:
    """Encodes and decodes nested values; dataclasses, named tuples and enums only of the classes it was given.

    Same value, same octets: they may be compared. Arrays and tables decode to writable copies of their own.
    """

    def __init__(self, classes: Iterable[type] = ()) -> None:
        self._described: dict[type, bytes] = {}
        self._reference: dict[type, int] = {}
        self._by_reference: dict[int, type] = {}
        self._fields: dict[type, tuple[str, ...]] = {}
        names: dict[str, type] = {}
        for kind in dict.fromkeys(classes):
            fields = _fields_of(kind)
            description = " ".join((kind.__qualname__, *fields)).encode()
            reference = zlib.crc32(description)
            if kind.__qualname__ in names or reference in self._by_reference:
                raise ValueError(f"two classes are called {kind.__qualname__}; their octets could not be told apart")
            names[kind.__qualname__] = kind
            self._described[kind], self._reference[kind] = description, reference
            self._by_reference[reference], self._fields[kind] = kind, fields

    def encode(self, value: Any) -> bytes:
        """The octets of a value. Raises ValueError for what has no byte form, and for classes that were not given."""
        writer = _Writer(self._reference, self._fields)
        try:
            writer.put(value)
        except RecursionError:
            raise ValueError("a value that is nested too deep, or that holds itself") from None
        head = [HEAD.pack(MAGIC, VERSION, len(writer.used))]
        for kind in sorted(writer.used, key=self._reference.__getitem__):
            description = self._described[kind]
            head += (CLASS.pack(self._reference[kind], len(description)), description)
        return b"".join(head + writer.parts)

    def decode(self, data: codec.Octets) -> Any:
        """The value of these octets, which may come from anywhere. Raises ValueError for all that are not well formed,
        and of these OtherFormError for classes and tables that this version does not have, or declares otherwise.

        Fields of dataclasses are set as they were, and those that were not written to their defaults; no __init__ and
        no __post_init__ runs.
        """
        reader = ValueReader(bytes(data), self._by_reference, self._fields)
        try:
            reader.classes(self._described)
            value = reader.value()
        except RecursionError:
            raise ValueError("octets nested too deep") from None
        except struct.error:
            raise ValueError("octets of a value: cut off") from None
        if reader.at != len(reader.data):
            raise ValueError(f"octets of a value: followed by {len(reader.data) - reader.at} more")
        return value


def _fields_of(kind: type) -> tuple[str, ...]:
    if issubclass(kind, Table):
        raise ValueError(f"{kind.__qualname__} is a table; tables need not be registered")
    if issubclass(kind, Enum):
        return ()
    if dataclasses.is_dataclass(kind):
        return tuple(field.name for field in dataclasses.fields(kind))
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return tuple(kind._fields)
    raise ValueError(f"{kind.__qualname__} is neither a dataclass nor a named tuple nor an enum")


class _Writer:
    """Appends the octets of values to `parts`; `used`: the registered classes met."""

    def __init__(self, references: dict[type, int], fields: dict[type, tuple[str, ...]]) -> None:
        self.parts: list[bytes] = []
        self.used: set[type] = set()
        self._references = references
        self._fields = fields

    def put(self, value: Any) -> None:
        """Append one value."""
        how = _PUT.get(type(value))
        if how is not None:
            how(self, value)
        elif type(value) in self._references:
            self._registered(value)
        elif isinstance(value, Table):
            octets = codec.encode(value)
            self.parts += (b"B", LONG.pack(len(octets)), octets)
        elif isinstance(value, np.generic):
            self._scalar(value)
        else:
            kind = type(value)
            raise ValueError(f"{kind.__module__}.{kind.__qualname__} is not registered and has no byte form")

    def _registered(self, value: Any) -> None:
        kind = type(value)
        self.used.add(kind)
        if isinstance(value, Enum):
            self.parts.append(TAGGED.pack(b"e", self._references[kind]))
            self.put(value.value)
            return
        self.parts.append(TAGGED.pack(b"D", self._references[kind]))
        for name in self._fields[kind]:
            try:
                field = getattr(value, name)
            except AttributeError:
                raise ValueError(f"{kind.__qualname__}.{name} is not set") from None
            self.put(field)

    def _int(self, value: int) -> None:
        if INT64[0] <= value <= INT64[1]:
            self.parts.append(INT.pack(b"i", value))
            return
        octets = value.to_bytes(value.bit_length() // 8 + 1, "little", signed=True)
        self._sized(b"I", octets)

    def _sized(self, tag: bytes, octets: bytes) -> None:
        self.parts += (TAGGED.pack(tag, len(octets)), octets)

    def _text(self, value: str) -> None:
        self._sized(b"s", value.encode("utf-8", "surrogatepass"))

    def _members(self, tag: bytes, values: Any) -> None:
        self.parts.append(TAGGED.pack(tag, len(values)))
        for one in values:
            self.put(one)

    def _set(self, tag: bytes, values: Any) -> None:
        members = []
        for one in values:
            inner = _Writer(self._references, self._fields)
            inner.put(one)
            self.used |= inner.used
            members.append(b"".join(inner.parts))
        self.parts.append(TAGGED.pack(tag, len(members)))
        self.parts += sorted(members)

    def _deque(self, value: deque[Any]) -> None:
        self.parts.append(b"q")
        self.put(value.maxlen)
        self.parts.append(COUNT.pack(len(value)))
        for one in value:
            self.put(one)

    def _mapping(self, tag: bytes, value: dict[Any, Any]) -> None:
        self.parts.append(TAGGED.pack(tag, len(value)))
        for key, one in value.items():
            self.put(key)
            self.put(one)

    def _array(self, value: np.ndarray[Any, Any]) -> None:
        sides = struct.pack(f"<B{value.ndim}Q", value.ndim, *value.shape)
        self.parts += (b"a", _dtype_octets(value.dtype), sides, value.tobytes())

    def _scalar(self, value: np.generic) -> None:
        octets = np.asarray(value)
        self.parts += (b"n", _dtype_octets(octets.dtype), octets.tobytes())


_PUT: dict[type, Callable[[_Writer, Any], None]] = {
    type(None): lambda writer, _: writer.parts.append(b"N"),
    bool: lambda writer, value: writer.parts.append(b"T" if value else b"F"),
    int: _Writer._int,
    float: lambda writer, value: writer.parts.append(FLOAT.pack(b"f", value)),
    str: _Writer._text,
    bytes: lambda writer, value: writer._sized(b"b", value),
    list: lambda writer, value: writer._members(b"l", value),
    tuple: lambda writer, value: writer._members(b"t", value),
    set: lambda writer, value: writer._set(b"S", value),
    frozenset: lambda writer, value: writer._set(b"Z", value),
    deque: _Writer._deque,
    dict: lambda writer, value: writer._mapping(b"d", value),
    Counter: lambda writer, value: writer._mapping(b"c", value),
    np.ndarray: _Writer._array,
}


def _dtype_octets(dtype: np.dtype[Any]) -> bytes:
    text = dtype.str
    if dtype.names or not DTYPE.fullmatch(text):
        raise ValueError(f"an array of {dtype} has no byte form")
    return bytes((len(text),)) + text.encode("ascii")
