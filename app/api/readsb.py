"""The picture in the conventions of readsb, for tar1090 and everything else that polls `aircraft.json`.

Units there are knots, feet and degrees; keys are left out when their value is unknown. The height that we know is above
the airport, so an altitude is given only when the map says how high the airport lies.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from fastapi import APIRouter
from starlette.responses import Response

from app.api.context import Context, answer
from app.wire import Row
from pipeline.picture import Picture

MPS_TO_KNOTS = 3600 / 1852
METRES_TO_FEET = 1 / 0.3048
NAC_P = ((3.0, 11), (10.0, 10), (30.0, 9), (92.6, 8), (185.2, 7), (555.6, 6))
"""Position accuracy categories of DO-260B: 95 % radius in metres below which each holds."""


NO_ADDRESS = 1 << 24
"""A hex has 24 bits. Two live tracks would share one only if 16 million others had begun between them."""


def readsb_router(context: Context) -> APIRouter:
    """GET /data/aircraft.json and /data/receiver.json."""
    router = APIRouter(prefix="/data", tags=["readsb"])
    elevation = airport_elevation(context.service.airport_geojson)

    @router.get("/aircraft.json")
    async def aircraft() -> Response:
        """The live tracks as readsb would give them; a hex with ~ is the track's id."""
        picture = context.hub.picture
        if picture is None:
            return answer({"now": 0.0, "messages": 0, "aircraft": []})
        return answer(aircraft_document(picture, context.hub.rows(), elevation))

    @router.get("/receiver.json")
    async def receiver() -> Response:
        """Where the airport is, and how often to ask."""
        frame = context.service.airport.frame
        return answer(
            {
                "version": f"airside {version('airside')}",
                "refresh": 1000,
                "history": 0,
                "lat": frame.latitude,
                "lon": frame.longitude,
            }
        )

    return router


def airport_elevation(document: dict[str, Any]) -> float | None:
    """Metres above mean sea level, from the map's own properties or those of its aerodrome feature."""
    candidates = [document.get("properties"), document.get("airport"), document]
    candidates += [one.get("properties") for one in document.get("features", ())]
    for properties in candidates:
        for key in ("elevation_m", "ele"):
            value = properties.get(key) if isinstance(properties, dict) else None
            if isinstance(value, int | float):
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


def _type(row: Row) -> str:
    if row["address"] is None or "report" not in row["sources"]:
        return "tisb_trackfile"
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
