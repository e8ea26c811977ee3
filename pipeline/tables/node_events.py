"""Node events: what the geomagnetic nodes in the pavement felt."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from pipeline.tables.schema import Array, Table, column


class NodeEventKind(IntEnum):
    """What a node reported: something passed, something arrived over it, something left it."""

    PASSAGE = 0
    ARRIVED = 1
    LEFT = 2


@dataclass(frozen=True, eq=False)
class NodeEvents(Table):
    """One row an event."""

    time: Array = column("f8", "s", "UTC of the event")
    node: Array = column("i4", "", "index of the node in the engine")
    kind: Array = column("u1", "", "NodeEventKind", default=0)
    speed: Array = column("f4", "m/s", "speed over the node; nan when not measured", default=float("nan"))
    length: Array = column("f4", "m", "magnetic length of what passed; nan when not measured", default=float("nan"))
    strength: Array = column("f4", "", "signal strength relative to the node's threshold", default=1.0)
    simulated: Array = column("?", "", "made by a simulator", default=False)
    arrival: Array = column("f8", "s", "UTC when it arrived at this host; nan when unknown", default=float("nan"))
