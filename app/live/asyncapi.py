"""The AsyncAPI document of the live feed."""

from __future__ import annotations

from typing import Any


def document(icao: str, version: str) -> dict[str, Any]:
    """The document for one airport."""
    return {"asyncapi": "3.0.0", "info": {"title": f"Airside live feed {icao}", "version": version}}
