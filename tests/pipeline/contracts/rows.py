"""What the suites of the tracker's parts hand to them: a small store of track rows, measurements and covariances."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.contracts.filter import FilterPart, Moments, Prior, record_of
from pipeline.contracts.measured import Hypotheses, Measured

T0 = 1_700_000_000.0
"""UTC s, as large as it is in service: parts that lose digits of it show it."""


class TrackRows:
    """The store that a filter sees: records of its own columns, and the times they belong to."""

    def __init__(self, part: FilterPart, capacity: int) -> None:
        self.filter = np.zeros(capacity, record_of(part.columns))
        for name, column in part.columns.items():
            self.filter[name] = column.fill
        self.time = np.full(capacity, -np.inf)

    def image(self) -> tuple[bytes, bytes]:
        return self.filter.tobytes(), self.time.tobytes()


def spread(rng: np.random.Generator, n: int, dim: int) -> np.ndarray[Any, Any]:
    """Random covariances (n, dim, dim)."""
    a = rng.normal(size=(n, dim, dim))
    return a @ a.transpose(0, 2, 1) + 0.5 * np.eye(dim)


def plots_at(time: Any, position: Any, sd: float = 1.0, **columns: Any) -> Measured:
    """Measurements of positions (m, 2) with the same noise in every direction."""
    place = np.asarray(position, float).reshape(-1, 2)
    noise = np.tile(sd**2 * np.eye(2), (len(place), 1, 1))
    return Measured.of(np.broadcast_to(np.asarray(time, float), len(place)).copy(), place, noise, **columns)


def prior(velocity: Any, sd: float, known: bool = True) -> Prior:
    """The velocities (n, 2) held of new tracks, each component with a standard deviation of `sd` m/s."""
    held = np.asarray(velocity, float).reshape(-1, 2)
    return Prior(held, np.tile(sd**2 * np.eye(2), (len(held), 1, 1)), np.full(len(held), known))


def sets(*tracks: Any) -> Hypotheses:
    """Hypotheses of each track, given as a list of (plots, weight)."""
    flat = [one for track in tracks for one in track]
    return Hypotheses(
        np.cumsum([0] + [len(track) for track in tracks]).astype(np.int32),
        np.cumsum([0] + [len(plots) for plots, _ in flat]).astype(np.int32),
        np.array([plot for plots, _ in flat for plot in plots], np.int32),
        np.log([weight for _, weight in flat]),
    )


def on_ground(moments: Moments) -> tuple[np.ndarray, np.ndarray]:
    """East, north and their rates: mean (n, 4) and covariance (n, 4, 4), of a filter of two or three dimensions."""
    d = moments.mean.shape[1] // 2
    own = [0, 1, d, d + 1]
    return moments.mean[:, own], moments.covariance[:, own][:, :, own]
