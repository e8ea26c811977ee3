"""Records as earlier versions of the program wrote them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from pipeline.inputs import Envelope
from pipeline.tables import Plots, SectorPlots
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


def without_marks(envelope: Envelope) -> bytes:
    """The octets of an envelope with a sector as they were before sectors had azimuth marks."""
    s = envelope.body
    assert isinstance(s, SectorPlots)
    body: Any = _SectorPlots(s.radar, s.scan, s.time, s.closed_from, s.closed_to, s.plots, s.degraded)
    return _CODEC.encode(replace(envelope, body=body))
