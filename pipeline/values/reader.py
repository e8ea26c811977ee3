"""Reads the byte form of nested values (`pipeline.values.codec`), all checked: octets may come from anywhere."""

from __future__ import annotations

import dataclasses
import re
import struct
import zlib
from collections import Counter, deque
from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from math import prod
from typing import Any

import numpy as np

from pipeline.tables import codec
from pipeline.tables.schema import Table

MAGIC = b"AVAL"
VERSION = 1
"""The first octets of every value, and the version of the byte form."""

DTYPE = re.compile(r"[<>|](b1|[iu][1248]|f[248]|c(8|16)|[SUV][1-9]\d{0,8}|[mM]8(\[\w+\])?)")
"""Plain items only: no objects, no records, nothing whose size depends on the machine."""

MOST_DIMENSIONS = 32
"""Of an array; the least bound among the versions of numpy."""

HEAD = struct.Struct("<4sHH")
CLASS = struct.Struct("<IH")
"""Magic, version, number of classes; of each class: reference, octets of its description."""

COUNT = struct.Struct("<I")
LONG = struct.Struct("<Q")
INT = struct.Struct("<cq")
FLOAT = struct.Struct("<cd")
TAGGED = struct.Struct("<cI")
"""Counts and references, and values behind the octet that says their kind; see `pipeline.values.codec`."""

INT64 = (-(2**63), 2**63 - 1)
"""The least and the greatest number that is stored in 8 octets."""


def defaults_of(kind: type) -> dict[str, Callable[[], Any]]:
    """What makes the default of each field of a dataclass or named tuple that has one."""
    if not dataclasses.is_dataclass(kind):
        return {name: partial(_same, value) for name, value in getattr(kind, "_field_defaults", {}).items()}
    made: dict[str, Callable[[], Any]] = {}
    for field in dataclasses.fields(kind):
        if field.default_factory is not dataclasses.MISSING:
            made[field.name] = field.default_factory
        elif field.default is not dataclasses.MISSING:
            made[field.name] = partial(_same, field.default)
    return made


def _same(value: Any) -> Any:
    return value


class ValueReader:
    """Takes values from octets; `at` is where the next begins."""

    def __init__(self, data: bytes, kinds: dict[int, type], fields: dict[type, tuple[str, ...]]) -> None:
        self.data = data
        self.at = 0
        self._kinds = kinds
        self._fields = fields
        self._older: dict[int, tuple[type, list[str]]] = {}

    def classes(self, described: dict[type, bytes]) -> None:
        """Read the head; OtherFormError naming a class that is not registered, or that has other fields here.

        A class that was written without fields that have a default here is taken.
        """
        magic, version, count = HEAD.unpack_from(self.data)
        if magic != MAGIC:
            raise ValueError(f"no value: it begins with {magic!r} instead of {MAGIC!r}")
        if version != VERSION:
            raise ValueError(f"a value in version {version} of the byte form; this program reads version {VERSION}")
        self.at = HEAD.size
        registered = {kind.__qualname__: kind for kind in described}
        for _ in range(count):
            reference, length = CLASS.unpack(self.take(CLASS.size))
            description = self.take(length)
            kind = self._kinds.get(reference)
            if kind is not None and described[kind] == description:
                continue
            name, *fields = description.decode("utf-8", "replace").split() or ["?"]
            here = registered.get(name)
            error = codec.OtherFormError if reference == zlib.crc32(description) else ValueError
            if here is None:
                raise error(f"{name} is not registered")
            if kind is not None or error is ValueError or not self._is_older(here, fields):
                raise error(f"{name} was written with the fields {fields}; here they are {[*self._fields[here]]}")
            self._older[reference] = (here, fields)

    def _is_older(self, kind: type, written: list[str]) -> bool:
        """Nothing but fields with a default has been added to the class since."""
        added = set(self._fields[kind]).difference(written)
        kept = [name for name in self._fields[kind] if name not in added]
        return bool(added) and written == kept and added <= defaults_of(kind).keys()

    def take(self, size: int) -> bytes:
        """The next octets; ValueError when there are fewer."""
        octets = self.data[self.at : self.at + size]
        if len(octets) != size:
            raise ValueError("octets of a value: cut off")
        self.at += size
        return octets

    def value(self) -> Any:
        """The next value."""
        tag = self.take(1)
        how = _TAKE.get(tag)
        if how is None:
            raise ValueError(f"octets of a value: unknown kind {tag!r} at octet {self.at - 1}")
        return how(self)

    def count(self) -> int:
        """A number of values or octets that follow; each takes at least one octet."""
        (count,) = COUNT.unpack(self.take(4))
        if count > len(self.data) - self.at:
            raise ValueError("octets of a value: cut off")
        return int(count)

    def sized(self) -> bytes:
        """Octets behind their length."""
        return self.take(self.count())

    def members(self) -> list[Any]:
        """Values behind their count."""
        return [self.value() for _ in range(self.count())]

    def hashed(self, make: Callable[[list[Any]], Any]) -> Any:
        """A set or mapping. Each member once."""
        members = self.members() if make in (set, frozenset) else [self._pair() for _ in range(self.count())]
        try:
            made = make(members)
        except TypeError as error:
            raise ValueError(f"octets of a value: {error}") from None
        if len(made) != len(members):
            raise ValueError("octets of a value: a member or key stands twice")
        return made

    def _pair(self) -> tuple[Any, Any]:
        return self.value(), self.value()

    def deque(self) -> deque[Any]:
        """A deque with its maximum length."""
        longest = self.value()
        if longest is not None and (type(longest) is not int or longest < 0):
            raise ValueError(f"octets of a value: {longest!r} is no length of a deque")
        members = self.members()
        if longest is not None and not len(members) <= longest <= INT64[1]:
            raise ValueError("octets of a value: a deque with another length than it may have")
        return deque(members, longest)

    def kind(self, wanted: str) -> tuple[type, Sequence[str]]:
        """A registered class, and those of its fields that follow."""
        (reference,) = COUNT.unpack(self.take(4))
        kind = self._kinds.get(reference)
        here, written = (kind, self._fields[kind]) if kind is not None else self._older.get(reference, (None, ()))
        if here is None or issubclass(here, Enum) != (wanted == "enum"):
            raise ValueError(f"octets of a value: no registered {wanted} has the reference {reference:08x}")
        return here, written

    def member(self) -> Any:
        """A member of an enum."""
        kind, _ = self.kind("enum")
        value = self.value()
        try:
            return kind(value)
        except (ValueError, TypeError, KeyError):
            raise ValueError(f"octets of a value: {kind.__qualname__} has no member {value!r}") from None

    def instance(self) -> Any:
        """A dataclass or named tuple."""
        kind, written = self.kind("class")
        values = {name: self.value() for name in written}
        fields = self._fields[kind]
        if len(written) < len(fields):
            make = defaults_of(kind)
            values = {name: values[name] if name in values else make[name]() for name in fields}
        if issubclass(kind, tuple):
            return tuple.__new__(kind, values.values())
        made = object.__new__(kind)
        for name, value in values.items():
            object.__setattr__(made, name, value)
        return made

    def _dtype(self) -> np.dtype[Any]:
        text = self.take(self.take(1)[0]).decode("latin-1")
        if not DTYPE.fullmatch(text):
            raise ValueError(f"octets of a value: {text!r} is no dtype that is read")
        try:
            return np.dtype(text)
        except (TypeError, ValueError):
            raise ValueError(f"octets of a value: {text!r} is no dtype") from None

    def array(self, scalar: bool = False) -> np.ndarray[Any, Any]:
        """An array of its own octets."""
        dtype = self._dtype()
        dimensions = 0 if scalar else self.take(1)[0]
        if dimensions > MOST_DIMENSIONS:
            raise ValueError(f"octets of a value: an array of {dimensions} dimensions")
        shape = struct.unpack(f"<{dimensions}Q", self.take(8 * dimensions))
        items = self.take(prod(shape) * dtype.itemsize)
        try:
            made = np.empty(shape, dtype)
            if items:
                made = np.frombuffer(items, dtype=dtype).reshape(shape).copy()
        except (ValueError, OverflowError, MemoryError) as error:
            raise ValueError(f"octets of a value: an array of shape {shape}: {error}") from None
        if not codec.checked_items(made):
            raise ValueError(f"octets of a value: an array of {dtype} that holds none")
        return made

    def scalar(self) -> Any:
        """A numpy scalar."""
        return self.array(scalar=True)[()]

    def table(self) -> Table:
        """A table that owns its columns."""
        (length,) = LONG.unpack(self.take(8))
        return codec.decode(self.take(length), copy=True)


_TAKE: dict[bytes, Callable[[ValueReader], Any]] = {
    b"N": lambda _: None,
    b"T": lambda _: True,
    b"F": lambda _: False,
    b"i": lambda reader: struct.unpack("<q", reader.take(8))[0],
    b"I": lambda reader: int.from_bytes(reader.sized(), "little", signed=True),
    b"f": lambda reader: struct.unpack("<d", reader.take(8))[0],
    b"s": lambda reader: reader.sized().decode("utf-8", "surrogatepass"),
    b"b": ValueReader.sized,
    b"l": ValueReader.members,
    b"t": lambda reader: tuple(reader.members()),
    b"S": lambda reader: reader.hashed(set),
    b"Z": lambda reader: reader.hashed(frozenset),
    b"q": ValueReader.deque,
    b"d": lambda reader: reader.hashed(dict),
    b"c": lambda reader: reader.hashed(lambda pairs: Counter(dict(pairs))),
    b"e": ValueReader.member,
    b"D": ValueReader.instance,
    b"a": ValueReader.array,
    b"n": ValueReader.scalar,
    b"B": ValueReader.table,
}
