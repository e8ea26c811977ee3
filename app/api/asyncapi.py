"""The AsyncAPI 3.0 document of the live feed and of the bus, made from the models of the messages."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app.api import models
from app.api.feed_models import FROM_CLIENT, TO_CLIENT, AlertMessage
from app.live.messages import SUBPROTOCOL, SUBSCRIPTION_BURST, SUBSCRIPTIONS_PER_S

DESCRIPTION = f"""
Open the WebSocket with the subprotocol `{SUBPROTOCOL}`, say `hello`, get `welcome`, say `subscribe`, get `result` and
a snapshot of each topic, then deltas at the granted rate, every alert at once, `status` about once a second, and a
`heartbeat` when nothing else is sent. To resume after a lost connection, say `hello` with `resume`: the `epoch` and
`seq` of the last message that was taken after the snapshot, `{{"epoch": ..., "seq": ...}}`; the `result` of the
subscription says whether the place was recovered.

A later `subscribe` takes the place of the earlier one, at most {SUBSCRIPTIONS_PER_S:g} times a second and
{SUBSCRIPTION_BURST:g} at once. One that comes sooner is answered by a `result` with `ok` false and changes nothing; a
client that goes on like that is closed with 1008. Clients with equal filters share one view of the picture; as many
different filters may be in use at a time as the setting `feed.max_filters` says (100), and a further one is refused
in the same way.

Closed with 1008 (hostile or silent), 1009 (frame too long), 1013 (too many clients, or more than 10 s behind: try
again later), 1001 (the service ends).
"""


def document(icao: str, version: str, prefix: str = "") -> dict[str, Any]:
    """The document for one airport. prefix: "", or the path under which a proxy serves it, such as "/airside"."""
    kinds: list[type[BaseModel]] = [*FROM_CLIENT, *TO_CLIENT, models.Picture]
    return {
        "asyncapi": "3.0.0",
        "info": {"title": f"Airside live feed {icao}", "version": version, "description": DESCRIPTION.strip()},
        "defaultContentType": "application/json",
        "servers": {
            "here": {
                "host": "{host}",
                "protocol": "ws",
                "pathname": prefix or "/",
                "variables": {"host": {"default": "127.0.0.1:8000", "description": "where the service listens"}},
            }
        },
        "channels": {
            "live": {
                "address": "/api/v1/live",
                "title": "live pictures and alerts",
                "servers": [{"$ref": "#/servers/here"}],
                "messages": {kind.__name__: _message(kind) for kind in (*FROM_CLIENT, *TO_CLIENT)},
                "bindings": {"ws": {"method": "GET"}},
            },
            "busPictures": {
                "address": f"airside.{icao}.picture",
                "description": "NATS, when bus_url says so; the newest wins",
                "messages": {"Picture": _message(models.Picture)},
            },
            "busAlerts": {
                "address": f"airside.{icao}.alert",
                "description": "NATS JetStream, when bus_url says so; kept for a week",
                "messages": {"AlertMessage": _message(AlertMessage)},
            },
        },
        "operations": {
            "takeRequests": _operation("receive", "live", FROM_CLIENT),
            "sendFeed": _operation("send", "live", TO_CLIENT),
            "publishPictures": _operation("send", "busPictures", (models.Picture,)),
            "publishAlerts": _operation("send", "busAlerts", (AlertMessage,)),
        },
        "components": {
            "messages": {
                kind.__name__: {
                    "name": kind.__name__,
                    "summary": (kind.__doc__ or "").strip(),
                    "payload": {"$ref": f"#/components/schemas/{kind.__name__}"},
                }
                for kind in kinds
            },
            "schemas": _schemas(),
        },
    }


@cache
def _schemas() -> Any:
    kinds: list[type[BaseModel]] = [*FROM_CLIENT, *TO_CLIENT, models.Picture]
    _, schemas = models_json_schema(
        [(kind, "serialization") for kind in kinds], by_alias=True, ref_template="#/components/schemas/{model}"
    )
    return schemas["$defs"]


def _message(kind: type[BaseModel]) -> dict[str, str]:
    return {"$ref": f"#/components/messages/{kind.__name__}"}


def _operation(action: str, channel: str, kinds: tuple[type[BaseModel], ...]) -> dict[str, Any]:
    return {
        "action": action,
        "channel": {"$ref": f"#/channels/{channel}"},
        "messages": [{"$ref": f"#/channels/{channel}/messages/{kind.__name__}"} for kind in kinds],
    }
