"""What a classification does: tell aircraft from vehicles."""

from __future__ import annotations

from typing import Protocol

from pipeline.tables.arrays import Array


class ClassifyPart(Protocol):
    """Tells aircraft from vehicles."""

    def __call__(
        self, category: Array, claimed: Array, length: Array, width: Array, speed: Array, measurements: Array
    ) -> Array:
        """The new category (n,) uint8 of each track from its old one, what reports claim, and what radar saw."""
