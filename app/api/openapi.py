"""The OpenAPI document: what FastAPI makes of the routes, with named schemas, where it is served, and security."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

import msgspec
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app.api import models, replay_models
from app.api.problems import PROBLEM
from app.ingest.node_events import NodeEventRow
from app.ingest.target_reports import TargetReportRow

JSON = "application/json"
SCHEMAS = "#/components/schemas/"

ROWS: dict[type[msgspec.Struct], str] = {NodeEventRow: "NodeEvent", TargetReportRow: "TargetReport"}
"""The objects that the ways in take, and the names of their schemas."""

MORE_MODELS: tuple[type[BaseModel], ...] = (models.Problem, models.GeoJson, replay_models.ReplayOrder)
"""Models that FastAPI does not know of: of answers that are not `application/json`, of a body that a route reads."""

SECURITY_SCHEMES = {
    "proxy": {
        "type": "http",
        "scheme": "basic",
        "description": "The service has no users of its own; a proxy before it may ask for a name and a password.",
    }
}

TAGS = {
    "picture": "Everything at one moment, its sensors, the map, the radar video",
    "tracks": "Live and stored tracks",
    "alerts": "Runway alerts, live and stored, and their acknowledgement",
    "runways": "How each runway is used",
    "parts": "The methods that work on a radar's video",
    "replay": "Steering the replay of a recording",
    "ways in": "What sensors and other systems send",
    "readsb": "The picture in the conventions of readsb, for tar1090 and its like",
    "operation": "Health, metrics and documents",
}


def reference(name: str) -> dict[str, str]:
    """A reference to a schema by its name."""
    return {"$ref": SCHEMAS + name}


def json_rows(row: type[msgspec.Struct], limit: int) -> dict[str, Any]:
    """The request body of a way in: one object, or an array of up to `limit`."""
    one = reference(ROWS[row])
    many = {"type": "array", "items": one, "maxItems": limit}
    return {"requestBody": {"required": True, "content": {JSON: {"schema": {"anyOf": [one, many]}}}}}


def operation_id(route: APIRoute) -> str:
    """What clients that are made from the document call the operation."""
    return route.name


def document(app: FastAPI) -> dict[str, Any]:
    """The document for a service at the root of its host; made once for each application."""
    if app.openapi_schema is None:
        made = get_openapi(
            title=app.title,
            version=app.version,
            openapi_version="3.1.0",
            summary=app.summary,
            description=app.description,
            routes=app.routes,
            license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        )
        components = made.setdefault("components", {})
        components["schemas"] = dict(sorted({**components.get("schemas", {}), **_more_schemas()}.items()))
        components["securitySchemes"] = SECURITY_SCHEMES
        for call in (call for calls in made["paths"].values() for call in calls.values()):
            _declare_refusals(call)
        made["security"] = [{}, {"proxy": []}]
        used = {tag for calls in made["paths"].values() for call in calls.values() for tag in call.get("tags", ())}
        made["tags"] = [{"name": name, "description": about} for name, about in TAGS.items() if name in used]
        app.openapi_schema = made
    return app.openapi_schema


def _declare_refusals(call: dict[str, Any]) -> None:
    """What any call may be answered before it reaches its route: by its address, and by how its body comes in."""
    statuses = [400] if call.get("parameters") else []
    statuses += [408, 413, 503] if "requestBody" in call else []
    for status in statuses:
        said = {"description": HTTPStatus(status).phrase, "content": {PROBLEM: {"schema": reference("Problem")}}}
        call["responses"].setdefault(str(status), said)


def served_at(made: dict[str, Any], prefix: str) -> dict[str, Any]:
    """The document with the address at which the service is reached. prefix: "" or a path such as "/airside"."""
    return {**made, "servers": [{"url": prefix or "/", "description": "where this document comes from"}]}


def _more_schemas() -> dict[str, Any]:
    _, structs = msgspec.json.schema_components(tuple(ROWS), ref_template=SCHEMAS + "{name}")
    _, more = models_json_schema([(one, "serialization") for one in MORE_MODELS], ref_template=SCHEMAS + "{model}")
    named = {name: {**structs[row.__name__], "title": name} for row, name in ROWS.items()}
    return {**more["$defs"], **named}
