"""What a restart has done to the alerts, for those who watch the displays."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime

from app.wire import Row
from pipeline.picture import SensorState

TOLD_S = 600.0
"""So long after the start it is told: a conflict that goes on has been raised again well before."""

NAMED_AT_MOST = 5
"""Acknowledged alerts that are named singly."""


class RestartNote:
    """alerts: those that were open when the service last ended, as they were stored; they begin anew."""

    def __init__(self, alerts: Sequence[Row], clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._at = clock()
        self.words = _words(alerts, self._at) if alerts else ""

    def state(self) -> SensorState | None:
        """What operators must know; None when nothing was open, and later than TOLD_S."""
        if not self.words or self._clock() - self._at > TOLD_S:
            return None
        return SensorState("restart", "store", "degraded", self._at, detail=self.words)


def _words(alerts: Sequence[Row], at: float) -> str:
    when = datetime.fromtimestamp(at, UTC).strftime("%H:%M:%S UTC")
    many = "1 alert that was open begins" if len(alerts) == 1 else f"{len(alerts)} alerts that were open begin"
    told = f"the service was restarted at {when}: {many} anew, with another number and not acknowledged"
    named = [one for one in alerts if one.get("acknowledged_by")]
    if not named:
        return told
    names = [f"{one['runway'] or 'no runway'} by {one['acknowledged_by']}" for one in named[:NAMED_AT_MOST]]
    more = len(named) - len(names)
    return f"{told}; acknowledged before: {', '.join(names)}{f' and {more} more' if more else ''}"
