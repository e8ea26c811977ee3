"""What of a radar's datagrams is refused lately, in words for the status and, once a minute, for the log."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping

from pipeline.assemble.refusal import Refusals

log = logging.getLogger(__name__)

WINDOW_S = 10.0
"""The status tells of a refusal for this long after it, and takes a radar for heard this long after a sweep."""

WORDS_EVERY_S = 2.0
"""The words change at most this often: every new word is stored and sent."""

LOG_EVERY_S = 60.0
"""The log tells of refusals at most this often."""

MISFITS = ("wrong_geometry", "wrong_cell_count", "wrong_source")
"""Counters of messages that could be read and do not fit; `Refusals` has the words for them."""

UNREADABLE = {
    "malformed": "octets that break the rules of CAT240",
    "wrong_category": "blocks of other categories than 240",
    "compressed": "video that is compressed in an unknown way",
    "truncated": "datagrams that are too long",
    "refused_source": "datagrams from addresses that `sources` does not name",
}
"""Counters of datagrams that cannot be read, and the words for them."""

REFUSED, IN_PART = "refused: ", "refused in part: "


class RefusedVideo:
    """Watches the counters of one radar, which only grow. `note` is called by its thread, the rest by anybody."""

    def __init__(self, radar: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._radar, self._clock = radar, clock
        self._lock = threading.Lock()
        self._seen: dict[str, int] = {}
        self._since_log = 0
        self._why, self._several, self._stranger = "", "", ""
        self._stranger_at = float("-inf")
        self._refused_at = self._misfit_at = self._taken_at = self._why_at = self._logged_at = float("-inf")

    def note(self, counters: Mapping[str, int], refusals: Refusals, stranger: str = "") -> None:
        """Look at the counters, after each batch of datagrams. stranger: the newest address that is not allowed."""
        grown = {name: counters.get(name, 0) - self._seen.get(name, 0) for name in (*MISFITS, *UNREADABLE, "sweeps")}
        self._seen = {name: counters.get(name, 0) for name in grown}
        now = self._clock()
        with self._lock:
            if grown.pop("sweeps"):
                self._taken_at = now
            if any(grown.values()):
                self._refused_at = now
                self._since_log += sum(grown.values())
                if grown["wrong_geometry"] or grown["wrong_cell_count"]:
                    self._misfit_at = now
            if grown["refused_source"]:
                self._stranger_at = now
            due = now - self._why_at >= WORDS_EVERY_S
            self._stranger = stranger if due or not self._stranger else self._stranger
            if due:
                self._say(now, grown, refusals)
            words = self._words(now) or self._left_out(now)
            if words and now - self._logged_at >= LOG_EVERY_S:
                log.warning("radar %s: %d messages %s", self._radar, self._since_log, words)
                self._logged_at, self._since_log = now, 0

    def words(self) -> str:
        """What is refused, for a person; empty when nothing is, or only what was not asked for."""
        with self._lock:
            return self._words(self._clock())

    def left_out(self) -> str:
        """Whose datagrams are left out beside those that are taken, for a person; no fault of the radar."""
        with self._lock:
            return self._left_out(self._clock())

    def _left_out(self, now: float) -> str:
        strangers = now - self._stranger_at <= WINDOW_S and now - self._taken_at <= WINDOW_S
        return f"datagrams from {self._stranger} are left out: not among sources" if strangers else ""

    def _say(self, now: float, grown: Mapping[str, int], refusals: Refusals) -> None:
        unreadable = [words for name, words in UNREADABLE.items() if grown[name]]
        if grown["refused_source"]:
            unreadable[-1] = f"datagrams from {self._stranger}, which is not among sources"
        why = refusals.words() or " and ".join(unreadable)
        if why:
            self._why, self._why_at = why, now
            refusals.forget_newest()
        self._several = refusals.several()

    def _words(self, now: float) -> str:
        taken = now - self._taken_at <= WINDOW_S
        if not taken and now - self._refused_at <= WINDOW_S:
            return REFUSED + self._why
        said = []
        if self._several and taken:
            said.append(f"video of {self._several} comes in, one of them is taken: set sac and sic")
        if now - self._misfit_at <= WINDOW_S:
            said.append(IN_PART + self._why)
        return "; ".join(said)


def refusal_in(detail: str) -> str:
    """What the detail of a radar's state says of refused video; empty when it says nothing of it."""
    for mark in (REFUSED, IN_PART):
        if mark in detail:
            return detail[detail.index(mark) :]
    return ""
