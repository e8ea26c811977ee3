"""Whether a saved state has the form that this version of the program gives to its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np


def other_form(saved: Any, own: Any, path: str = "") -> str | None:
    """The first place where `saved` is built otherwise than `own`, in words; None when it is built alike.

    own: a state that this version made. Compares the names in mappings, the classes of values, and the dtypes and row
    shapes of arrays; never numbers, texts, lengths, or what stands where `own` is empty or None. A column of shorter
    texts fits one of longer texts. In lists and tuples the members that both have are compared in pairs.
    """
    if own is None or saved is None:
        return None
    if isinstance(own, Mapping) and isinstance(saved, Mapping):
        return _mapping(saved, own, path)
    if isinstance(own, np.ndarray) and isinstance(saved, np.ndarray):
        return _array(saved, own, path)
    if isinstance(own, int | float) and isinstance(saved, int | float):
        return None
    if type(saved) is not type(own):
        return f"{path or 'the state'} is of the class {type(saved).__name__}, here {type(own).__name__}"
    if dataclasses.is_dataclass(own):
        names = [one.name for one in dataclasses.fields(own)]
        return _first((f"{path}.{name}", getattr(saved, name), getattr(own, name)) for name in names)
    if isinstance(own, list | tuple):
        return _first((f"{path}[{place}]", *pair) for place, pair in enumerate(zip(saved, own, strict=False)))
    return None


def _mapping(saved: Mapping[Any, Any], own: Mapping[Any, Any], path: str) -> str | None:
    if not own:
        return None
    for name in own:
        if name not in saved:
            return f"{_inside(path, name)} is missing"
    for name in saved:
        if name not in own:
            return f"{_inside(path, name)} is not known here"
    return _first((_inside(path, name), saved[name], own[name]) for name in own)


def _array(saved: np.ndarray[Any, Any], own: np.ndarray[Any, Any], path: str) -> str | None:
    texts = saved.dtype.kind == own.dtype.kind == "U" and saved.dtype <= own.dtype
    if (texts or saved.dtype == own.dtype) and saved.shape[1:] == own.shape[1:] and saved.ndim == own.ndim:
        return None
    return f"{path} has rows of {saved.dtype} {list(saved.shape[1:])}, here {own.dtype} {list(own.shape[1:])}"


def _first(places: Any) -> str | None:
    return next((found for path, saved, own in places if (found := other_form(saved, own, path)) is not None), None)


def _inside(path: str, name: Any) -> str:
    return f"{path}.{name}" if path else str(name)
