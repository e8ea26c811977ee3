"""Hands everything that enters the engine, and everything that comes out of it, to the journal in its order."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from app.journal.masked import masked
from app.journal.names import AIRPORT_FILE, CLOCK_FILE, SETTINGS_FILE, VERSIONS_FILE
from app.journal.writer import JournalWriter
from app.runtime.clock_quality import clock_quality
from app.settings import JournalSettings, Settings
from pipeline.engine import Outcome
from pipeline.engine_records import CODEC, INPUT, OUTPUT, SENSORS, SNAPSHOT, shown
from pipeline.inputs import Envelope
from pipeline.picture import SensorState

SENSORS_EVERY_S = 1.0
"""The health of the sensors is recorded this often, and whenever a status changes."""


class JournalRecorder:
    """The journal of a running service, as its surface thread sees it. None of its methods waits or raises."""

    def __init__(self, settings: Settings, airport_geojson: dict[str, Any], journal: JournalSettings) -> None:
        if journal.folder is None:
            raise ValueError("a journal needs a folder")
        self.writer = JournalWriter(journal.folder, attachments(settings, airport_geojson), journal)
        self._arrival = 0.0
        self._sensors_at = 0.0
        self._statuses: tuple[tuple[str, str], ...] = ()

    def before(self, envelope: Envelope, save: Callable[[], Any]) -> None:
        """`envelope` is about to enter the engine. save: gives the engine's state before it."""
        self._arrival = envelope.arrival
        if self.writer.wants_snapshot:
            self.writer.put(SNAPSHOT, envelope.arrival, partial(CODEC.encode, save()))
        self.writer.put(INPUT, envelope.arrival, partial(CODEC.encode, envelope))

    def after(self, outcome: Outcome) -> None:
        """What came of the last envelope."""
        made = shown(outcome)
        if made is not None:
            self.writer.put(OUTPUT, self._arrival, partial(CODEC.encode, made))

    def sensors(self, states: tuple[SensorState, ...]) -> None:
        """The health of all sensors, as the displays see it with the newest picture."""
        statuses = tuple((one.id, one.status) for one in states)
        if statuses != self._statuses or self._arrival - self._sensors_at >= SENSORS_EVERY_S:
            self._statuses, self._sensors_at = statuses, self._arrival
            self.writer.put(SENSORS, self._arrival, partial(CODEC.encode, states))

    def state(self) -> SensorState:
        """The journal in the form of a sensor's state."""
        now = self.writer.state()
        c = now.counters
        counters = {
            "records": c.records, "bytes": c.octets, "files": c.files, "snapshots": c.snapshots, "dropped": c.dropped,
            "files_removed": c.removed,
        }  # fmt: skip
        status = "silent" if now.status == "stopped" else now.status
        return SensorState("journal", "store", status, self._arrival or None, detail=now.detail, counters=counters)

    def close(self) -> bool:
        """Write what waits and finish the file."""
        return self.writer.close()


def attachments(settings: Settings, airport_geojson: dict[str, Any]) -> dict[str, bytes]:
    """What a replay needs besides the records, by name. Secrets in the settings are masked."""
    made = {
        SETTINGS_FILE: masked(settings),
        AIRPORT_FILE: airport_geojson,
        VERSIONS_FILE: versions(),
        CLOCK_FILE: clock_quality(),
    }
    return {name: json.dumps(one, indent=1, sort_keys=True).encode() for name, one in made.items()}


def versions() -> dict[str, str]:
    """What a replay must have the same of to give the same bits."""
    made = {"python": platform.python_version(), "machine": platform.machine()}
    for package in ("airside", "numpy", "numba", "scipy", "shapely"):
        try:
            made[package] = version(package)
        except PackageNotFoundError:
            made[package] = "unknown"
    return made
