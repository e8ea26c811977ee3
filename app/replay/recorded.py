"""What a journal says of the run it recorded: settings, map, versions; and the engine made of them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_settings import PydanticBaseSettingsSource

from app.assembly import FRONT_END, check_parts, node_site, radar_site, surface_engine
from app.journal.names import AIRPORT_FILE, SETTINGS_FILE, VERSIONS_FILE, JournalError
from app.journal.reader import Journal
from app.settings import Settings, SettingsError
from pipeline.airport.geojson import AirportFault, airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.engine import SurfaceEngine
from pipeline.engine_records import SWEEPS

ENGINE_PARTS = ("associate", "filter", "lifecycle", "classify", "alert")
"""The verbs whose parts work on what a journal always holds."""

VIDEO_PARTS = tuple(FRONT_END)
"""The verbs whose parts work on the raw sweeps."""


class RecordedSettings(Settings):
    """Settings as they were recorded: what the environment says now does not matter."""

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[Any],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Only what was recorded."""
        return (init_settings,)


@dataclass(frozen=True)
class RecordedRun:
    """One run of a service as its journal describes it. document: its settings, as JSON values."""

    document: dict[str, Any]
    settings: Settings
    airport: Airport
    geojson: dict[str, Any]
    versions: dict[str, str]

    def engine(self) -> SurfaceEngine:
        """An engine like the one that was recorded, before its first input. Raises SettingsError."""
        radars = tuple(radar_site(one, self.airport) for one in self.settings.radars)
        nodes = tuple(node_site(one, self.airport) for one in self.settings.nodes)
        return surface_engine(self.settings, self.airport, radars, nodes)


def recorded_run(attached: Mapping[str, bytes], name: str) -> RecordedRun:
    """The run that these attachments describe. Raises JournalError, naming the journal, when they cannot be used."""
    try:
        document, geojson, versions = (
            json.loads(attached[one]) for one in (SETTINGS_FILE, AIRPORT_FILE, VERSIONS_FILE)
        )
        return RecordedRun(document, _settings(document), airport_from_geojson(geojson), geojson, versions)
    except KeyError as error:
        raise JournalError(f"{name}: the attachment {error} is missing, so that the engine cannot be made") from error
    except (ValueError, TypeError, RecursionError) as error:
        what = "the map" if isinstance(error, AirportFault) else "the settings"
        raise JournalError(f"{name}: {what} in it cannot be used: {error}") from error


def changed(run: RecordedRun, orders: Sequence[str], *, sweeps: bool) -> RecordedRun:
    """The run with other settings, each order "key=value" with the key as in the settings file.

    sweeps: the raw sweeps were recorded. Raises SettingsError for an order that is not well formed, that names no
    setting, or that cannot change anything because what it would work on was not recorded.
    """
    document = json.loads(json.dumps(run.document))
    for order in orders:
        key, equals, text = order.partition("=")
        if not equals or not key.strip():
            raise SettingsError(f"--set {order}: wants KEY=VALUE, as in parts.filter=kalman")
        path = key.strip().split(".")
        _must_matter(path, sweeps)
        _put(document, path, _value(text.strip()))
    try:
        settings = _settings(document)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(one) for one in first["loc"])
        raise SettingsError(f"--set {' '.join(orders)}: {place}: {first['msg']}") from error
    check_parts(settings)
    return replace(run, document=document, settings=settings)


def changing(journal: Journal, orders: Sequence[str]) -> Callable[[RecordedRun], RecordedRun]:
    """`changed` with these orders, for the runs of one journal."""
    sweeps = SWEEPS in journal.topics()
    return lambda run: changed(run, orders, sweeps=sweeps)


def own_verbs(orders: Sequence[str]) -> frozenset[str]:
    """The verbs of the radars' chains whose parts these orders change."""
    named = {one.partition("=")[0].strip().removeprefix("parts.").partition(".")[0] for one in orders}
    return frozenset(VIDEO_PARTS) & named


def _settings(document: dict[str, Any]) -> Settings:
    made = RecordedSettings(**document)
    return made.model_copy(update={"mode": "replay", "data_dir": Path(made.data_dir)})


def _must_matter(path: list[str], sweeps: bool) -> None:
    name = ".".join(path)
    if path[0] != "parts" or len(path) < 2 or path[1] not in (*ENGINE_PARTS, *VIDEO_PARTS):
        known = ", ".join(f"parts.{one}" for one in (*ENGINE_PARTS, *VIDEO_PARTS))
        raise SettingsError(
            f"--set {name}: a replay runs the engine on what was recorded; only these change it: {known}"
        )
    if path[1] in VIDEO_PARTS and not sweeps:
        raise SettingsError(
            f"--set {name}: works on the raw sweeps of the radar, and these were not recorded"
            " (record with journal.sweeps = true)"
        )


def _put(document: dict[str, Any], path: list[str], value: Any) -> None:
    """Set a value. A part that is named anew loses the settings of the part before."""
    verb, parts = path[1], document.setdefault("parts", {})
    if len(path) == 2:
        parts[verb] = value
        return
    part = parts.get(verb, {})
    part = {"name": part} if isinstance(part, str) else part
    if len(path) > 3 or not path[2] or not isinstance(part, dict):
        whole = f"parts.{verb}=[...] sets them as a whole" if isinstance(part, list | tuple) else "there is none such"
        raise SettingsError(f"--set {'.'.join(path)}: {whole}")
    anew = path[2] == "name" and value != part.get("name")
    parts[verb] = {"name": value} if anew else {**part, path[2]: value}


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
