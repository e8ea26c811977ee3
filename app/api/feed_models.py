"""The messages of the live feed, for the AsyncAPI document; `app.live` makes and reads them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.api import models
from app.api.models import ClassName, Mode, Model, Seconds
from app.live.messages import DEFAULT_RATE_HZ, RATES_HZ

Topic = Literal["tracks", "alerts", "status"]
ALL_TOPICS: tuple[Topic, ...] = ("tracks", "alerts", "status")
Number = Annotated[int | str | None, Field(description="echoed in the answer")]


class ResumePlace(Model):
    """Where the client stood: epoch and seq of the last message it took."""

    epoch: str
    seq: int


class Hello(BaseModel):
    """First message of a client, within 10 s. With `resume` missed changes follow the subscription."""

    type: Literal["hello"]
    id: Number = None
    resume: ResumePlace | None = None


class FilterWish(Model):
    """Which tracks; alerts and status are never filtered."""

    classes: list[ClassName] = Field(default_factory=list)
    bbox: list[float] | None = Field(
        None, min_length=4, max_length=4, description="west, south, east, north in degrees"
    )


class Subscribe(Model):
    """What the client wants from now on; takes the place of an earlier subscription and brings a snapshot."""

    type: Literal["subscribe"]
    id: Number = None
    topics: list[Topic] = Field(default_factory=lambda: list(ALL_TOPICS))
    filter: FilterWish = FilterWish()
    max_rate_hz: float = Field(DEFAULT_RATE_HZ, gt=0, description=f"rounded down to one of {RATES_HZ}")


class Ping(BaseModel):
    """Answered with a result."""

    type: Literal["ping"]
    id: Number = None


class Welcome(Model):
    """Answer to hello. seq: the newest place of the stream, not one to resume from before a snapshot was taken."""

    type: Literal["welcome"]
    epoch: str = Field(description="changes when the stream begins anew (restart, replay wound back)")
    seq: int
    airport: str
    period_s: float = Field(description="shortest turn of a radar")
    server_time: Seconds
    schema_: str = Field(alias="schema")
    mode: Mode


class Result(BaseModel):
    """Answer to a subscription, a ping or something that was not understood."""

    model_config = ConfigDict(extra="forbid")
    type: Literal["result"]
    id: int | str | None
    ok: bool
    error: str | None = None
    topics: list[Topic] | None = None
    max_rate_hz: float | None = Field(None, description="the rate that was granted")
    recovered: bool | None = Field(None, description="the resume succeeded: a delta follows, no snapshot")


class Head(Model):
    """What every message of the stream carries. seq: where the receiver stands once it has taken the message."""

    epoch: str
    seq: int
    time: Seconds | None = Field(description="of the newest picture")
    mode: Mode


class TrackSnapshot(Head):
    """All tracks that the filter admits; takes the place of everything held before."""

    type: Literal["snapshot"]
    topic: Literal["tracks"]
    tracks: list[models.Track]
    final: Literal[True]


class AlertSnapshot(Head):
    """All live alerts."""

    type: Literal["snapshot"]
    topic: Literal["alerts"]
    alerts: list[models.Alert]
    final: Literal[True]


class Deleted(Model):
    """A track that is no longer there, or no longer admitted by the filter."""

    id: int
    reason: Literal["ended", "filter"]


class Delta(Head):
    """What changed since `prev`; to be applied in the order del, add, upd. A row may repeat what is known."""

    type: Literal["delta"]
    topic: Literal["tracks"]
    prev: int
    del_: list[Deleted] = Field(alias="del")
    add: list[models.Track]
    upd: list[dict[str, Any]] = Field(description="id and the fields that changed")


class AlertMessage(Head):
    """One step in an alert's life; every one is sent, in order, none is merged."""

    type: Literal["alert"]
    op: Literal["raise", "update", "acknowledge", "clear"]
    alert: models.Alert


class Status(Head):
    """Sensors, runways and stage timings; at least once a second, and when one of them changes."""

    type: Literal["status"]
    sensors: list[models.Sensor]
    runways: list[models.RunwayUse]
    timings_s: dict[str, float]


class Heartbeat(Model):
    """Sign of life while nothing else is sent. time: of the newest picture; server_time: now."""

    type: Literal["heartbeat"]
    epoch: str
    seq: int
    mode: Mode
    time: Seconds | None
    server_time: Seconds


class Lagging(Model):
    """The client reads more slowly than its rate: this many deltas were merged into the next."""

    type: Literal["lagging"]
    dropped: int
    mode: Mode


FROM_CLIENT: tuple[type[BaseModel], ...] = (Hello, Subscribe, Ping)
TO_CLIENT: tuple[type[BaseModel], ...] = (
    Welcome,
    Result,
    TrackSnapshot,
    AlertSnapshot,
    Delta,
    AlertMessage,
    Status,
    Heartbeat,
    Lagging,
)
