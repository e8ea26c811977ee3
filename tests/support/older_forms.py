"""Records as earlier versions of the program wrote them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipeline.engine import EngineState
from pipeline.inputs import Envelope
from pipeline.tables import Plots, SectorPlots, Table
from pipeline.tables.codec import encode
from pipeline.values import ValueCodec


@dataclass(frozen=True, slots=True, eq=False)
class _SectorPlots:
    """The fields of SectorPlots before it had azimuth marks."""

    radar: int
    scan: int
    time: float
    closed_from: int
    closed_to: int
    plots: Plots
    degraded: bool = False


_SectorPlots.__qualname__ = "SectorPlots"
_CODEC = ValueCodec((Envelope, _SectorPlots))


@dataclass(frozen=True, slots=True, eq=False)
class _SectorPlotsOf32Marks(_SectorPlots):
    """The fields of SectorPlots while a turn had 32 azimuth marks, which nothing stated."""

    mark: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: np.empty(0, np.int64))
    mark_time: np.ndarray[Any, np.dtype[np.float64]] = field(default_factory=lambda: np.empty(0, np.float64))


_SectorPlotsOf32Marks.__qualname__ = "SectorPlots"
_CODEC_OF_32_MARKS = ValueCodec((Envelope, _SectorPlotsOf32Marks))


@dataclass(slots=True, eq=False)
class _RadarClock:
    """A radar's clock with fields that it does not have any more."""

    row: int = 0
    turn_s: float = 1.0


_RadarClock.__qualname__ = "RadarClock"
_CLOCKS = ValueCodec((EngineState, _RadarClock))


def without_marks(envelope: Envelope) -> bytes:
    """The octets of an envelope with a sector as they were before sectors had azimuth marks."""
    s = envelope.body
    assert isinstance(s, SectorPlots)
    body: Any = _SectorPlots(s.radar, s.scan, s.time, s.closed_from, s.closed_to, s.plots, s.degraded)
    return _CODEC.encode(replace(envelope, body=body))


def with_32_marks(envelope: Envelope) -> bytes:
    """The octets of an envelope with a sector while a turn had 32 azimuth marks, every second of them one of today."""
    s = envelope.body
    assert isinstance(s, SectorPlots)
    mark, time = np.repeat(2 * s.mark, 2), np.repeat(s.mark_time, 2)
    mark[1::2] += 1
    body: Any = _SectorPlotsOf32Marks(
        s.radar, s.scan, s.time, s.closed_from, s.closed_to, s.plots, s.degraded, mark, time
    )
    return _CODEC_OF_32_MARKS.encode(replace(envelope, body=body))


def older_table(table: Table, without: Collection[str] = (), dtypes: Mapping[str, str] | None = None) -> bytes:
    """The octets of a table as they were before it had the columns `without`, and while others had these dtypes."""
    columns = {
        name: getattr(table, name).astype((dtypes or {}).get(name, one.dtype))
        for name, one in type(table).columns().items()
        if name not in without
    }
    label = type(table).__name__.encode()
    declared = ";".join(f"{name} {one.dtype.str} {list(one.shape[1:])}" for name, one in columns.items())
    head = struct.pack("<4sHHIIQ", b"ATBL", 1, len(label), zlib.crc32(declared.encode()), len(columns), len(table))
    parts = (label, *(one.tobytes() for one in columns.values()))
    return head + b"".join(one + bytes(-len(one) % 8) for one in parts)


def with_older_table(value: bytes, table: Table, older: bytes) -> bytes:
    """The octets of a value that holds this table, with its octets as they were before (see `older_table`)."""
    here = encode(table)
    assert value.count(here) == 1
    return value.replace(struct.pack("<Q", len(here)) + here, struct.pack("<Q", len(older)) + older)


def older_state(saved: dict[str, Any]) -> dict[str, Any]:
    """A state of the engine as it was before the tracker had a store: classes as they are, names as they were."""
    tracker = {name: one for name, one in saved["tracker"].items() if name != "store"}
    return {**saved, "tracker": {"table": {"state": np.zeros((0, 4))}, **tracker}}


def older_clocks() -> bytes:
    """The octets of a state of the engine whose class of the radar's clock had other fields."""
    tracker = {"table": {"state": np.zeros((0, 4))}, "clocks": [_RadarClock()]}
    return _CLOCKS.encode({"engine": EngineState(), "tracker": tracker, "monitor": None})
