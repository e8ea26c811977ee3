"""Where two values differ, to the bit: a NaN equals the same NaN, and -0.0 is not 0.0."""

from __future__ import annotations

import dataclasses
import struct
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.tables.schema import Table

RECORDED, REPLAYED = "recorded", "replayed"
"""What a message calls the first and the second value."""

LONGEST = 200
"""Characters of a value that a message shows."""


def first_difference(a: Any, b: Any, path: str = "") -> str | None:
    """The first place where `b` (replayed) is not bit for bit what `a` (recorded) is; None when they are the same.

    The text names the path, for tables column and row, and both values: "tracks.state[12, 0]: 103.25 recorded, 103.26
    replayed". Walks dataclasses, named tuples, mappings, sequences, sets, arrays and tables; others are compared by ==.
    """
    if type(a) is not type(b):
        return _told(path, f"{_shown(a)} ({type(a).__name__})", f"{_shown(b)} ({type(b).__name__})")
    if isinstance(a, float | np.generic):
        return _scalar(a, b, path)
    if isinstance(a, str | bytes | int | type(None)):
        return None if a == b else _told(path, _shown(a), _shown(b))
    if isinstance(a, Table):
        return _table(a, b, path)
    if isinstance(a, np.ndarray):
        return _array(a, b, path)
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return _fields(a, b, names, path)
    if isinstance(a, tuple) and hasattr(a, "_fields"):
        return _fields(a, b, list(a._fields), path)
    if isinstance(a, Mapping):
        return _mapping(a, b, path)
    if isinstance(a, set | frozenset):
        return _set(a, b, path)
    if isinstance(a, list | tuple | deque):
        return _sequence(a, b, path)
    return None if a == b else _told(path, _shown(a), _shown(b))


def _told(path: str, recorded: str, replayed: str) -> str:
    return f"{path or 'value'}: {recorded} {RECORDED}, {replayed} {REPLAYED}"


def _shown(value: Any) -> str:
    text = str(value) if isinstance(value, np.generic) and not isinstance(value, np.str_ | np.bytes_) else repr(value)
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."


def _octets(value: Any) -> bytes:
    return struct.pack("<d", value) if type(value) is float else np.asarray(value).tobytes()


def _scalar(a: Any, b: Any, path: str) -> str | None:
    if np.asarray(a).dtype == np.asarray(b).dtype and _octets(a) == _octets(b):
        return None
    one, other = _shown(a), _shown(b)
    if one == other:
        one, other = f"{one} (bits {_octets(a)[::-1].hex()})", f"{other} (bits {_octets(b)[::-1].hex()})"
    return _told(path, one, other)


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _fields(a: Any, b: Any, names: list[str], path: str) -> str | None:
    for name in names:
        found = first_difference(getattr(a, name, None), getattr(b, name, None), _joined(path, name))
        if found:
            return found
    return None


def _table(a: Table, b: Table, path: str) -> str | None:
    if len(a) != len(b):
        return _told(path or type(a).__name__, f"{len(a)} rows", f"{len(b)} rows")
    for name in type(a).columns():
        found = _array(getattr(a, name), getattr(b, name), _joined(path, name))
        if found:
            return found
    return None


def _array(a: NDArray[Any], b: NDArray[Any], path: str) -> str | None:
    if a.dtype != b.dtype or a.shape != b.shape:
        return _told(path, f"{a.dtype.str} of shape {a.shape}", f"{b.dtype.str} of shape {b.shape}")
    one, other = a.tobytes(), b.tobytes()
    if one == other:
        return None
    if a.dtype.hasobject:
        return _told(path, _shown(a), _shown(b))
    width = a.dtype.itemsize
    differs = (np.frombuffer(one, np.uint8) != np.frombuffer(other, np.uint8)).reshape(-1, width).any(axis=1)
    at = int(differs.argmax())
    index = tuple(int(i) for i in np.unravel_index(at, a.shape))
    place = f"{path or 'value'}[{', '.join(str(i) for i in index)}]"
    return _scalar(a[index], b[index], place)


def _mapping(a: Mapping[Any, Any], b: Mapping[Any, Any], path: str) -> str | None:
    for key, value in a.items():
        if key not in b:
            return _told(f"{path}[{key!r}]", _shown(value), "nothing")
        found = first_difference(value, b[key], f"{path}[{key!r}]")
        if found:
            return found
    for key, value in b.items():
        if key not in a:
            return _told(f"{path}[{key!r}]", "nothing", _shown(value))
    if [repr(key) for key in a] != [repr(key) for key in b]:
        return _told(path, f"keys in the order {_shown(list(a))}", f"keys in the order {_shown(list(b))}")
    return None


def _set(a: Any, b: Any, path: str) -> str | None:
    recorded, replayed = {repr(one) for one in a}, {repr(one) for one in b}  # 0.0, -0.0 and False are equal as members
    if recorded == replayed:
        return None
    only_a, only_b = (", ".join(sorted(one)) or "none" for one in (recorded - replayed, replayed - recorded))
    return _told(path, f"only the members {only_a[:LONGEST]}", f"only the members {only_b[:LONGEST]}")


def _sequence(a: Sequence[Any], b: Sequence[Any], path: str) -> str | None:
    for index, (one, other) in enumerate(zip(a, b, strict=False)):
        found = first_difference(one, other, f"{path or 'value'}[{index}]")
        if found:
            return found
    if len(a) != len(b):
        return _told(path, f"{len(a)} members", f"{len(b)} members")
    if isinstance(a, deque) and isinstance(b, deque) and a.maxlen != b.maxlen:
        return _told(path, f"maximum length {a.maxlen}", f"maximum length {b.maxlen}")
    return None
