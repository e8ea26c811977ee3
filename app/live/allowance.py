"""How often something may be asked for."""

from __future__ import annotations


class Allowance:
    """So many a second in the long run, and `burst` at once."""

    def __init__(self, per_s: float, burst: float) -> None:
        self._per_s, self._burst = per_s, burst
        self._left, self._at = burst, float("-inf")

    def take(self, now: float) -> float:
        """Take one at `now` (s, never earlier than before); what is left: below zero when there was none.

        What was asked for in vain counts too, so that it goes deeper below zero the longer it goes on.
        """
        gained = (now - self._at) * self._per_s
        self._left, self._at = min(self._burst, self._left + gained) - 1.0, now
        return self._left
