"""The stream of track rows: which field changed at which place, so that a delta from any place can be made at any time.

Nothing is queued for a client: what is pending for it is the difference between where it stands and now, in which the
latest value wins by itself. A resumed client and a slow one are served by the same arithmetic.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from app.wire import Row

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class TrackFilter:
    """Which tracks a client wants. classes: empty for all. bbox: west, south, east, north in degrees; None for all."""

    classes: frozenset[str] = frozenset()
    bbox: Box | None = None

    def admits(self, row: Row) -> bool:
        """The row is wanted. A track without position is inside no box."""
        if self.classes and row["class"] not in self.classes:
            return False
        if self.bbox is None:
            return True
        west, south, east, north = self.bbox
        latitude, longitude = row["lat"], row["lon"]
        return latitude is not None and west <= longitude <= east and south <= latitude <= north


@dataclass
class View:
    """One filter's members, and when each came and went. since: the place at which the view began to be kept."""

    filter: TrackFilter
    since: int
    entered: dict[int, int] = field(default_factory=dict)
    left: deque[tuple[int, float, int, str]] = field(default_factory=deque)
    looked: int = -1
    clients: int = 0
    idle_since: float = 0.0


class TooManyViews(ValueError):
    """No further filter can be kept."""


class Stream:
    """All track rows with the place (`seq`) of every change. For one thread, the event loop's.

    keep_s: how long what was is remembered. max_views: views that clients have at a time, besides that of everything,
    and as many that none has any more.
    """

    def __init__(self, keep_s: float, max_views: int = 100) -> None:
        self.keep_s = keep_s
        self.max_views = max_views
        self.seq = 0
        self.rows: dict[int, Row] = {}
        self._changed: dict[int, dict[str, int]] = {}
        self._added: dict[int, int] = {}
        self._born: dict[int, float] = {}
        self._places: deque[tuple[int, float]] = deque()
        self._views: dict[TrackFilter, View] = {}
        self.view(TrackFilter()).clients = 1  # the view of everything is kept for ever, so that it can be resumed

    def take(self, rows: Iterable[Row], born: Iterable[float], seq: int, now: float) -> None:
        """Take the rows of a new picture. born: first measurement of each; another birth is a new track."""
        seen: set[int] = set()
        for row, birth in zip(rows, born, strict=True):
            id = row["id"]
            seen.add(id)
            old = self.rows.get(id)
            if old is None or self._born[id] != birth:
                self._added[id] = seq
                self._born[id] = birth
                self._changed[id] = dict.fromkeys(row, seq)
            else:
                changed = self._changed[id]
                for name, value in row.items():
                    if old[name] != value:
                        changed[name] = seq
            self.rows[id] = row
        for id in self.rows.keys() - seen:
            del self.rows[id], self._changed[id], self._added[id], self._born[id]
        self.seq = seq
        self._places.append((seq, now))
        while self._places and now - self._places[0][1] > self.keep_s:
            self._places.popleft()
        for view in self._views.values():
            if view.clients:
                self._look(view, now)
        for key in [k for k, v in self._views.items() if not v.clients and now - v.idle_since > self.keep_s]:
            del self._views[key]

    def view(self, filter: TrackFilter, now: float = 0.0, instead_of: View | None = None) -> View:
        """The view with this filter, kept from now on if it was not; one and the same for equal filters.

        instead_of: a view that who asks is about to leave. Raises TooManyViews.
        """
        found = self._views.get(filter)
        if found is None or not found.clients:
            used = sum(one.clients > (one is instead_of) for one in self._views.values())
            if used > self.max_views:
                raise TooManyViews(
                    f"{self.max_views} different filters are in use, which is the limit: take one of them, or none"
                )
        if found is None:
            found = self._views[filter] = View(filter, self.seq)
            found.idle_since = now
            self._forget_idle(found)
        self._look(found, now)
        return found

    def _forget_idle(self, fresh: View) -> None:
        """Drop the views that are idle for longest until no more than `max_views` are left besides a new one."""
        idle = [one for one in self._views.values() if not one.clients and one is not fresh]
        idle.sort(key=lambda one: one.idle_since)
        for one in idle[: max(0, len(idle) - self.max_views)]:
            del self._views[one.filter]

    def snapshot(self, view: View) -> list[Row]:
        """All rows of a view."""
        return [self.rows[id] for id in view.entered]

    def delta(self, view: View, since: int) -> tuple[list[Row], list[Row], list[Row]]:
        """What changed in a view after `since`: (updated: id and changed fields, added: whole rows, deleted).

        To be applied in the order deleted, added, updated.
        """
        updated: list[Row] = []
        added: list[Row] = []
        for id, entered in view.entered.items():
            row = self.rows[id]
            if entered > since:
                added.append(row)
                continue
            changes = {name: row[name] for name, at in self._changed[id].items() if at > since}
            if changes:
                updated.append({"id": id, **changes})
        gone = {id: reason for seq, _, id, reason in view.left if seq > since}
        return updated, added, [{"id": id, "reason": reason} for id, reason in gone.items()]

    def place_before(self, seq: int, margin_s: float) -> int | None:
        """A place at least `margin_s` before `seq`; None when `seq` is no longer (or was never) remembered."""
        if not self._places or seq < self._places[0][0] or seq > self.seq + 1_000_000:
            return None
        at = next((time for place, time in reversed(self._places) if place <= seq), None)
        if at is None:
            return None
        return next((place for place, time in reversed(self._places) if time <= at - margin_s), self._places[0][0])

    def _look(self, view: View, now: float) -> None:
        if view.looked == self.seq:
            return
        for id in list(view.entered):
            row = self.rows.get(id)
            if row is None or self._added[id] > view.entered[id]:
                view.left.append((self.seq, now, id, "ended"))
                del view.entered[id]
            elif not view.filter.admits(row):
                view.left.append((self.seq, now, id, "filter"))
                del view.entered[id]
        for id, row in self.rows.items():
            if id not in view.entered and view.filter.admits(row):
                view.entered[id] = self.seq
        while view.left and now - view.left[0][1] > self.keep_s:
            view.left.popleft()
        view.looked = self.seq
