"""What the registry of parts holds, in words: each method with its settings, their types, defaults and meanings."""

from __future__ import annotations

import importlib
import re
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pipeline.parts import available

_JSON = {
    float: "number",
    int: "integer",
    bool: "boolean",
    str: "string",
    NoneType: "null",
    tuple: "array",
    list: "array",
}


@dataclass(frozen=True)
class Setting:
    """One setting of a part. type: as JSON names it. default: None when it has none. choices: the only values, where
    these are words. about: one line."""

    name: str
    type: str
    default: Any
    choices: tuple[str, ...]
    about: str


@dataclass(frozen=True)
class Method:
    """One part that can be chosen. about: the first paragraph of what is written about it."""

    name: str
    about: str
    settings: tuple[Setting, ...]


@cache
def methods(verb: str) -> tuple[Method, ...]:
    """All methods of a verb in order of their names. Raises PartError for a verb that does not exist."""
    return tuple(_method(name, kind) for name, kind in sorted(available(verb).items()))


def chosen(part: Any) -> dict[str, Any]:
    """A part as the settings would choose it: its name and every setting."""
    return {"name": name_of(part), **{one.name: getattr(part, one.name) for one in fields(part) if one.init}}


def name_of(part: Any) -> str:
    """The name of a part: that of its file."""
    return str(type(part).__module__.rpartition(".")[2])


def _method(name: str, kind: type[Any]) -> Method:
    written = importlib.import_module(kind.__module__).__doc__ or kind.__doc__ or ""
    meanings, types = _meanings(kind), get_type_hints(kind)
    settings = tuple(
        Setting(one.name, _type(types[one.name]), _default(one), _choices(types[one.name]), meanings.get(one.name, ""))
        for one in fields(kind)
        if one.init
    )
    return Method(name, " ".join(written.strip().split("\n\n")[0].split()), settings)


def _meanings(kind: type[Any]) -> dict[str, str]:
    """What the class's docstring says of each setting: "name: words.", or the first sentence that it is in."""
    text = " ".join((kind.__doc__ or "").split())
    one = rf"\b(?:{'|'.join(re.escape(field.name) for field in fields(kind)) or '(?!)'})\b"
    found = list(re.finditer(rf"(?<!\S)({one}(?:(?:, | and ){one})*): ", text))
    made: dict[str, str] = {}
    for k, match in enumerate(found):
        end = found[k + 1].start() if k + 1 < len(found) else len(text)
        words = re.split(r"(?<=[^.]\.) (?=[A-Z])", text[match.end() : end].strip())[0].rstrip(".; ")
        for name in re.findall(one, match[1]):
            made.setdefault(name, words)
    for sentence in re.split(r"(?<=[^.]\.) (?=[A-Z])", text):
        for name in re.findall(one, sentence):
            made.setdefault(name, sentence.rstrip("."))
    return made


def _type(declared: Any) -> str:
    if isinstance(declared, UnionType):
        return " or ".join(_type(one) for one in get_args(declared))
    if get_origin(declared) is Literal:
        return " or ".join(dict.fromkeys(_JSON.get(type(one), "object") for one in get_args(declared)))
    return _JSON.get(get_origin(declared) or declared, "object")


def _choices(declared: Any) -> tuple[str, ...]:
    if isinstance(declared, UnionType):
        return tuple(word for one in get_args(declared) for word in _choices(one))
    return tuple(str(one) for one in get_args(declared)) if get_origin(declared) is Literal else ()


def _default(field: Field[Any]) -> Any:
    if field.default is not MISSING:
        return field.default
    return field.default_factory() if field.default_factory is not MISSING else None
