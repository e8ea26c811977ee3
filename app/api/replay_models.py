"""The shapes of what is said of a replay, for the OpenAPI document."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from app.api.models import Mode, Model, Seconds


class Replay(Model):
    """Where the replay of a recording stands. begin, end, time: times of the recording, not of today."""

    mode: Mode
    source: str = Field(description="name of the recording")
    begin: Seconds
    end: Seconds
    time: Seconds
    playing: bool
    speed: float = Field(description="times the recorded pace")
    gaps: list[Seconds] = Field(description="where the recording has a hole or the service was started anew")


class ReplayOrder(Model):
    """How the replay is to go on; what is left out stays."""

    model_config = ConfigDict(strict=True, json_schema_extra={"minProperties": 1, "examples": [{"playing": True}]})
    playing: bool | None = None
    speed: float | None = Field(None, gt=0, allow_inf_nan=False, description="times the recorded pace, 0.1 to 64")
    time: Annotated[float, Field(allow_inf_nan=False)] | Annotated[str, Field(max_length=64)] | None = Field(
        None, description="of the recording: Unix seconds or ISO 8601"
    )
