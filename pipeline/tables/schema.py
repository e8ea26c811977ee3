"""How a table is declared: one line a column, with dtype, row shape, unit, meaning and default.

Checks, wire schema and documentation are made from this declaration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""A numpy column; its dtype is checked against the declaration when the table is made."""


class TableError(ValueError):
    """A table was given a column of the wrong dtype, row shape or length."""


@dataclass(frozen=True, slots=True)
class Column:
    """The declaration of one column.

    dtype: numpy dtype string. shape: shape of one row, () for a scalar. unit: SI unit or "" where there is none.
    meaning: one sentence. default: the value a row has when nobody gave one (None: must be given).
    """

    dtype: str
    unit: str
    meaning: str
    shape: tuple[int, ...] = ()
    default: Any = None


def column(dtype: str, unit: str, meaning: str, shape: tuple[int, ...] = (), default: Any = None) -> Any:
    """Declare a column of a Table subclass; see Column for the words."""
    return field(metadata={"column": Column(np.dtype(dtype).str, unit, meaning, shape, default)})


_declarations: dict[type[Any], dict[str, Column]] = {}


def _declared(kind: type[Table]) -> dict[str, Column]:
    known = _declarations.get(kind)
    if known is None:
        known = {f.name: f.metadata["column"] for f in fields(kind) if "column" in f.metadata}
        _declarations[kind] = known
    return known


_wants: dict[type[Any], list[tuple[str, np.dtype[Any], tuple[int, ...]]]] = {}


def _wanted(kind: type[Table]) -> list[tuple[str, np.dtype[Any], tuple[int, ...]]]:
    """Name, dtype and shape of a row of each column."""
    known = _wants.get(kind)
    if known is None:
        known = [(name, np.dtype(one.dtype), one.shape) for name, one in _declared(kind).items()]
        _wants[kind] = known
    return known


@dataclass(frozen=True, eq=False)
class Table:
    """Equal-length numpy columns; sliced by mask, index array or slice, which keeps the kind of table."""

    def __post_init__(self) -> None:
        length = None
        for name, dtype, shape in _wanted(type(self)):
            values = getattr(self, name)
            if not isinstance(values, np.ndarray) or values.dtype != dtype:
                found = values.dtype.str if isinstance(values, np.ndarray) else type(values).__name__
                raise TableError(f"{type(self).__name__}.{name}: dtype {dtype.str} wanted, {found} found")
            if values.shape[1:] != shape or values.ndim == 0:
                raise TableError(f"{type(self).__name__}.{name}: rows of shape {shape} wanted")
            if length is not None and length != len(values):
                lengths = {one: len(getattr(self, one)) for one in _declared(type(self))}
                raise TableError(f"{type(self).__name__}: columns of different lengths {lengths}")
            length = len(values)

    @classmethod
    def columns(cls) -> dict[str, Column]:
        """The declarations of all columns, in order."""
        return dict(_declared(cls))

    @classmethod
    def build(cls, rows: int, **given: Any) -> Self:
        """Make a table of `rows` rows: given columns are converted to their dtype, the others take their default.

        Raises TableError when a column without a default is missing, when a name is unknown, or when a shape is wrong.
        """
        declared = _declared(cls)
        unknown = set(given) - set(declared)
        if unknown:
            raise TableError(f"{cls.__name__} has no column {', '.join(sorted(unknown))}")
        made: dict[str, Array] = {}
        for name, one in declared.items():
            if name in given:
                made[name] = np.ascontiguousarray(
                    np.broadcast_to(np.asarray(given[name], dtype=one.dtype), (rows, *one.shape))
                )
            elif one.default is None and rows:
                raise TableError(f"{cls.__name__}.{name} has no default and was not given")
            else:
                made[name] = np.full((rows, *one.shape), one.default if rows else 0, dtype=one.dtype)
        return cls(**made)

    @classmethod
    def empty(cls) -> Self:
        """A table without rows."""
        return cls.build(0)

    @classmethod
    def concatenate(cls, tables: Sequence[Self]) -> Self:
        """All rows of the tables, in order."""
        if not tables:
            return cls.empty()
        if len(tables) == 1:
            return tables[0]
        return cls._of_good({name: np.concatenate([getattr(t, name) for t in tables]) for name in _declared(cls)})

    def replace(self, **columns: Any) -> Self:
        """The same table with some columns exchanged (converted to their dtype)."""
        declared = _declared(type(self))
        unknown = set(columns) - set(declared)
        if unknown:
            raise TableError(f"{type(self).__name__} has no column {', '.join(sorted(unknown))}")
        rows = len(self)
        everything = {name: getattr(self, name) for name in declared}
        for name, values in columns.items():
            one = declared[name]
            everything[name] = np.ascontiguousarray(
                np.broadcast_to(np.asarray(values, dtype=one.dtype), (rows, *one.shape))
            )
        return type(self)._of_good(everything)

    @classmethod
    def _of_good(cls, columns: dict[str, Array]) -> Self:
        """A table of columns that come from tables of this kind, all cut alike, so that they need no check."""
        made = object.__new__(cls)
        made.__dict__.update(columns)
        return made

    def __len__(self) -> int:
        name = next(iter(_declared(type(self))))
        return len(getattr(self, name))

    def __getitem__(self, rows: Any) -> Self:
        if isinstance(rows, int | np.integer):
            rows = slice(int(rows), int(rows) + 1 if rows != -1 else None)
        return self._of_good({name: getattr(self, name)[rows] for name in _declared(type(self))})
