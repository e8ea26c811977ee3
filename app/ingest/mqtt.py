"""Pavement nodes that speak MQTT: JSON events on `airside/nodes/<id>/events` go the way of the REST ones."""

from __future__ import annotations

import asyncio
import logging
import random
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Protocol
from urllib.parse import unquote, urlsplit

import aiomqtt

from app.contract import Refused, RefusedRow, RefusedTime, Submitted
from app.ingest.node_events import parse_node_events
from app.ingest.wire_json import BadMessage
from app.settings import MqttSettings
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents

log = logging.getLogger(__name__)

FIRST_WAIT_S = 0.5
LONGEST_WAIT_S = 30.0
MESSAGE_LIMIT = 1000
MESSAGE_BYTES = 256 * 1024
QUEUED = 10_000

Submit = Callable[[NodeEvents], Submitted]


class _Service(Protocol):
    nodes: tuple[NodeSite, ...]

    def submit_node_events(self, events: NodeEvents) -> Submitted: ...


async def listen(
    settings: MqttSettings, nodes: Sequence[NodeSite], submit: Submit, counters: Counter[str] | None = None
) -> None:
    """Subscribe and pass on events for ever; connects again with growing waits.

    Bad messages are counted by reason in `counters` and logged once a reason. Ends only by cancellation. Raises
    ValueError when the settings have no URL or one that is not mqtt:// or mqtts://.
    """
    counted: Counter[str] = Counter() if counters is None else counters
    address = parse_url(_plain(settings))
    wait = FIRST_WAIT_S
    while True:
        try:
            async with aiomqtt.Client(
                hostname=address.host,
                port=address.port,
                username=address.username,
                password=address.password,
                tls_params=aiomqtt.TLSParameters() if address.secure else None,
                max_queued_incoming_messages=QUEUED,
                timeout=10.0,
            ) as client:
                await client.subscribe(settings.topic, qos=1)
                counted["connects"] += 1
                wait = FIRST_WAIT_S
                log.info("mqtt: listening to %s on %s:%d", settings.topic, address.host, address.port)
                async for message in client.messages:
                    _take(str(message.topic), message.payload, settings.topic, nodes, submit, counted)
        except aiomqtt.MqttError as error:
            counted["connect_failures"] += 1
            log.warning("mqtt: %s:%d: %s; again in %.1f s", address.host, address.port, error, wait)
        # the jitter keeps many clients from coming back at once
        await asyncio.sleep(wait * random.uniform(0.8, 1.2))
        wait = min(2 * wait, LONGEST_WAIT_S)


class MqttThread:
    """`listen` in a thread with its own event loop, for the service."""

    def __init__(self, settings: MqttSettings, service: _Service) -> None:
        parse_url(_plain(settings))
        self._settings, self._service = settings, service
        self._counted: Counter[str] = Counter()
        self._loop = asyncio.new_event_loop()
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; waits at most a few seconds."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._cancel)
            self._thread.join(5.0)

    def counters(self) -> dict[str, int]:
        """Messages and events taken, and what was not by reason."""
        return {f"mqtt_{name}": count for name, count in sorted(self._counted.items())}

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._task = self._loop.create_task(
            listen(self._settings, self._service.nodes, self._service.submit_node_events, self._counted)
        )
        try:
            self._loop.run_until_complete(self._task)
        except asyncio.CancelledError:
            pass
        except Exception:
            log.exception("mqtt: the listener ended")
            self._counted["ended"] += 1
        finally:
            self._loop.close()

    def _cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()


def _plain(settings: MqttSettings) -> str | None:
    return settings.url.get_secret_value() if settings.url is not None else None


class Address:
    """Where the broker is."""

    def __init__(self, host: str, port: int, username: str | None, password: str | None, secure: bool) -> None:
        self.host, self.port, self.secure = host, port, secure
        self.username, self.password = username, password


def parse_url(url: str | None) -> Address:
    """The parts of mqtt://user:password@host:port. Raises ValueError."""
    parts = urlsplit(url or "")
    if parts.scheme not in ("mqtt", "mqtts") or not parts.hostname:
        raise ValueError("mqtt.url must look like mqtt://host:1883 or mqtts://user:password@host:8883")
    secure = parts.scheme == "mqtts"
    name, secret = parts.username, parts.password
    return Address(
        parts.hostname,
        parts.port or (8883 if secure else 1883),
        unquote(name) if name else None,
        unquote(secret) if secret else None,
        secure,
    )


def node_of_topic(topic: str, pattern: str) -> str | None:
    """The level of the topic that stands where the pattern's first `+` does; None when there is none."""
    levels = pattern.split("/")
    if levels[:1] == ["$share"]:
        levels = levels[2:]
    found = topic.split("/")
    if "+" not in levels or levels.index("+") >= len(found):
        return None
    return found[levels.index("+")]


def _take(
    topic: str, payload: object, pattern: str, nodes: Sequence[NodeSite], submit: Submit, counted: Counter[str]
) -> None:
    body = payload if isinstance(payload, bytes) else str(payload).encode()
    counted["messages"] += 1
    try:
        if len(body) > MESSAGE_BYTES:
            raise BadMessage("too_many", f"{len(body)} octets in one message; at most {MESSAGE_BYTES} are taken")
        parsed = parse_node_events(body, nodes, MESSAGE_LIMIT, node=node_of_topic(topic, pattern))
        for bad in parsed.bad:
            _note(bad.reason, topic, bad.message, counted)
        submitted = submit(parsed.rows)
    except BadMessage as error:
        for bad in error.rows or [RefusedRow(0, error.reason, str(error))]:
            _note(bad.reason, topic, bad.message, counted)
    except RefusedTime as error:
        counted["events_refused"] += len(error.rows)
        _note("refused_time", topic, str(error), counted)
    except Refused as error:
        _note("refused", topic, str(error), counted)
    else:
        counted["events"] += submitted.taken
        counted["events_refused"] += len(submitted.refused)


def _note(reason: str, topic: str, why: str, counted: Counter[str]) -> None:
    counted[reason] += 1
    if counted[reason] == 1:
        log.warning("mqtt: %s: %s (further ones of this kind are only counted)", topic, why)
