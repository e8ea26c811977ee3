"""The picture in the conventions of readsb, for tar1090 and everything else that polls `aircraft.json`.

Units there are knots, feet and degrees; keys are left out when their value is unknown. The height that we know is above
the airport, so an altitude is given only when the map says how high the airport lies.
"""

from __future__ import annotations

import gzip
import math
import re
import time
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import APIRouter, Path
from starlette.requests import Request
from starlette.responses import Response

from app.api import readsb_models as models
from app.api.context import Context, answer, problems
from app.api.problems import ApiProblem
from app.api.trails import INTERVAL_S, Trails
from app.wire import Row
from pipeline.picture import Picture

MPS_TO_KNOTS = 3600 / 1852
METRES_TO_FEET = 1 / 0.3048
NAC_P = ((3.0, 11), (10.0, 10), (30.0, 9), (92.6, 8), (185.2, 7), (555.6, 6))
"""Position accuracy categories of DO-260B: 95 % radius in metres below which each holds."""


NO_ADDRESS = 1 << 24
"""A hex has 24 bits. Two live tracks would share one only if 16 million others had begun between them."""


OLD_S = INTERVAL_S + 2.0
"""Targets not measured for longer are left out of the trails, as in tar1090's own script."""

NUMBER = re.compile(r"\s*(-?\d+(?:\.\d+)?)\s*(m|ft)?\s*")
"""A height as OpenStreetMap has it: metres unless it says feet."""


def readsb_router(context: Context) -> APIRouter:
    """GET /data/aircraft.json, /data/receiver.json, /data/history_N.json and /chunks/."""
    router = APIRouter(tags=["readsb"])
    elevation = airport_elevation(context.service.airport_geojson)
    trails = Trails(lambda picture: trail_document(picture, context.hub.rows(), elevation))
    context.hub.on_picture.append(trails.show)

    @router.get("/data/aircraft.json", response_model=models.Aircraft)
    async def aircraft() -> Response:
        """The live tracks as readsb would give them; a hex with ~ is not of ICAO, or is made of the track's id."""
        picture = context.hub.picture
        if picture is None:
            return answer({"now": time.time(), "messages": 0, "aircraft": []})
        return answer(aircraft_document(picture, context.hub.rows(), elevation))

    @router.get("/data/receiver.json", response_model=models.Receiver)
    async def receiver() -> Response:
        """Where the airport is, how often to ask, and how many files of history there are."""
        frame = context.service.airport.frame
        return answer(
            {
                "version": f"airside {version('airside')}",
                "refresh": 1000,
                "history": trails.files,
                "lat": frame.latitude,
                "lon": frame.longitude,
            }
        )

    @router.get("/data/history_{number}.json", response_model=models.Aircraft, responses=problems(404, 422))
    async def history_file(request: Request, number: Annotated[int, Path(ge=0, le=10_000)]) -> Response:
        """The picture of some time in the last hour, 32 s after that with the number before; 0 is the oldest."""
        return _packed(request, trails.file(number))

    @router.get("/chunks/chunks.json", response_model=models.Chunks)
    async def chunks() -> Response:
        """The names of the chunks in which tar1090 reads the last hour."""
        return answer({"chunks": trails.names(), "chunks_all": trails.names()})

    @router.get("/chunks/{name}", response_model=models.Chunk, responses=problems(404, 422))
    async def chunk(request: Request, name: Annotated[str, Path(max_length=64)]) -> Response:
        """Pictures of the last hour, 8 s apart."""
        return _packed(request, trails.chunk(name))

    return router


def _packed(request: Request, content: bytes | None) -> Response:
    """Gzipped JSON, unpacked for a client that does not take it so."""
    if content is None:
        raise ApiProblem(404, "there is no such part of the history")
    headers = {"Vary": "Accept-Encoding"}
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(content, media_type="application/json", headers={**headers, "Content-Encoding": "gzip"})
    return Response(gzip.decompress(content), media_type="application/json", headers=headers)


def airport_elevation(document: dict[str, Any]) -> float | None:
    """Metres above mean sea level, from the map's own properties or those of its aerodrome feature."""
    candidates = [document.get("properties"), document.get("airport"), document]
    candidates += [one.get("properties") for one in document.get("features", ())]
    for properties in candidates:
        for key in ("elevation_m", "ele"):
            height = _height(properties.get(key)) if isinstance(properties, dict) else None
            if height is not None:
                return height
    return None


def _height(value: Any) -> float | None:
    found = NUMBER.fullmatch(value) if isinstance(value, str) else None
    if found:
        return float(found[1]) / (METRES_TO_FEET if found[2] == "ft" else 1.0)
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    return None


def aircraft_document(picture: Picture, rows: list[Row], elevation: float | None) -> Row:
    """The whole of aircraft.json."""
    tracks = picture.tracks
    seen = (picture.time - tracks.updated).clip(0.0).round(1).tolist()
    hits = tracks.hits.tolist()
    if len(rows) != len(tracks):
        seen, hits = [0.0] * len(rows), [0] * len(rows)
    aircraft = [_aircraft(row, age, n, elevation) for row, age, n in zip(rows, seen, hits, strict=True)]
    return {"now": picture.time, "messages": sum(hits), "aircraft": aircraft}


def _aircraft(row: Row, seen: float, hits: int, elevation: float | None) -> Row:
    made: Row = {
        "hex": row["address"] or f"~{row['id'] % NO_ADDRESS:06x}",
        "type": _type(row),
        "flight": f"{row['callsign']:<8}" if row["callsign"] else None,
        "alt_baro": _altitude(row, elevation),
        "gs": None if row["speed_mps"] is None else round(row["speed_mps"] * MPS_TO_KNOTS, 1),
        "track": row["course_deg"],
        "true_heading": row["heading_deg"],
        "category": _category(row),
        "lat": row["lat"],
        "lon": row["lon"],
        "nac_p": _nac_p(row["accuracy_m"]),
        "rc": None if row["accuracy_m"] is None else round(row["accuracy_m"]),
        "mlat": [],
        "tisb": [],
        "messages": hits,
        "seen": seen,
        "seen_pos": seen if row["lat"] is not None else None,
    }
    return {name: value for name, value in made.items() if value is not None}


def trail_document(picture: Picture, rows: list[Row], elevation: float | None) -> Row:
    """What of aircraft.json makes a trail."""
    made = aircraft_document(picture, rows, elevation)
    fresh = [one for one in made["aircraft"] if one["seen"] < OLD_S and "lat" in one]
    return {**made, "aircraft": [{name: one[name] for name in TRAIL if name in one} for one in fresh]}


TRAIL = ("hex", "type", "flight", "alt_baro", "gs", "track", "category", "lat", "lon", "messages", "seen", "seen_pos")


def _type(row: Row) -> str:
    """An address says what it came from, also while radar alone carries its track on."""
    if row["address"] is None:
        return "tisb_trackfile"
    if row["address"].startswith("~"):
        return "adsb_other"
    return "adsb_icao_nt" if row["class"] == "vehicle" else "adsb_icao"


def _altitude(row: Row, elevation: float | None) -> str | int | None:
    if row["on_ground"]:
        return "ground"
    if elevation is None or row["altitude_m"] is None:
        return None
    return round((float(row["altitude_m"]) + elevation) * METRES_TO_FEET / 25) * 25


def _category(row: Row) -> str | None:
    """A1 light to A5 heavy by length; C2 service vehicle."""
    if row["class"] == "vehicle":
        return "C2"
    if row["class"] != "aircraft" or row["length_m"] is None:
        return None
    return next((name for limit, name in ((16, "A1"), (28, "A2"), (55, "A3")) if row["length_m"] < limit), "A5")


def _nac_p(accuracy: float | None) -> int | None:
    if accuracy is None:
        return None
    return next((value for limit, value in NAC_P if accuracy < limit), 0)
