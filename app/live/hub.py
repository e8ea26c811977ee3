"""The hub: takes pictures in the surface thread, numbers them on the event loop, and wakes the clients that are due."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Protocol

from app.contract import Service
from app.live.messages import Resume
from app.live.stream import Stream, TrackFilter, View
from app.settings import Settings
from app.wire import Row, Wire, encode
from pipeline.picture import Alert, AlertChange, Picture

log = logging.getLogger(__name__)

RESUME_MARGIN_S = 10.0
"""A resumed client is served from this much before where it says it stood: a delta may come twice, is never missed."""

WAITING_CHANGES = 10_000
"""Alert changes kept before the event loop has started."""


RECENT_ALERTS = 1000
"""Alerts kept in memory: what a page asks for at most, several times over; some 2 kB each."""


class Follower(Protocol):
    """What the hub asks of a client. waiting_since: loop time at which the frame being written was begun, or None."""

    topics: frozenset[str]
    rate_hz: float
    waiting_since: float | None

    def due(self) -> None:
        """The client's rate allows a delta."""

    def alert(self, text: str) -> None:
        """Queue an alert message."""

    def begin_again(self, *, forget_alerts: bool) -> None:
        """The epoch changed. forget_alerts: alert messages that still wait are void."""

    def wake(self) -> None:
        """There is something to look at."""

    def end(self, code: int, reason: str) -> None:
        """Have the connection closed."""


class Hub:
    """One stream of pictures and alerts with `epoch` and `seq`, shared by all clients.

    `publish` and `begin_anew` may be called from any thread; everything else belongs to the event loop that called
    `start`.
    """

    def __init__(self, service: Service, settings: Settings) -> None:
        self.settings = settings
        self.wire = Wire(service.airport, settings.mode)
        self.epoch = secrets.token_hex(4)
        self.seq = 0
        self.clients: set[Follower] = set()
        self.counters: Counter[str] = Counter()
        self.picture: Picture | None = None
        self.picture_seq = 0
        keep = settings.feed.resume_s + RESUME_MARGIN_S
        self.stream = Stream(keep, settings.feed.max_filters)
        self._service = service
        self._lock = threading.Lock()
        self._newest: Picture | None = None
        self._changes: deque[AlertChange] = deque(maxlen=WAITING_CHANGES)
        self._scheduled = False
        self._anew = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._watch: asyncio.Task[None] | None = None
        self._alerts: deque[tuple[int, float, str]] = deque()
        self._last_tick: dict[float, float] = {}
        self._later: dict[float, asyncio.TimerHandle] = {}
        self._deltas: dict[tuple[TrackFilter, int], str] = {}
        self._snapshots: dict[TrackFilter, str] = {}
        self._document: tuple[int, bytes] | None = None
        self._status_key: Any = None
        self._status_at = 0.0
        self._status_text: str | None = None
        self.status_version = 0
        self.on_start: list[Callable[[], None]] = []
        """Called on the event loop when it begins."""
        self.on_picture: list[Callable[[Picture], None]] = []
        """Called on the event loop with every picture that is numbered."""
        self.recent: dict[int, Alert] = {}
        """The newest alerts of this run by id, as they are now, so that they are known without the database. Other
        threads may copy it."""

    def publish(self, picture: Picture, changes: tuple[AlertChange, ...]) -> None:
        """Take a new picture (a `PictureListener`); returns at once, never raises. The newest picture wins."""
        with self._lock:
            self._newest = picture
            self._changes.extend(changes)
            if self._scheduled or self._loop is None:
                return
            self._scheduled = True
            loop = self._loop
        try:
            loop.call_soon_threadsafe(self._take)
        except RuntimeError:  # the loop has been closed: the service is ending
            self._loop = None

    def begin_anew(self) -> None:
        """What was shown is void, as after a seek in a recording: the next picture begins a new epoch for all clients.

        To be called between the last picture of before and the first of after. Pictures and alert changes of before
        that no client has been told of yet are forgotten.
        """
        with self._lock:
            self._anew = True
            self._newest = None
            self._changes.clear()

    def start(self) -> None:
        """Begin on the running event loop."""
        loop = asyncio.get_running_loop()
        with self._lock:
            self._loop = loop
            self._changes = deque(self._changes)
            if self._newest is None:
                self._newest = self._service.picture()
            self._scheduled = True
        self._watch = loop.create_task(self._watch_clients(), name="feed-watch")
        self._take()
        for begin in self.on_start:
            begin()

    async def stop(self) -> None:
        """Close all clients (1001, going away) and end."""
        with self._lock:
            self._loop = None
        for timer in self._later.values():
            timer.cancel()
        if self._watch is not None:
            self._watch.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._watch
        for client in list(self.clients):
            client.end(1001, "the service is ending")
        for _ in range(20):
            if not self.clients:
                return
            await asyncio.sleep(0.05)

    def document(self) -> bytes | None:
        """The newest picture as JSON, encoded once; None before the first."""
        if self.picture is None:
            return None
        if self._document is None or self._document[0] != self.picture_seq:
            row = self.wire.picture(self.picture, self.epoch, self.picture_seq)
            self._document = (self.picture_seq, encode(row))
        return self._document[1]

    def rows(self) -> list[Row]:
        """The track rows of the newest picture."""
        self._follow(self.loop_time())
        return list(self.stream.rows.values())

    def welcome(self) -> Row:
        """What a client is told after its hello."""
        periods = [one.video.period_s for one in self._service.radars]
        return {
            "type": "welcome",
            "epoch": self.epoch,
            "seq": self.seq,
            "airport": self.wire.airport.icao,
            "period_s": min(periods, default=1.0),
            "server_time": time.time(),
            "schema": "1.0",
            "mode": self.settings.mode,
        }

    def view(self, filter: TrackFilter, instead_of: View | None = None) -> View:
        """The view of the newest picture through a filter. instead_of: what the client had. Raises TooManyViews."""
        now = self.loop_time()
        self._follow(now)
        return self.stream.view(filter, now, instead_of)

    def recover(self, resume: Resume, view: View) -> int | None:
        """The place from which a client can go on; None when it needs a snapshot."""
        if resume.epoch != self.epoch or resume.seq < view.since or resume.seq > self.seq:
            return None
        place = self.stream.place_before(resume.seq, min(RESUME_MARGIN_S, self.settings.feed.resume_s))
        return None if place is None else max(place, view.since)

    def alerts_after(self, seq: int) -> list[str]:
        """The alert messages after a place, in order."""
        return [text for at, _, text in self._alerts if at > seq]

    def snapshot_text(self, view: View) -> str:
        """The tracks of a view as a snapshot message, encoded once for all who need it."""
        text = self._snapshots.get(view.filter)
        if text is None:
            body = {**self._head("snapshot"), "topic": "tracks", "tracks": self.stream.snapshot(view), "final": True}
            text = self._snapshots[view.filter] = encode(body).decode()
        return text

    def delta_text(self, view: View, since: int) -> str:
        """What changed in a view, encoded once for all who stand at the same place."""
        key = (view.filter, since)
        text = self._deltas.get(key)
        if text is None:
            updated, added, deleted = self.stream.delta(view, since)
            body = {**self._head("delta"), "topic": "tracks", "prev": since}
            body |= {"del": deleted, "add": added, "upd": updated}
            text = self._deltas[key] = encode(body).decode()
            self.counters["deltas_encoded"] += 1
        return text

    def alerts_snapshot(self) -> str:
        """The live alerts as a snapshot message."""
        alerts = [self.wire.alert(one) for one in self.picture.alerts] if self.picture else []
        return encode({**self._head("snapshot"), "topic": "alerts", "alerts": alerts, "final": True}).decode()

    def status_text(self) -> str | None:
        """Sensors, runways and stage timings, encoded once a version."""
        if self._status_text is None and self.picture is not None:
            body = {
                **self._head("status"),
                "sensors": [self.wire.sensor(one) for one in self.picture.sensors],
                "runways": [self.wire.runway(one) for one in self.picture.runways],
                "timings_s": self.picture.timings,
            }
            self._status_text = encode(body).decode()
        return self._status_text

    def heartbeat_text(self, seq: int) -> str:
        """Sign of life for a client that stands at `seq`; `time` is that of the newest picture."""
        body = {"type": "heartbeat", "epoch": self.epoch, "seq": seq, "mode": self.settings.mode}
        return encode({**body, "time": self._picture_time(), "server_time": time.time()}).decode()

    def loop_time(self) -> float:
        """Seconds of the event loop's clock."""
        return asyncio.get_running_loop().time()

    def _head(self, type: str) -> Row:
        head = {"type": type, "epoch": self.epoch, "seq": self.stream.seq}
        return {**head, "time": self._picture_time(), "mode": self.settings.mode}

    def _picture_time(self) -> float | None:
        return self.picture.time if self.picture is not None else None

    def _take(self) -> None:
        with self._lock:
            self._scheduled = False
            picture, self._newest = self._newest, None
            changes = list(self._changes)
            self._changes.clear()
            anew = self._anew and picture is not None
            self._anew = self._anew and not anew
        now = self.loop_time()
        wound_back = picture is not None and self.picture is not None and picture.time < self.picture.time - 1.0
        if anew or wound_back:
            self._begin_epoch(forget_alerts=anew)
        for change in changes:
            self._alert(change, now)
        if picture is not None:
            self.seq += 1
            self.counters["pictures"] += 1
            self.picture, self.picture_seq = picture, self.seq
            if anew or wound_back:
                self._follow(now)
            self._tick(now)
            self._status(picture, now)
            for show in self.on_picture:
                show(picture)

    def _begin_epoch(self, *, forget_alerts: bool) -> None:
        """What clients hold is void (a seek, or time stepped back): all of them start again.

        forget_alerts: alert messages that clients have not taken yet are void too. Not when only the clock stepped
        back: then every alert is still true and none may be lost.
        """
        self.epoch = secrets.token_hex(4)
        self.stream = Stream(self.stream.keep_s, self.stream.max_views)
        if forget_alerts:
            self.recent.clear()
        self._alerts.clear()
        self._deltas.clear()
        self._snapshots.clear()
        self._status_key = None
        for client in self.clients:
            client.begin_again(forget_alerts=forget_alerts)

    def _alert(self, change: AlertChange, now: float) -> None:
        self.seq += 1
        self.counters["alert_changes"] += 1
        self.recent.pop(change.alert.id, None)
        self.recent[change.alert.id] = change.alert
        if len(self.recent) > RECENT_ALERTS:
            del self.recent[next(iter(self.recent))]
        body = {"type": "alert", "epoch": self.epoch, "seq": self.seq, "time": change.time, "mode": self.settings.mode}
        text = encode({**body, "op": change.operation, "alert": self.wire.alert(change.alert)}).decode()
        self._alerts.append((self.seq, now, text))
        while self._alerts and now - self._alerts[0][1] > self.stream.keep_s:
            self._alerts.popleft()
        for client in self.clients:
            if "alerts" in client.topics:
                client.alert(text)

    def _tick(self, now: float) -> None:
        due = set()
        for rate in {one.rate_hz for one in self.clients if "tracks" in one.topics}:
            last = self._last_tick.get(rate, 0.0)
            if now - last >= 0.9 / rate:
                self._last_tick[rate] = max(last + 1.0 / rate, now - 1.0 / rate)
                due.add(rate)
            elif rate not in self._later:  # too early: should no later picture come, this one is still sent
                wait = last + 1.2 / rate - now
                self._later[rate] = asyncio.get_running_loop().call_later(wait, self._tick_late, rate)
        if not due:
            return
        self._follow(now)
        for client in self.clients:
            if client.rate_hz in due and "tracks" in client.topics:
                client.due()

    def _tick_late(self, rate: float) -> None:
        self._later.pop(rate, None)
        self._tick(self.loop_time())

    def _follow(self, now: float) -> None:
        """Bring the rows up to the newest picture: only when somebody is due, so idle pictures cost nothing."""
        if self.picture is None or self.stream.seq == self.picture_seq:
            return
        tracks = self.picture.tracks
        self.stream.take(self.wire.tracks(tracks), tracks.born.tolist(), self.picture_seq, now)
        self._deltas.clear()
        self._snapshots.clear()

    def _status(self, picture: Picture, now: float) -> None:
        key = (picture.runways, tuple((one.id, one.status, one.detail) for one in picture.sensors))
        if key == self._status_key and now - self._status_at < 1.0:
            return
        self._status_key, self._status_at, self._status_text = key, now, None
        self.status_version += 1
        for client in self.clients:
            if "status" in client.topics:
                client.wake()

    async def _watch_clients(self) -> None:
        limit = self.settings.feed.lag_limit_s
        while True:
            await asyncio.sleep(min(0.5, limit / 4))
            now = self.loop_time()
            for client in list(self.clients):
                if client.waiting_since is not None and now - client.waiting_since > limit:
                    self.counters["closed_lagging"] += 1
                    client.end(1013, f"more than {limit:g} s behind")
