"""Tables of arbitrary octets, for tests of byte forms."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from pipeline.tables import NodeEvents, Plots, Table, TargetReports, Tracks

KINDS: tuple[type[Table], ...] = (Plots, Tracks, NodeEvents, TargetReports)


def table_of(kind: type[Table], rows: int, seed: int) -> Table:
    """Random bits in every column (also NaNs with payloads, infinities, -0.0), any text and both booleans."""
    draw = np.random.default_rng(seed)
    made: dict[str, Any] = {}
    for name, one in kind.columns().items():
        dtype = np.dtype(one.dtype)
        shape = (rows, *one.shape)
        if dtype.kind == "b":
            made[name] = draw.random(shape) < 0.5
        elif dtype.kind == "U":
            units = draw.integers(1, 0xD000, (*shape, dtype.itemsize // 4), dtype=np.uint32)
            made[name] = units.view(dtype).reshape(shape)
        else:
            octets = draw.integers(0, 256, (*shape, dtype.itemsize), dtype=np.uint8)
            made[name] = octets.view(dtype).reshape(shape)
    return kind(**made)


tables = st.builds(table_of, st.sampled_from(KINDS), st.integers(0, 12), st.integers(0, 2**32 - 1))


def same_bits(one: Table, other: Table) -> bool:
    return type(one) is type(other) and all(
        getattr(one, name).dtype == getattr(other, name).dtype
        and getattr(one, name).shape == getattr(other, name).shape
        and getattr(one, name).tobytes() == getattr(other, name).tobytes()
        for name in type(one).columns()
    )
