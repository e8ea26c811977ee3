"""Rows of record arrays: numpy copies records field by field, which is many times slower than as octets."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array


def octets_of(records: Array) -> Array:
    """A view (n, size) uint8 of records (n, ...), each row with all that it holds. They must be contiguous."""
    return records.view(np.uint8).reshape(len(records), records.dtype.itemsize * math.prod(records.shape[1:]))


def plain(column: Array) -> Array:
    """The column itself where it is contiguous and may be written to, otherwise a copy that is.

    A kernel is compiled anew for each mixture of read-only and strided arrays; tables from outside have any.
    """
    return column if column.flags.carray else column.copy()


def take(records: Array, rows: Array) -> Array:
    """Copies of the records (n,) of an index array or a mask, (k,)."""
    if rows.dtype == np.bool_:
        rows = np.flatnonzero(rows)
    made = np.empty(len(rows), records.dtype)
    take_records(records, rows, made)
    return made


@allocating
def take_records(records: Array, rows: Array, out: Array) -> None:
    """Copy the records of rows (k,) to the first k of `out`."""
    for k in range(len(rows)):
        out[k] = records[rows[k]]
