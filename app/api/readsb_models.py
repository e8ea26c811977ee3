"""The shapes of the files in the conventions of readsb and tar1090, for the OpenAPI document."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from app.api.models import Model


class AircraftRow(BaseModel):
    """One target; what is not known is left out. Knots, feet, degrees."""

    hex: str = Field(description="address; with ~ one not of ICAO, or made of the id of a track without address")
    type: Literal["adsb_icao", "adsb_icao_nt", "adsb_other", "tisb_trackfile"]
    flight: str | None = None
    alt_baro: int | Literal["ground"] | None = Field(None, description="feet above mean sea level")
    gs: float | None = None
    track: float | None = None
    true_heading: float | None = None
    category: str | None = None
    lat: float | None = None
    lon: float | None = None
    nac_p: int | None = None
    rc: int | None = None
    mlat: list[str] | None = None
    tisb: list[str] | None = None
    messages: int
    seen: float = Field(description="seconds since the newest measurement")
    seen_pos: float | None = None


class Aircraft(Model):
    """All targets at one time."""

    now: float = Field(description="Unix seconds, UTC")
    messages: int
    aircraft: list[AircraftRow]


class Receiver(Model):
    """What tar1090 asks for first. refresh: ms. history: how many files history_N.json there are."""

    version: str
    refresh: int
    history: int
    lat: float
    lon: float


class Chunks(Model):
    """The names of the chunks, oldest first."""

    chunks: list[str]
    chunks_all: list[str]


class Chunk(Model):
    """Pictures, oldest first."""

    files: list[Aircraft]
