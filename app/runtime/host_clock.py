"""placeholder, replaced by branch clocks"""

from __future__ import annotations

import time


class HostClock:
    """The time of arrival."""

    def now(self) -> float:
        """UTC s."""
        return time.time()

    def take_step(self) -> float:
        """Seconds by which the clock was set since last asked."""
        return 0.0
