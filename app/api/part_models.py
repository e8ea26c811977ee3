"""The shapes of what is said of the parts of a radar, for the OpenAPI document."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, RootModel

from app.api.models import PLAIN, Mode, Model


class PartChoice(BaseModel):
    """A part by name; every further member is one of its settings, and what is left out has its default."""

    model_config = ConfigDict(extra="allow")
    name: str = Field(max_length=64, pattern=PLAIN)


class PartsOrder(RootModel[dict[str, PartChoice | str]]):
    """Which parts are to work on the radar's video, by verb; a bare name stands for its defaults. What is left out
    stays."""

    model_config = ConfigDict(
        json_schema_extra={
            "minProperties": 1,
            "examples": [{"detect": {"name": "hybrid", "pfa": 1e-5}, "extract": "manhattan"}],
        }
    )


class PartSetting(Model):
    """One setting of a part."""

    name: str
    type: str = Field(description="as JSON names it", examples=["number", "integer or null"])
    default: Any
    choices: list[str] = Field(description="the only values, where these are words; else empty")
    about: str


class PartMethod(Model):
    """One part that can be chosen."""

    name: str
    about: str
    settings: list[PartSetting]


class RadarParts(Model):
    """What works on a radar's video, what could, and what it costs."""

    mode: Mode
    radar: str
    running: dict[str, PartChoice] = Field(
        examples=[{"detect": {"name": "hybrid", "pfa": 1e-6}, "extract": {"name": "manhattan", "min_cells": 1}}]
    )
    next: dict[str, PartChoice] | None = Field(
        description="what learns beside those that run, and takes over from them; null when nothing does"
    )
    scans_left: int | None = Field(description="turns until `next` takes over")
    plots_a_scan: int = Field(description="in the newest whole turn")
    ms_a_turn: dict[str, float] = Field(description="milliseconds of the newest whole turn, by stage")
    cut: dict[str, int] = Field(
        description="what was left out in the last 10 s to keep up, by counter; empty when nothing was"
    )
    available: dict[str, list[PartMethod]]
