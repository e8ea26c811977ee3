"""The bus between processes: nothing by default, NATS when pictures and alerts are to leave this one.

Subjects: `airside.<icao>.picture` (core NATS, newest wins) and `airside.<icao>.alert` (JetStream, acknowledged by the
server, kept and tried again until it is). The bodies are those of GET /api/v1/picture and of the feed's alert messages.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import threading
from collections import Counter, deque
from typing import Any, Protocol
from urllib.parse import urlsplit

from app.contract import Service
from app.secret_urls import masked_text
from app.wire import Wire, encode
from pipeline.picture import AlertChange, Picture

log = logging.getLogger(__name__)

PICTURE_EVERY_S = 0.25
RETRY_S = 2.0
STREAM_AGE_S = 7 * 86400
WAITING_ALERTS = 100_000


class Bus(Protocol):
    """Something that is fed with pictures and must be closed."""

    def counters(self) -> dict[str, int]:
        """What was published; they only grow."""

    def close(self) -> None:
        """End, giving alerts that wait a last chance."""


class MemoryBus:
    """`memory://`: one process, nothing leaves it."""

    def counters(self) -> dict[str, int]:
        """Nothing is published."""
        return {}

    def close(self) -> None:
        """Nothing to do."""


class NatsBus:
    """`nats://host:port`: publishes from a thread of its own, so that a slow server delays nothing."""

    def __init__(self, url: str, service: Service) -> None:
        self._url = url
        self.shown = masked_text(url)
        self.icao = service.airport.icao
        self._wire = Wire(service.airport, service.settings.mode)
        self._epoch = secrets.token_hex(4)
        self._counts: Counter[str] = Counter(pictures=0, alerts=0, retries=0)
        self._seq = 0
        self._lock = threading.Lock()
        self._picture: tuple[int, Picture] | None = None
        self._alerts: deque[tuple[int, AlertChange]] = deque(maxlen=WAITING_ALERTS)
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self._thread.start()
        self._unlisten = service.listen(self.publish)

    def publish(self, picture: Picture, changes: tuple[AlertChange, ...]) -> None:
        """Take a picture (a `PictureListener`): the newest wins, no alert change is left out."""
        with self._lock:
            for change in changes:
                self._seq += 1
                if len(self._alerts) == WAITING_ALERTS:
                    self._counts["alerts_dropped"] += 1
                self._alerts.append((self._seq, change))
            self._seq += 1
            self._picture = (self._seq, picture)

    def counters(self) -> dict[str, int]:
        """What was published."""
        return dict(self._counts)

    def close(self) -> None:
        """Publish the alerts that wait, if the server takes them within a few seconds, and end."""
        self._unlisten()
        self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(10.0)

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except Exception:
            log.exception("the bus has ended")
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        import nats

        # The client tries for ever by itself; only the end of the service ends that.
        connecting = asyncio.create_task(
            nats.connect(self._url, max_reconnect_attempts=-1, reconnect_time_wait=RETRY_S, error_cb=self._complain)
        )
        closing = asyncio.create_task(self._closing.wait())
        await asyncio.wait((connecting, closing), return_when=asyncio.FIRST_COMPLETED)
        if not connecting.done():
            connecting.cancel()
            await asyncio.gather(connecting, return_exceptions=True)
            return
        closing.cancel()
        client: Any = connecting.result()
        try:
            stream = client.jetstream(timeout=2.0)
            ready = False
            while not await self._pause(PICTURE_EVERY_S):
                ready = ready or await self._make_stream(stream)
                await self._publish_picture(client)
                if ready:
                    await self._publish_alerts(stream)
            await self._publish_alerts(stream)
        finally:
            with contextlib.suppress(Exception):
                await asyncio.wait_for(client.close(), 2.0)

    async def _complain(self, error: Exception) -> None:
        self._counts["retries"] += 1
        log.warning("bus %s: %s", self.shown, error or type(error).__name__)

    async def _pause(self, seconds: float) -> bool:
        try:
            async with asyncio.timeout(seconds):
                await self._closing.wait()
        except TimeoutError:
            return False
        return True

    async def _make_stream(self, stream: Any) -> bool:
        from nats.errors import Error
        from nats.js.api import StreamConfig

        subject = f"airside.{self.icao}.alert"
        config = StreamConfig(name=f"airside_{self.icao}_alert", subjects=[subject], max_age=STREAM_AGE_S)
        try:
            await stream.add_stream(config)
        except (Error, OSError) as error:
            self._counts["retries"] += 1
            log.warning("bus %s: stream for alerts: %s", self.shown, error)
            return False
        return True

    async def _publish_picture(self, client: Any) -> None:
        from nats.errors import Error

        with self._lock:
            newest, self._picture = self._picture, None
        if newest is None or not client.is_connected:
            return
        seq, picture = newest
        try:
            await client.publish(f"airside.{self.icao}.picture", encode(self._wire.picture(picture, self._epoch, seq)))
        except Error as error:
            self._counts["retries"] += 1
            log.warning("bus %s: %s", self.shown, error)
        else:
            self._counts["pictures"] += 1

    async def _publish_alerts(self, stream: Any) -> None:
        from nats.errors import Error

        while self._alerts:
            seq, change = self._alerts[0]
            body = {"type": "alert", "epoch": self._epoch, "seq": seq, "time": change.time, "mode": self._wire.mode}
            text = encode({**body, "op": change.operation, "alert": self._wire.alert(change.alert)})
            number = {"Nats-Msg-Id": f"{self._epoch}-{seq}"}
            try:
                await stream.publish(f"airside.{self.icao}.alert", text, headers=number)
            except (Error, OSError) as error:
                self._counts["retries"] += 1
                log.warning("bus %s: alert not taken yet: %s", self.shown, error)
                return
            self._alerts.popleft()
            self._counts["alerts"] += 1


def connect_bus(url: str, service: Service) -> Bus:
    """The bus with this URL, fed by the service. Raises ValueError for a scheme that does not exist."""
    scheme = urlsplit(url).scheme
    if scheme == "memory":
        return MemoryBus()
    if scheme in ("nats", "tls"):
        return NatsBus(url, service)
    raise ValueError(f"{scheme or 'a URL without a scheme'} is no kind of bus; there are memory:// and nats://")
