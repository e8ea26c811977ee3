"""Pictures by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.picture import Alert, AlertTarget, Picture
from pipeline.tables import Tracks


def tracks(ids: list[int], **columns: Any) -> Tracks:
    """Tracks in a row to the east, 100 m apart, standing still unless said otherwise."""
    n = len(ids)
    state = np.zeros((n, 4))
    state[:, 0] = 100.0 * np.arange(n)
    given = {"state": state, "covariance": np.tile(np.eye(4), (n, 1, 1)), "phase": 1, **columns}
    return Tracks.build(n, id=ids, time=1000.0, **given)


def alert(
    targets: list[int], stage: str = "alarm", state: str = "new", runway: str | None = None, id: int = 1
) -> Alert:
    at = tuple(AlertTarget(one, None, None, "vehicle", 0.0, 0.0, 0.0, None) for one in targets)
    return Alert(id, "hold_entry", stage, state, "text", 1000.0, 1000.0, at, runway=runway)  # type: ignore[arg-type]


def picture(table: Tracks, *alerts: Alert) -> Picture:
    return Picture(time=1000.0, tracks=table, alerts=alerts)
