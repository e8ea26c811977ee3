"""The commented settings file, made from the settings' own declarations.

Prose stands behind "# ", a setting that may be used by removing one sign behind "#" alone.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from types import NoneType
from typing import Any, get_args

from pydantic import BaseModel, Secret, SecretStr
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from app.settings import NodeSettings, PartSettings, PartsSettings, RadarSettings, RunwaySettings, Settings
from pipeline import parts

EXAMPLES: dict[str, Any] = {
    "radars.id": "smr1",
    "radars.latitude": 48.7233,
    "radars.longitude": 2.3794,
    "nodes.id": "n1",
    "nodes.latitude": 48.7240,
    "nodes.longitude": 2.3700,
    "runways.id": "06/24",
}
LISTS: dict[str, tuple[type[BaseModel], str]] = {
    "radars": (RadarSettings, "one table for each radar"),
    "nodes": (NodeSettings, "one table for each geomagnetic node in the pavement"),
    "runways": (RunwaySettings, "how a runway is used at start; later through the display or the API"),
}


def settings_file() -> str:
    """The whole file as TOML text. It loads as it is (all defaults), and with every "#key" line made active."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield "# Airside settings. Everything is shown with its default; remove the # in front of what you change."
    yield "# Environment variables go over this file: AIRSIDE_PORT=8080, AIRSIDE_DEMO__SEED=2."
    yield ""
    sections: list[tuple[str, type[BaseModel]]] = []
    for name, field in Settings.model_fields.items():
        if name in LISTS or name == "parts":
            continue
        if isinstance(field.default, BaseModel):
            sections.append((name, type(field.default)))
        else:
            yield from _setting(name, field, name)
    for name, model in sections:
        yield from ("", *_prose(model.__doc__), f"[{name}]")
        yield from _table(name, model, "")
    for name, (model, meaning) in LISTS.items():
        yield from ("", f"# {meaning}", f"#[[{name}]]")
        yield from _table(name, model)
    yield from _parts()


def _table(name: str, model: type[BaseModel], sign: str = "#") -> Iterator[str]:
    """The settings of a table and the tables in it. sign: before the heads of those."""
    inner: list[tuple[str, type[BaseModel]]] = []
    for key, field in model.model_fields.items():
        if isinstance(field.default, BaseModel):
            inner.append((key, type(field.default)))
        else:
            yield from _setting(key, field, f"{name}.{key}")
    for key, one in inner:
        yield from (*_prose(one.__doc__), f"{sign}[{name}.{key}]")
        for below, field in one.model_fields.items():
            yield from _setting(below, field, f"{name}.{key}.{below}")


def _parts() -> Iterator[str]:
    yield from ("", "# The methods, one a stage; `airside parts` tells what there is and what each setting means.")
    defaults = PartsSettings()
    for verb in PartsSettings.model_fields:
        chosen = getattr(defaults, verb)
        if isinstance(chosen, PartSettings):
            yield from ("", f"[parts.{verb}]", *_part(verb, chosen))
            continue
        for one in chosen:
            yield from ("", f"[[parts.{verb}]]", *_part(verb, one))


def _part(verb: str, chosen: PartSettings) -> Iterator[str]:
    yield f"name = {toml_value(chosen.name)}"
    kind = parts.available(verb).get(chosen.name)
    for field in fields(kind) if kind is not None else ():
        value = chosen.settings().get(field.name, getattr(parts.build(verb, chosen.name), field.name))
        if field.init and value is not None and is_toml(value):
            yield f"#{field.name} = {toml_value(value)}"


def _setting(key: str, field: FieldInfo, path: str) -> Iterator[str]:
    default = EXAMPLES.get(path, field.default)
    notes = [field.description] if field.description else []
    choices = [one for one in get_args(field.annotation) if isinstance(one, str)]
    if choices:
        notes.append("one of " + ", ".join(toml_value(one) for one in choices))
    if default is None or default is PydanticUndefined:
        notes.append("not set by default")
        default = _stand_in(field.annotation)
    if isinstance(default, Secret | SecretStr):
        default = str(default)
    yield from _prose("; ".join(notes))
    yield f"#{key} = {toml_value(default)}"


def _stand_in(annotation: Any) -> Any:
    kinds = [one for one in (annotation, *get_args(annotation)) if one is not NoneType and isinstance(one, type)]
    return next((one() for one in kinds if one in (str, int, float, bool)), "")


def _prose(text: str | None) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(" ".join((text or "").split()), 110)]


def is_toml(value: Any) -> bool:
    """Whether the value can stand in a TOML file."""
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and is_toml(one) for key, one in value.items())
    if isinstance(value, list | tuple):
        return all(is_toml(one) for one in value)
    return isinstance(value, bool | int | float | str | Path)


def toml_value(value: Any) -> str:
    """A value as TOML writes it. Raises TypeError for what TOML cannot hold."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml_value(one)}" for key, one in value.items()) + " }"
    raise TypeError(f"{type(value).__name__} does not fit into TOML")
