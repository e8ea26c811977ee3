"""Node events as JSON, the same for REST and MQTT.

One object or an array of objects: `time` (Unix seconds or ISO 8601 with zone), `node` (its id in the settings), `kind`
(`passage`, `arrived`, `left`), `speed_mps`, `length_m`, `strength`, `simulated`. All but `time` and `node` may be
absent; `speed_mps` and `length_m` may be null. Other members are ignored.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from app.ingest.wire_json import BadMessage, Parsed, columns_of, number, parse_rows, unix_time
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, NodeEvents


class NodeEventRow(msgspec.Struct):
    """One event on the wire; what is not known is left out or null."""

    time: Annotated[float | int | str, Meta(description="Unix seconds, or ISO 8601 with zone")]
    node: Annotated[str | None, Meta(description="id of the node in the settings")] = None
    kind: Literal["passage", "arrived", "left"] = "passage"
    speed_mps: Annotated[float | int | None, Meta(description="of what passed")] = None
    length_m: Annotated[float | int | None, Meta(description="of what passed")] = None
    strength: Annotated[float | int, Meta(description="of the disturbance of the field, in the node's own unit")] = 1.0
    simulated: bool = False


def parse_node_events(
    body: bytes, nodes: Sequence[NodeSite], limit: int = 1000, *, node: str | None = None
) -> Parsed[NodeEvents]:
    """The events in a JSON body, in its order.

    node: the id that is known from elsewhere (the MQTT topic), so that the event need not name it.
    Raises BadMessage (a Refused) that says what is wrong, when nothing of it can be taken.
    """
    known = {one.id: index for index, one in enumerate(nodes)}

    def columns(row: NodeEventRow, where: str) -> dict[str, Any]:
        return {
            "node": known[_node(row.node, node, known, where)],
            "time": unix_time(row.time, where),
            "kind": NodeEventKind[row.kind.upper()],
            "speed": number(row.speed_mps, "speed_mps", where, 0.0, 200.0),
            "length": number(row.length_m, "length_m", where, 0.0, 200.0),
            "strength": number(row.strength, "strength", where, 0.0, 1e6),
            "simulated": row.simulated,
        }

    parsed = parse_rows(body, NodeEventRow, limit, "event", columns)
    return parsed.holding(NodeEvents.build(len(parsed.rows), **columns_of(parsed.rows)))


def _node(named: str | None, expected: str | None, known: Container[str], where: str) -> str:
    """The id of the node that an event is of. Raises BadMessage."""
    name = named if named is not None else expected
    if name is None:
        raise BadMessage("bad_value", f"{where}: node is missing")
    if expected is not None and name != expected:
        raise BadMessage("wrong_node", f"{where}: node {name[:40]!r} came in as {expected[:40]!r}")
    if name not in known:
        raise BadMessage("unknown_node", f"{where}: no node is called {name[:40]!r}")
    return name
