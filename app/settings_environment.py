"""Which environment variables are settings: compose and Kubernetes add others under the same prefix."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from app.settings_faults import model_in, nearest

PREFIX = "AIRSIDE_"
BETWEEN = "__"
"""Between the name of a table and of the setting in it."""

NOT_SETTINGS = frozenset({
    "AIRSIDE_SETTINGS", "AIRSIDE_REQUIRE_SERVICES", "AIRSIDE_COMMAND", "AIRSIDE_PUBLISH", "AIRSIDE_RADAR_PUBLISH",
    "AIRSIDE_SHIPPED_KERNELS",
})  # fmt: skip
"""Variables of the command line, the tests, compose.yaml and the image."""


def strays(variables: Mapping[str, str | None], model: type[BaseModel]) -> dict[str, str]:
    """Variables of this prefix that set nothing, each with the reason in words. model: of all settings."""
    found: dict[str, str] = {}
    for name, value in variables.items():
        if not name.upper().startswith(PREFIX) or name.upper() in NOT_SETTINGS:
            continue
        steps = name[len(PREFIX) :].lower().split(BETWEEN)
        if not _is_setting(steps, model):
            hint = nearest(name.upper(), _names(model, steps)) if len(steps[0]) > 1 else ""
            found[name] = f"is not a setting{hint}"
        elif steps == ["port"] and value is not None and "://" in value:
            found[name] = "is an address that Kubernetes gives to a service of this name, not a port"
    return found


def _is_setting(steps: list[str], model: Any) -> bool:
    for step in steps:
        if model is None or model.model_config.get("extra") == "allow":
            return model is not None
        if step not in model.model_fields:
            return False
        model = model_in(model.model_fields[step].annotation)
    return True


def _names(model: Any, steps: list[str]) -> Iterator[str]:
    """Names near to the one that these steps stand for: of the table that the last step is looked for in."""
    before = PREFIX
    for step in steps[:-1]:
        if model is None or step not in model.model_fields:
            return
        model, before = model_in(model.model_fields[step].annotation), f"{before}{step.upper()}{BETWEEN}"
    yield from (f"{before}{one.upper()}" for one in (model.model_fields if model is not None else ()))
