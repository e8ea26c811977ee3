"""What is wrong with settings, in one line a fault that names the nearest right key."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel


def explain(fault: Any, where: str, model: type[BaseModel]) -> str:
    """One fault of a pydantic ValidationError in words. where: the file or "environment"; model: of all settings."""
    place = ".".join(str(one) for one in fault["loc"])
    if fault["type"] == "extra_forbidden":
        known = _known_keys(model, fault["loc"][:-1])
        return f"{where}: {place} is not a setting{nearest(str(fault['loc'][-1]), known)}"
    return f"{where}: {place}: {fault['msg']}"


def nearest(word: str, among: Iterable[str]) -> str:
    """A "; did you mean ...?" with the most similar word, or nothing."""
    close = difflib.get_close_matches(word, list(among), n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else ""


def _known_keys(whole: type[BaseModel], loc: tuple[Any, ...]) -> list[str]:
    model: Any = whole
    for step in loc:
        if isinstance(step, int) or not hasattr(model, "model_fields") or step not in model.model_fields:
            continue
        model = model_in(model.model_fields[step].annotation)
    return list(getattr(model, "model_fields", {}))


def model_in(annotation: Any) -> Any:
    """The table of settings in a type annotation; None when there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for one in getattr(annotation, "__args__", ()):
        found = model_in(one)
        if found is not None:
            return found
    return None
