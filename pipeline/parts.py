"""The registry of parts: a folder is a verb, a file in it is a method, and its name is what the settings say.

A part is a frozen dataclass: its fields are its settings, its methods are its work. It is found by importing the folder
and taking the class that the module names in `PART`. To add a method is to add a file.
"""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, get_args, get_type_hints

MOST = 2.0**53
"""No number among the settings is greater: up to here whole numbers and floating point are the same."""

VERBS = ("detect", "extract", "bearing", "associate", "filter", "lifecycle", "classify", "alert")
"""The folders of `pipeline` that hold parts."""


class PartError(ValueError):
    """The settings name a part or a setting that does not exist, or give it a wrong value."""


@cache
def available(verb: str) -> dict[str, type[Any]]:
    """All methods of a verb by name. Raises PartError for a verb that does not exist."""
    if verb not in VERBS:
        raise PartError(f"no kind of part is called {verb!r}{_nearest(verb, VERBS)}")
    package = importlib.import_module(f"pipeline.{verb}")
    found: dict[str, type[Any]] = {}
    for module in pkgutil.iter_modules(package.__path__):
        part = getattr(importlib.import_module(f"pipeline.{verb}.{module.name}"), "PART", None)
        if part is not None:
            found[module.name] = part
    return found


def build(verb: str, name: str, settings: Mapping[str, Any] | None = None) -> Any:
    """The part called `name`, with its settings. Raises PartError, naming the nearest right word."""
    known = available(verb)
    if name not in known:
        raise PartError(f"no {verb} part is called {name!r}{_nearest(name, known)}")
    kind = known[name]
    if not is_dataclass(kind):
        raise PartError(f"{verb} part {name!r} is not a dataclass")
    allowed = [f.name for f in fields(kind)]
    kinds = get_type_hints(kind)
    given = dict(settings or {})
    for key, value in given.items():
        if key not in allowed:
            raise PartError(f"{verb} part {name!r} has no setting {key!r}{_nearest(key, allowed)}")
        given[key] = _of_type(value, kinds[key], f"{verb} part {name!r}: {key}")
    try:
        return kind(**given)
    except (TypeError, ValueError, OverflowError) as error:
        raise PartError(f"{verb} part {name!r}: {error}") from error


def _of_type(value: Any, wanted: Any, what: str) -> Any:
    """The value, where its type is a plain one: an integer also serves as a number. Raises PartError."""
    _check_numbers(value, what)
    kinds = get_args(wanted) if isinstance(wanted, UnionType) else (wanted,)
    if not set(kinds) <= {bool, int, float, str, NoneType} or type(value) in kinds:
        return value
    if float in kinds and type(value) is int:
        return float(value)
    names = " or ".join("none" if kind is NoneType else kind.__name__ for kind in kinds)
    raise PartError(f"{what} must be {names}, not {value!r}")


def _check_numbers(value: Any, what: str) -> None:
    """Raises PartError for a number that is not finite, or so large that no setting means it."""
    if isinstance(value, list | tuple):
        for one in value:
            _check_numbers(one, what)
    elif isinstance(value, int | float) and not -MOST <= value <= MOST:
        raise PartError(f"{what} must be a finite number, {MOST:.0e} at most")


def _nearest(word: str, among: Any) -> str:
    close = difflib.get_close_matches(word, list(among), n=1, cutoff=0.4)
    choices = ", ".join(sorted(among))
    return f"; did you mean {close[0]!r}?" if close else f"; there are: {choices}"
