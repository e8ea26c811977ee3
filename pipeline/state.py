"""State of a part as explicit arrays: what a chain must remember, saved and restored without pickling code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray


class StateError(ValueError):
    """A saved state does not belong to this part, these settings or this video format."""


def remembered() -> Any:
    """Declare a field of an ArrayState that save() and restore() carry; its shape is fixed when the state is made."""
    return field(metadata={"remembered": True})


@dataclass(eq=False)
class ArrayState:
    """Mutable arrays, changed in place by the part that made them. Fields declared with remembered() are saved.

    The other fields follow from settings and format; start() makes them anew. Picklable.
    """

    def save(self) -> dict[str, NDArray[Any]]:
        """Copies of all remembered arrays by name (fit for `numpy.savez`)."""
        return {name: getattr(self, name).copy() for name in self._names()}

    def restore(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Take up a saved state. Raises StateError, changing nothing, when names, dtypes or shapes differ."""
        for name in self._names():
            mine, given = getattr(self, name), saved.get(name)
            if given is None:
                raise StateError(f"the saved state has no {name!r}")
            if given.dtype != mine.dtype or given.shape != mine.shape:
                raise StateError(
                    f"{name}: {mine.dtype} {mine.shape} wanted, {given.dtype} {given.shape} saved;"
                    " the video format or the settings have changed"
                )
        self.refuse_untrue(saved)
        unknown = set(saved) - set(self._names())
        if unknown:
            raise StateError(f"the saved state has unknown {', '.join(sorted(unknown))}")
        for name in self._names():
            getattr(self, name)[...] = saved[name]

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError for values that would do harm, such as an index out of bounds; dtypes and shapes are right.

        A state that keeps indices overrides this.
        """

    def _names(self) -> list[str]:
        return [f.name for f in fields(self) if f.metadata.get("remembered")]


def read_only(array: NDArray[Any], dtype: Any = None) -> NDArray[Any]:
    """A C-ordered view that cannot be written: one numba signature whether the caller's array was writable or not."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view
