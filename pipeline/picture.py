"""The picture: what a controller sees at one moment. Values only; numbering and wire form belong to the shell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pipeline.tables import Tracks

Stage = Literal["information", "alarm"]
AlertState = Literal["new", "ongoing", "acknowledged", "cleared"]
Visibility = Literal["normal", "low"]
AlertOperation = Literal["raise", "update", "acknowledge", "clear"]


@dataclass(frozen=True)
class AlertTarget:
    """A target as it was when its alert was last updated.

    track: its id. number: its ASTERIX track number, None when it has none. course: rad; nan speeds and courses do not
    occur (None).
    """

    track: int
    callsign: str | None
    address: str | None
    category: str
    east: float
    north: float
    speed: float
    course: float | None
    number: int | None = None


@dataclass(frozen=True)
class Alert:
    """One runway alert with the fields of CAT004, CAT011 and the operators' displays. Times UTC s, lengths m.

    worst_stage: the gravest stage that it ever had. acknowledged_at, acknowledged_by: of the last acknowledgement; they
    stay when the alert escalates and asks for another one.
    """

    id: int
    rule: str
    stage: Stage
    state: AlertState
    text: str
    raised_at: float
    updated_at: float
    targets: tuple[AlertTarget, ...]
    runway: str | None = None
    holding_point: str | None = None
    cleared_at: float | None = None
    clear_reason: str | None = None
    acknowledged_at: float | None = None
    acknowledged_by: str | None = None
    time_to_threshold: float | None = None
    distance_to_threshold: float | None = None
    time_to_conflict: float | None = None
    separation: float | None = None
    predicted_separation: float | None = None
    conflict_position: tuple[float, float] | None = None
    visibility: Visibility = "normal"
    parameter_set: str = "default"
    sensors: tuple[str, ...] = ()
    degraded: bool = False
    aural: bool = True
    simulated: bool = False
    cat004_type: int = 0
    cat011_type: int = 0
    worst_stage: Stage = "information"


@dataclass(frozen=True)
class AlertChange:
    """One step in an alert's life; every one is stored and sent, none is merged away."""

    operation: AlertOperation
    time: float
    alert: Alert


@dataclass(frozen=True)
class RunwayState:
    """How a runway is used, and what is on it. in_use: designator of the direction in use, None when not in use.

    occupants: tracks inside the protection area. next_arrival_s: time to threshold of the nearest arrival.
    """

    id: str
    open: bool = True
    in_use: str | None = None
    visibility: Visibility = "normal"
    occupants: tuple[int, ...] = ()
    next_arrival: int | None = None
    next_arrival_s: float | None = None


@dataclass(frozen=True)
class SensorState:
    """The health of one sensor. status: "ok", "degraded", "silent" or "waiting" (nothing heard since start).

    counters: what it delivered and what was dropped, by reason; they only grow. parts: of a radar, the methods that
    work on its video, by verb. clock_offset_s: the times that it states less those of their arrival, with the least
    latency; None when unknown. clock_spread_s: how far single seconds lie from that.
    """

    id: str
    kind: str
    status: str
    last: float | None
    simulated: bool = False
    detail: str = ""
    counters: dict[str, int] = field(default_factory=dict)
    parts: dict[str, str] = field(default_factory=dict)
    clock_offset_s: float | None = None
    clock_spread_s: float | None = None


@dataclass(frozen=True)
class Picture:
    """Everything at one moment. timings: seconds that each stage took for the newest block, by stage name."""

    time: float
    tracks: Tracks
    alerts: tuple[Alert, ...] = ()
    runways: tuple[RunwayState, ...] = ()
    sensors: tuple[SensorState, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
