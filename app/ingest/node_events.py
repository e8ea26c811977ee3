"""Node events as JSON, the same for REST and MQTT.

One object or an array of objects: `time` (Unix seconds or ISO 8601 with zone), `node` (its id in the settings), `kind`
(`passage`, `arrived`, `left`), `speed_mps`, `length_m`, `strength`, `simulated`. All but `time` and `node` may be
absent; `speed_mps` and `length_m` may be null.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec

from app.ingest.wire_json import BadMessage, decode_rows, number, unix_time
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, NodeEvents


class NodeEventRow(msgspec.Struct, forbid_unknown_fields=True):
    """One event on the wire."""

    time: float | int | str
    node: str | None = None
    kind: Literal["passage", "arrived", "left"] = "passage"
    speed_mps: float | int | None = None
    length_m: float | int | None = None
    strength: float | int = 1.0
    simulated: bool = False


def parse_node_events(
    body: bytes, nodes: Sequence[NodeSite], limit: int = 1000, *, node: str | None = None
) -> NodeEvents:
    """The events in a JSON body, in its order.

    node: the id that is known from elsewhere (the MQTT topic), so that the event need not name it.
    Raises BadMessage (a Refused) that says which entry is wrong and why; nothing is taken then.
    """
    rows = decode_rows(body, NodeEventRow, limit)
    known = {one.id: index for index, one in enumerate(nodes)}
    time, index, speed, length, strength = [], [], [], [], []
    for i, row in enumerate(rows):
        where = f"event {i}"
        name = row.node if row.node is not None else node
        if node is not None and name != node:
            raise BadMessage("wrong_node", f"{where}: node {str(name)[:40]!r} came in as {node[:40]!r}")
        if name is None:
            raise BadMessage("bad_value", f"{where}: node is missing")
        if name not in known:
            raise BadMessage("unknown_node", f"{where}: no node is called {name[:40]!r}")
        index.append(known[name])
        time.append(unix_time(row.time, where))
        speed.append(number(row.speed_mps, "speed_mps", where, 0.0, 200.0))
        length.append(number(row.length_m, "length_m", where, 0.0, 200.0))
        strength.append(number(row.strength, "strength", where, 0.0, 1e6))
    return NodeEvents.build(
        len(rows),
        time=time,
        node=index,
        kind=[NodeEventKind[row.kind.upper()] for row in rows],
        speed=speed,
        length=length,
        strength=strength,
        simulated=[row.simulated for row in rows],
    )
