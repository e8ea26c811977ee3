"""What each counter of a sensor counts, so that no metric adds up things of different kinds."""

from __future__ import annotations

from collections.abc import Mapping

OCCURRENCES = "occurrences"
"""The unit of what merely happens: a restart, a failure, a step of a clock."""

_PLAIN = (
    "datagrams", "messages", "sweeps", "blocks", "sectors", "cells", "plots", "runs", "rows", "bearings", "reports",
    "events", "tracks", "alerts", "pictures", "states", "records", "files", "snapshots", "points", "transactions",
)  # fmt: skip

WORDS = {
    **{name: unit for unit in _PLAIN for name in (unit, unit.removesuffix("s"))},
    "bytes": "bytes",
    "octets": "bytes",
    "node": "events",
    "fragments": "tracks",
    "hypotheses": "hypotheses",
}
"""The unit of a counter whose name has this word; the first word that stands here counts."""

_MESSAGES = (
    "taken", "lost", "duplicate", "reordered", "late", "azimuth_backwards", "wrong_azimuth", "wrong_cell_count",
    "wrong_geometry", "time_backwards", "time_jump", "no_time", "wrong_source", "out_of_sequence", "merged", "summary",
)  # fmt: skip
_DATAGRAMS = ("malformed", "wrong_category", "compressed", "truncated", "trailing", "socket_overflow", "refused_source")
_TRACKS = ("confirmed", "ended", "merged", "identified", "identity_stale", "identity_moved", "no_room", "no_number")

UNITS: Mapping[str, Mapping[str, str]] = {
    "radar": {
        **dict.fromkeys(_MESSAGES, "messages"),
        **dict.fromkeys(_DATAGRAMS, "datagrams"),
        "incomplete": "sweeps",
        "deliver_failed": "blocks",
    },
    "tracker": {
        **dict.fromkeys(_TRACKS, "tracks"),
        "absorbed": "plots",
        "absorbed_tracks": "tracks",
        "state_invalid": "tracks",
        "view3d_merged": "pictures",
        "view3d_shown": "pictures",
        "view3d_failed": "pictures",
        "view3d_without_place": "targets",
        "view3d_viewer_failed": OCCURRENCES,
        "refused": "rows",
    },
    "store": {
        "dropped": "records",
        "refused": "transactions",
        "retries": "transactions",
        "failed": "pictures",
        "alert_changes": "rows",
        **dict.fromkeys(("points", "tracks", "node_events", "sensor_states"), "rows"),
        **dict.fromkeys(("points_dropped", "node_events_dropped", "sensor_states_dropped"), "rows"),
    },
}
"""By kind of sensor, the units that the names do not tell."""

FEEDS = {"node": "events", "report": "reports"}
"""What the feeds count, but for the steps of their clocks."""

MQTT_OCCURRENCES = (
    "mqtt_connects", "mqtt_connect_failures", "mqtt_disconnects", "mqtt_ended", "mqtt_sessions_lost",
    "mqtt_subscriptions_refused",
)  # fmt: skip


def unit_of(kind: str, name: str) -> str:
    """The unit, in the plural, of the counter `name` of a sensor of this kind."""
    told = UNITS.get(kind, {}).get(name)
    if told is not None:
        return told
    if kind in FEEDS:
        return FEEDS[kind] if name == "taken" or name.startswith("refused_") else OCCURRENCES
    found = next((WORDS[word] for word in name.split("_") if word in WORDS), None)
    if found is None and name.startswith("mqtt_") and name not in MQTT_OCCURRENCES:
        return "events"
    return found or OCCURRENCES
