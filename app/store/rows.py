"""From the values of the core to the rows of the tables."""

from __future__ import annotations

import json
from typing import Any

from app.wire import Wire, encode
from pipeline.picture import AlertChange, SensorState
from pipeline.tables import NodeEventKind, NodeEvents, Tracks

Row = dict[str, Any]
POINT = ("time", "lat", "lon", "altitude_m", "speed_mps", "course_deg", "heading_deg", "accuracy_m", "on_ground")


def point_rows(wire: Wire, tracks: Tracks) -> list[Row]:
    """Rows of track_points, still without their uid."""
    columns = wire.columns(tracks)
    wanted = {name: columns[name] for name in POINT}
    wanted["zone"] = [None if one is None else one[:64] for one in columns["zone"]]
    wanted["runway"] = [None if one is None else one[:16] for one in columns["runway"]]
    wanted["phase"] = tracks.phase.tolist()
    wanted["sources"] = tracks.sources.tolist()
    return [dict(zip(wanted, row, strict=True)) for row in zip(*wanted.values(), strict=True)]


def alert_row(wire: Wire, change: AlertChange) -> Row:
    """A row of alerts: the alert as it stands after a change."""
    alert = change.alert
    return {
        "airport": wire.airport.icao[:16],
        "id": alert.id,
        "mode": wire.mode,
        "rule": alert.rule[:64],
        "stage": alert.stage,
        "state": alert.state,
        "runway": None if alert.runway is None else alert.runway[:16],
        "raised_at": alert.raised_at,
        "updated_at": alert.updated_at,
        "cleared_at": alert.cleared_at,
        "simulated": alert.simulated,
        "document": encode(wire.alert(alert)).decode(),
        "worst_stage": alert.worst_stage,
        "acknowledged_by": None if alert.acknowledged_by is None else alert.acknowledged_by[:64],
    }


def change_row(row: Row, change: AlertChange) -> Row:
    """A row of alert_changes; `row` is the alert's."""
    return {
        "airport": row["airport"],
        "alert_id": row["id"],
        "time": change.time,
        "operation": change.operation,
        "stage": row["stage"],
        "state": row["state"],
        "document": row["document"],
    }


def node_event_rows(airport: str, events: NodeEvents, names: tuple[str, ...]) -> list[Row]:
    """Rows of node_events. names: of the nodes, by index."""
    made = []
    for i in range(len(events)):
        node = int(events.node[i])
        made.append(
            {
                "airport": airport,
                "time": float(events.time[i]),
                "node": names[node] if 0 <= node < len(names) else str(node),
                "kind": NodeEventKind(int(events.kind[i])).name.lower(),
                "speed_mps": _number(events.speed[i]),
                "length_m": _number(events.length[i]),
                "strength": _number(events.strength[i]),
                "simulated": bool(events.simulated[i]),
            }
        )
    return made


def sensor_row(airport: str, time: float, sensor: SensorState) -> Row:
    """A row of sensor_states."""
    return {
        "airport": airport,
        "time": time,
        "sensor": sensor.id[:64],
        "kind": sensor.kind[:16],
        "status": sensor.status[:16],
        "detail": sensor.detail,
        "counters": json.dumps(sensor.counters),
    }


def _number(value: Any) -> float | None:
    number = float(value)
    return number if number - number == 0.0 else None
