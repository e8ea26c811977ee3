"""The shapes of the answers, for the OpenAPI and AsyncAPI documents; the answers themselves come from `app.wire`.

Times are Unix seconds (UTC). Angles are degrees clockwise from true north. Positions are WGS 84 degrees and metres east
and north of the airport's reference point. What is not known is null.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

LARGEST_ID = 2**53 - 1
"""The greatest whole number that every reader of JSON takes exactly; ids hold 64 bits and never get there."""

COMPLETE = "false while the database does not answer: what it alone has is missing"

Seconds = Annotated[float, Field(description="Unix seconds, UTC", examples=[1760000000.25])]
Mode = Annotated[Literal["live", "demo", "replay"], Field(description="anything but live is no live traffic")]
TrackId = Annotated[
    int,
    Field(ge=1, le=LARGEST_ID, description="1, 2, 3, ... in the order of confirmation; never given again in a run"),
]
TrackNumber = Annotated[
    int,
    Field(
        ge=1, le=4095, description="ASTERIX track number, shown in place of the id; given again some time after the "
        "track has ended. null: none are given (tracker.asterix_numbers), or none was free"
    ),
]  # fmt: skip
PLAIN = r"^[^\x00-\x1f\x7f]*$"
"""Texts without control characters: what people write goes into logs, tables and displays."""

ClassName = Literal["aircraft", "vehicle", "unknown"]
PhaseName = Literal["tentative", "confirmed", "coasting"]
SourceName = Literal["radar", "node", "report"]
StateName = Literal["new", "ongoing", "acknowledged", "cleared"]
StageName = Literal["information", "alarm"]


class Model(BaseModel):
    """A JSON object with no further members."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)


class Fault(Model):
    """One single fault of a request: a field that is wrong, with its place, or a row of a message, with its index."""

    message: str
    place: str | None = Field(None, description="the field", examples=["body.by"])
    index: int | None = Field(None, ge=0, description="which object of the array, from 0")
    reason: str | None = Field(None, description="in one word", examples=["bad_value"])


class Problem(BaseModel):
    """RFC 9457 problem details."""

    model_config = ConfigDict(extra="allow")
    type: str = "about:blank"
    title: str
    status: int
    detail: str
    errors: list[Fault] | None = Field(None, description="the single faults, where there are some")


class Position(Model):
    """A point, in WGS 84 degrees and local metres."""

    lat: float
    lon: float
    east_m: float
    north_m: float


class Track(Model):
    """One target as it is believed to be at `time`."""

    id: TrackId
    number: TrackNumber | None
    time: Seconds
    lat: float | None
    lon: float | None
    east_m: float | None
    north_m: float | None
    altitude_m: float | None = Field(description="height above the airport")
    on_ground: bool
    speed_mps: float | None
    course_deg: float | None = Field(description="direction of movement; null below 0.5 m/s")
    heading_deg: float | None = Field(description="where the nose points")
    axis_deg: float | None = Field(
        description="bearing of the long axis as radars see it, 0 to 180; null unless clearly longer than wide"
    )
    length_m: float | None
    width_m: float | None
    class_: ClassName = Field(alias="class")
    callsign: str | None
    address: str | None = Field(description="24-bit address, six lower-case hex digits, ~ before one not of ICAO")
    phase: PhaseName = Field(description="coasting: not seen at the last looks, position predicted")
    zone: str | None = Field(description="name (or id) of the map feature it is on")
    runway: str | None = Field(description="runway whose strip it is in")
    sources: list[SourceName]
    accuracy_m: float | None = Field(description="semi-major axis of the 95 % ellipse of the position")
    accuracy_minor_m: float | None = Field(description="semi-minor axis of that ellipse")
    accuracy_bearing_deg: float | None = Field(description="bearing of its longer axis, 0 to 180")
    simulated: bool = Field(description="rests on simulated input")


class AlertTarget(Position):
    """A target as it was when its alert was last updated."""

    track: TrackId
    number: TrackNumber | None
    callsign: str | None
    address: str | None
    class_: str = Field(alias="class")
    speed_mps: float | None
    course_deg: float | None


class Alert(Model):
    """One runway alert."""

    id: int
    rule: str
    stage: StageName
    worst_stage: StageName | None = Field(None, description="the gravest it had; null in alerts of earlier versions")
    state: StateName
    text: str
    raised_at: Seconds
    updated_at: Seconds
    duration_s: float
    runway: str | None
    holding_point: str | None
    targets: list[AlertTarget]
    cleared_at: Seconds | None
    clear_reason: str | None
    acknowledged_at: Seconds | None
    acknowledged_by: str | None = Field(description="stays when the alert escalates and has to be acknowledged again")
    time_to_threshold_s: float | None
    distance_to_threshold_m: float | None
    time_to_conflict_s: float | None
    separation_m: float | None
    predicted_separation_m: float | None
    conflict_position: Position | None
    visibility: Literal["normal", "low"]
    parameter_set: str
    sensors: list[str]
    degraded: bool = Field(description="raised while a sensor was degraded")
    aural: bool
    simulated: bool
    cat004_type: int
    cat011_type: int


class AlertStep(Model):
    """One step in an alert's life."""

    time: Seconds
    operation: Literal["raise", "update", "acknowledge", "clear"]
    alert: Alert


class Sensor(Model):
    """The health of one sensor. counters: what it delivered and what was dropped, by reason; they only grow.

    degraded: what it tells is not all, `detail` says why.
    """

    id: str
    kind: str
    status: Literal["ok", "degraded", "silent", "waiting"]
    last: Seconds | None
    simulated: bool
    detail: str
    counters: dict[str, int]
    parts: dict[str, str] = Field(
        description="of a radar, the methods that work on its video, by verb",
        examples=[{"detect": "adaptive", "extract": "manhattan"}],
    )
    clock_offset_s: float | None = Field(
        description="the times that it states less those of their arrival, with the least latency; null when unknown"
    )
    clock_spread_s: float | None = Field(description="how far the offsets of single seconds lie apart")


class RunwayUse(Model):
    """How a runway is used, and what is on it."""

    id: str
    open: bool
    in_use: str | None = Field(description="designator of the direction in use; null when not in use")
    visibility: Literal["normal", "low"]
    occupants: list[TrackId] = Field(description="tracks inside the protection area")
    next_arrival: TrackId | None
    next_arrival_s: float | None


class Stamp(Model):
    """Where an answer belongs in the stream of pictures."""

    epoch: str
    seq: int
    time: Seconds
    mode: Mode


class Picture(Stamp):
    """Everything at one moment."""

    airport: str
    tracks: list[Track]
    alerts: list[Alert]
    runways: list[RunwayUse]
    sensors: list[Sensor]
    timings_s: dict[str, float] = Field(description="seconds that each stage took for the newest block")


class TrackList(Stamp):
    """The live tracks."""

    tracks: list[Track]


class TrackAnswer(Stamp):
    """One live track."""

    track: Track


class HistoryPoint(Model):
    """Where a track was."""

    time: Seconds
    lat: float | None
    lon: float | None
    east_m: float | None
    north_m: float | None
    altitude_m: float | None
    on_ground: bool
    speed_mps: float | None
    course_deg: float | None
    heading_deg: float | None
    accuracy_m: float | None
    phase: PhaseName
    sources: list[SourceName]
    zone: str | None
    runway: str | None


class StoredTrack(Model):
    """A track in storage. uid: its own for ever, unlike the id, which begins anew with each run of the service."""

    uid: int
    id: TrackId
    number: TrackNumber | None
    born: Seconds
    first: Seconds
    last: Seconds
    class_: ClassName = Field(alias="class")
    callsign: str | None
    address: str | None
    simulated: bool
    mode: Mode


class History(Model):
    """The stored points of one track, oldest first. truncated: there are more after the last one."""

    mode: Mode
    track: StoredTrack
    points: list[HistoryPoint]
    truncated: bool


class StoredTrackList(Model):
    """Tracks in storage, newest first."""

    mode: Mode
    tracks: list[StoredTrack]


class AlertList(Model):
    """Alerts, newest first."""

    mode: Mode
    alerts: list[Alert]
    complete: bool = Field(description=COMPLETE)


class AlertAnswer(Model):
    """One alert."""

    mode: Mode
    alert: Alert


class AlertLife(AlertAnswer):
    """One alert with every stored step of its life."""

    changes: list[AlertStep]
    complete: bool = Field(description=COMPLETE)


class Acknowledgement(Model):
    """Who acknowledges."""

    by: str = Field(min_length=1, max_length=64, pattern=PLAIN, examples=["TWR-1"])


class RunwayOrder(Model):
    """How a runway is to be used; what is left out stays."""

    open: bool | None = None
    in_use: str | None = Field(
        None, max_length=8, pattern=PLAIN, description='a designator such as "24"; "" for not in use'
    )
    visibility: Literal["normal", "low"] | None = None


class RunwayAnswer(Model):
    """The runway's new state."""

    mode: Mode
    runway: RunwayUse


class RunwayList(Model):
    """All runways."""

    mode: Mode
    runways: list[RunwayUse]


class SensorList(Model):
    """All sensors."""

    mode: Mode
    time: Seconds | None
    sensors: list[Sensor]


class Counted(Model):
    """What became of the data sent in: taken and dropped, by reason."""

    model_config = ConfigDict(extra="allow")
    taken: int


class RefusedRow(Model):
    """A row of a message that was not taken."""

    index: int = Field(ge=0, description="which object of the array, from 0")
    reason: str = Field(
        description="`bad_value`, `unknown_node`; for its time `ahead`, `behind`, `invalid`", examples=["bad_value"]
    )
    message: str


class RowsTaken(Counted):
    """What became of the rows of a message: how many are taken, how many refused by reason, and each refused one."""

    errors: list[RefusedRow] | None = Field(None, description="the rows that were not taken; left out when all were")
    ignored: list[str] | None = Field(
        None, description="names of members that nobody knows, which were ignored; left out when there were none"
    )


class Health(Model):
    """Alive, or ready with every check by name."""

    status: Literal["ok", "starting"]
    checks: dict[str, bool] = {}


class GeoJson(BaseModel):
    """A GeoJSON FeatureCollection (RFC 7946): longitude first."""

    model_config = ConfigDict(extra="allow")
    type: Literal["FeatureCollection"]
    features: list[dict[str, Any]]
