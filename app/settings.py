"""The settings: one TOML file, with AIRSIDE_* environment variables on top; unknown keys are refused by name."""

from __future__ import annotations

import logging
import os
import re
import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, SecretStr, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, EnvSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict
from pydantic_settings import SettingsError as SourceError

from app.secret_urls import SecretUrl, check_url
from app.settings_environment import BETWEEN, PREFIX, strays
from app.settings_faults import explain
from app.settings_sources import ClockSettings, ClocksSettings, Section, UdpSettings
from pipeline.track.settings import LARGEST_CAPACITY

log = logging.getLogger(__name__)

ROOT = Path(__file__).resolve().parent.parent
"""The checkout or the image: where `static`, `migrations` and `app` lie."""

PLAIN_PATH = re.compile(r"(/[A-Za-z0-9._~-]+)+")
"""A path that is safe to put in front of a link: never "//host"."""

HOST_NAME = re.compile(r"\*|(\*\.)?[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*|[0-9A-Fa-f:]+")
"""A host as the allow-list takes it: a name, a name behind "*.", an address, or "*"."""

OWN_PATHS = frozenset({"api", "data", "chunks", "health", "metrics", "3d", "docs", "css", "js"})
"""First parts of the paths of the service: below one of these, a path with and without `root_path` look alike."""

LogFormat = Literal["auto", "text", "json"]
"""auto: for a person at a terminal, text elsewhere; text: one line an event; json: one JSON object a line."""


class SettingsError(ValueError):
    """The settings cannot be used; the message names the key and, where there is one, the nearest right name."""


class RadarSettings(Section):
    """One radar."""

    id: str = Field(pattern=r"^[A-Za-z0-9_.-]{1,32}$")
    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=180)
    height_m: float = 22.0
    north_offset_deg: float = 0.0
    azimuths: int = Field(4096, ge=16, le=65536)
    ranges: int = Field(1024, ge=16, le=16384)
    first_range_m: float = Field(0.0, ge=0)
    range_step_m: float = Field(3.0, gt=0)
    beamwidth_deg: float = Field(0.18, gt=0)
    period_s: float = Field(1.0, gt=0)
    db_per_step: float = Field(0.3125, gt=0)
    blocks_per_scan: int = Field(32, ge=1, le=4096, description="sweeps are worked on in this many blocks a turn")
    resample: bool = Field(False, description="bring cells of another length to range_step_m instead of refusing them")
    simulated: bool = False
    clock: ClockSettings = ClockSettings()
    udp: UdpSettings | None = UdpSettings()


class NodeSettings(Section):
    """One geomagnetic node in the pavement."""

    id: str = Field(pattern=r"^[A-Za-z0-9_.-]{1,32}$")
    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=180)
    heading_deg: float = 0.0
    hold: str | None = None
    runway: str | None = None
    accuracy_m: float = Field(2.0, gt=0)
    simulated: bool = False


class PartSettings(BaseModel):
    """Which method does a stage's work; every further key is a setting of that method."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: str

    def settings(self) -> dict[str, Any]:
        """The keys that belong to the method."""
        return dict(self.model_extra or {})


class PartsSettings(Section):
    """The methods, one a stage; `airside parts` lists them with their settings."""

    detect: PartSettings = PartSettings(name="adaptive")
    extract: PartSettings = PartSettings(name="hysteresis")
    bearing: PartSettings = PartSettings(name="moments")
    associate: PartSettings = PartSettings(name="gnn")
    filter: PartSettings = PartSettings(name="kalman")
    lifecycle: PartSettings = PartSettings(name="score")
    classify: PartSettings = PartSettings(name="extent_speed")
    alert: tuple[PartSettings, ...] = (
        PartSettings(name="runway_occupied"),
        PartSettings(name="hold_entry"),
        PartSettings(name="opposite_direction"),
        PartSettings(name="closed_runway"),
    )

    @field_validator("*", mode="before")
    @classmethod
    def _bare_names(cls, value: Any) -> Any:
        if isinstance(value, str):
            return {"name": value}
        if isinstance(value, list | tuple):
            return [{"name": one} if isinstance(one, str) else one for one in value]
        return value


class RunwaySettings(Section):
    """How a runway is used at start."""

    id: str
    open: bool = True
    in_use: str | None = None
    visibility: Literal["normal", "low"] = "normal"


class FeedSettings(Section):
    """The live feed."""

    max_clients: int = Field(500, ge=1)
    max_filters: int = Field(100, ge=0, description="different filters of tracks in use at a time")
    max_message_bytes: int = Field(65536, ge=1024)
    lag_limit_s: float = Field(10.0, gt=0, description="a client further behind than this is closed with 1013")
    resume_s: float = Field(60.0, ge=0, description="how far back a client may resume")
    heartbeat_s: float = Field(1.0, gt=0)
    compress: bool = Field(False, description="permessage-deflate, for clients far away")


class TrackerSettings(Section):
    """The table of tracks."""

    capacity: int = Field(
        2048,
        ge=1,
        le=LARGEST_CAPACITY,
        description="tracks at most, those not confirmed yet included; each takes 0.7 kB of memory, and 0.1 kB for "
        "each radar, from the start on; targets without room are counted as no_room",
    )
    asterix_numbers: bool = Field(
        False,
        description="give each track a number 1..4095, which ASTERIX has room for, beside its id (64 bits, never "
        "given twice in a run); displays and alerts show it in place of the id",
    )


class LimitsSettings(Section):
    """Bounds on what comes in and on what is queued."""

    body_bytes: int = Field(8 * 1024 * 1024, ge=1024)
    bodies_bytes: int = Field(64 * 1024 * 1024, ge=1024, description="of all bodies together, small ones not counted")
    connections: int = Field(1024, ge=16, description="at once; fewer where the process may open fewer files")
    node_events_per_request: int = Field(1000, ge=1)
    blocks_queued: int = Field(64, ge=2)
    rows_queued: int = Field(4096, ge=16, description="transactions the database writer may be behind")


class StorageSettings(Section):
    """What is kept, and for how long."""

    retention_days: float = Field(30.0, gt=0)
    point_interval_s: float = Field(1.0, ge=0, description="at most one stored point of a track in this time")
    state_interval_s: float = Field(
        60.0, gt=0, le=86400, description="how often what the detectors have learned is saved"
    )
    state_max_age_s: float = Field(
        3600.0, ge=0, description="a detector takes up what it had learned when it is not older than this; 0: never"
    )


class PostgresSettings(Section):
    """PostgreSQL in parts, instead of `database_url`: here a password may hold any sign."""

    host: str = Field("", description="empty: database_url says where the database is")
    port: int = Field(5432, ge=1, le=65535)
    user: str = "airside"
    password: SecretStr = SecretStr("")
    name: str = Field("airside", description="of the database")


class JournalSettings(Section):
    """The journal: files from which everything that happened can be replayed bit for bit."""

    folder: Path | None = Field(None, description="folder in which the journal is written; without it none is written")
    max_file_mib: int = Field(256, ge=1, le=65536, description="a file larger than this is followed by a new one")
    max_file_age_s: float = Field(
        3600.0, ge=10, le=86400, description="a file older than this is followed by a new one"
    )
    max_total_mib: int = Field(20480, ge=2, description="the oldest files are removed so that all together stay below")
    snapshot_every_s: float = Field(60.0, ge=1, le=3600, description="how often the state is recorded as a whole")
    sweeps: bool = Field(False, description="record the raw sweeps of the radars too (several MB/s a radar)")
    display: bool = Field(False, description="record what was sent to the displays too")

    @field_validator("folder", mode="before")
    @classmethod
    def _empty_is_none(cls, value: Any) -> Any:
        return None if value == "" else value


class MqttSettings(Section):
    """Pavement nodes that speak MQTT."""

    url: SecretUrl | None = Field(None, description="mqtt://user:password@host:1883, or mqtts://...")
    topic: str = "airside/nodes/+/events"
    client_id: str = Field("", max_length=64, description="of this service alone; empty: made of the other settings")

    @field_validator("url")
    @classmethod
    def _readable(cls, value: SecretUrl | None) -> SecretUrl | None:
        check_url(value.get_secret_value() if value is not None else "")
        return value


class DemoSettings(Section):
    """The demonstration."""

    traffic: str = "LFPO"
    incident_every_s: float = Field(90.0, gt=0)
    first_incident_s: float = Field(45.0, ge=0)
    seed: int = 1
    rain: bool = False
    synthetic_targets: int = Field(
        0, ge=0, le=1000, description="so many made-up movers in place of the recorded traffic"
    )
    reports: bool = Field(True, description="play the target reports (ADS-B) too; without them all rests on the radar")
    udp_port: int = Field(8600, ge=0, le=65535, description="where the simulated radar sends its datagrams")


class Settings(BaseSettings):
    """All settings. Top-level keys are also environment variables: AIRSIDE_PORT, AIRSIDE_DATABASE_URL, ..."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_nested_delimiter=BETWEEN,
        extra="forbid",
        frozen=True,
        populate_by_name=True,
        hide_input_in_errors=True,
    )

    mode: Literal["live", "demo", "replay"] = "live"
    host: str = "127.0.0.1"
    port: int = Field(8000, ge=0, le=65535)
    root_path: str = Field(
        "",
        description='path under which a proxy serves all of it, such as "/airside"; without it the X-Forwarded-Prefix '
        "of the proxy holds",
    )
    airport: str = Field(
        "LFPO", description="ICAO code of a shipped airport, or the path of an imported GeoJSON file, from this file on"
    )
    data_dir: Path = Path("data")
    database_url: SecretUrl = Field(
        SecretUrl(""), description="empty: SQLite in data_dir; postgresql+psycopg://... for a fleet"
    )
    bus_url: SecretUrl = Field(
        SecretUrl("memory://"), description="memory:// or nats://host:port, where pictures and alerts are published"
    )
    udp_address: str = Field("127.0.0.1", description="where radars without an address of their own are heard")
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: LogFormat = Field(
        "auto",
        description="auto: colours and progress at a terminal, text elsewhere; text: one line an event with date and "
        "time in UTC; json: one JSON object an event",
    )
    allowed_hosts: tuple[str, ...] = Field(
        (),
        description="further names under which clients ask for this service, such as the one that a proxy passes on, "
        '"*.tower.example", or "*" for any; the loopback names and `host` are always allowed',
    )
    allowed_origins: tuple[str, ...] = Field((), description="further origins that may open the feed and the 3D view")
    view3d: bool = True
    radars: tuple[RadarSettings, ...] = ()
    nodes: tuple[NodeSettings, ...] = ()
    runways: tuple[RunwaySettings, ...] = ()
    parts: PartsSettings = PartsSettings()
    tracker: TrackerSettings = TrackerSettings()
    feed: FeedSettings = FeedSettings()
    limits: LimitsSettings = LimitsSettings()
    storage: StorageSettings = StorageSettings()
    postgres: PostgresSettings = PostgresSettings()
    journal: JournalSettings = JournalSettings()
    mqtt: MqttSettings = MqttSettings()
    clocks: ClocksSettings = ClocksSettings()
    demo: DemoSettings = DemoSettings()

    @field_validator("root_path")
    @classmethod
    def _plain_path(cls, value: str) -> str:
        path = value.rstrip("/")
        if path and not PLAIN_PATH.fullmatch(path):
            raise ValueError('a path such as "/airside"')
        if path and path.split("/")[1] in OWN_PATHS:
            raise ValueError(f"{path} begins like a path of the service itself")
        return path

    @field_validator("bus_url")
    @classmethod
    def _readable(cls, value: SecretUrl) -> SecretUrl:
        check_url(value.get_secret_value())
        return value

    @field_validator("allowed_hosts")
    @classmethod
    def _names(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if not HOST_NAME.fullmatch(name):
                raise ValueError('names or addresses without scheme and port, such as "radar.tower.example"')
        return value

    @model_validator(mode="after")
    def _one_database(self) -> Settings:
        if self.postgres.host and self.database_url.get_secret_value():
            raise ValueError("database_url and postgres.host both say where the database is; leave one of them out")
        return self

    @property
    def database(self) -> str:
        """The database URL, password and all, with the embedded default filled in."""
        if not self.postgres.host:
            embedded = f"sqlite:///{(self.data_dir / 'airside.sqlite3').resolve()}"
            return self.database_url.get_secret_value() or embedded
        from sqlalchemy import URL

        one = self.postgres
        password = one.password.get_secret_value() or None
        made = URL.create("postgresql+psycopg", one.user, password, one.host, one.port, one.name)
        return made.render_as_string(hide_password=False).replace(" ", "%20")  # a space would end what is masked

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """The environment, as far as it is settings, goes over the file (the file comes in through init)."""
        if isinstance(env_settings, EnvSettingsSource):
            left_out = strays(env_settings.env_vars, cls)
            env_settings.env_vars = {k: v for k, v in env_settings.env_vars.items() if k not in left_out}
        return env_settings, init_settings


def load(path: Path | None = None, **overrides: Any) -> Settings:
    """Read the file (or none), put the environment on top, and `overrides` (from the command line) on top of all.

    A path of an airport in the file is relative to the file. Variables of the prefix that are no settings are warned
    of. Raises SettingsError with one line a fault.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
            values.update(_beside(path, values.get("airport")))
        except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SettingsError(f"{path}: {error}") from error
    for name, why in strays(os.environ, Settings).items():
        log.warning("environment: %s %s; it is left out", name, why)
    try:
        made = Settings(**values)
        if overrides:
            made = made.model_copy(update=overrides)
            made = Settings.model_validate(made.model_dump())
    except ValidationError as error:
        raise SettingsError(
            "\n".join(explain(one, str(path or "environment"), Settings) for one in error.errors())
        ) from None
    except SourceError as error:
        raise SettingsError(f"environment: {error}") from None  # what it comes from holds the value
    return made


def _beside(path: Path, airport: Any) -> dict[str, str]:
    """The airport of a settings file, where that is a path and not the code of a shipped one."""
    if not isinstance(airport, str):
        return {}
    beside = path.absolute().parent / Path(airport).expanduser()
    is_path = Path(airport).suffix.lower() in (".geojson", ".json") or "/" in airport or beside.is_file()
    return {"airport": str(beside)} if is_path else {}
