"""What a filter does: states and covariances forward in time, and corrected by measurements."""

from __future__ import annotations

from typing import Protocol

from pipeline.tables.arrays import Floats


class FilterPart(Protocol):
    """Estimates (east, north, v_east, v_north)."""

    def predict(self, state: Floats, covariance: Floats, dt: Floats) -> tuple[Floats, Floats]:
        """Move states by dt seconds (may be negative)."""

    def update(
        self, state: Floats, covariance: Floats, dt: Floats, position: Floats, noise: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Predict and take positions: state, covariance, normalised innovation squared."""
