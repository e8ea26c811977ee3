"""Pavement nodes that speak MQTT: JSON events on `airside/nodes/<id>/events` go the way of the REST ones.

The session is kept by the broker while this client is away, so that what nodes send with QoS 1 meanwhile arrives when
it is back. A message is acknowledged to the broker when it is taken or found to be wrong, not before.
"""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol
from urllib.parse import unquote, urlsplit

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from app.contract import Refused, RefusedRow, RefusedTime, Submitted
from app.ingest.node_events import parse_node_events
from app.ingest.wire_json import BadMessage
from app.settings import MqttSettings, Settings
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents

log = logging.getLogger(__name__)

FIRST_WAIT_S, LONGEST_WAIT_S = 1, 2
"""Between two attempts to connect. With CONNECT_S it is back within 5 s of the broker's return."""

CONNECT_S = 2.5
"""An attempt to connect is given up after this long: a host that is gone gives no answer at all."""

KEEPALIVE_S = 5
"""A connection on which nothing came for this long is tried out, and given up when nothing comes for as long again."""

RETRY_S = 0.1
"""A message for which there is no room is offered again after this long; the broker keeps those that follow."""

KEPT_AT_MOST_S = 86_400.0
"""A day: events that the broker kept while no service ran are taken for true up to this age."""

RECENT = 4096
"""Messages by which one that is delivered once more is known; brokers have 20 to 100 unacknowledged ones on the way."""

QUICK_S, QUICK_TIMES = 10.0, 3
"""A connection lost within so many seconds, so many times in a row: most likely two clients have one id."""

MESSAGE_LIMIT = 1000
MESSAGE_BYTES = 256 * 1024

Submit = Callable[[NodeEvents], Submitted]


class _Service(Protocol):
    nodes: tuple[NodeSite, ...]
    keep_node_events: Callable[[NodeEvents], None]
    """Stores events without showing them."""

    def submit_node_events(self, events: NodeEvents) -> Submitted: ...


class Away(NamedTuple):
    """From when to when (UTC s) the broker kept what was sent."""

    since: float
    until: float


def client_id(settings: Settings, icao: str) -> str:
    """The id by which the broker knows this service again; the same at each start with the same settings.

    Without `mqtt.client_id` it is made of airport, data folder, port and topic, in 23 letters and digits, which every
    broker takes.
    """
    if settings.mqtt.client_id:
        return settings.mqtt.client_id
    place = f"{settings.data_dir.absolute()} {settings.port} {settings.mqtt.topic}"
    letters = "".join(one for one in icao if one.isascii() and one.isalnum())[:4]
    return f"airside{letters}{hashlib.sha256(place.encode()).hexdigest()}"[:23]


class MqttThread:
    """Listens in a thread of its own, and connects again for as long as it runs.

    client_id: by which the broker knows it again. late_s: an event this much older than its arrival that the broker
    kept is stored, but not shown: the picture is of now. Raises ValueError when the settings have no URL or one that is
    not mqtt:// or mqtts://.
    """

    def __init__(
        self,
        settings: MqttSettings,
        service: _Service,
        client_id: str,
        late_s: float = 5.0,
        keepalive_s: int = KEEPALIVE_S,
    ) -> None:
        self._address = parse_url(settings.url.get_secret_value() if settings.url is not None else None)
        self._topic, self._service, self._id = settings.topic, service, client_id
        self._late_s, self._keepalive_s = late_s, keepalive_s
        self._counted: Counter[str] = Counter()
        self._recent: OrderedDict[bytes, None] = OrderedDict()
        self._over = threading.Event()
        self._connected_at: float | None = None
        self._lost_at: float | None = None
        self._quick = 0
        self._told = False
        self._away: Away | None = None
        self._client = self._made()
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; waits at most a few seconds. The broker goes on keeping the session."""
        self._over.set()
        for _ in range(10):
            self._client.disconnect()
            self._thread.join(0.5)
            if not self._thread.is_alive():
                return

    def counters(self) -> dict[str, int]:
        """Messages and events taken, and what was not by reason."""
        return {f"mqtt_{name}": count for name, count in sorted(self._counted.copy().items())}

    def _made(self) -> paho.Client:
        address = self._address
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id=self._id, clean_session=False, manual_ack=True)
        client.connect_timeout = CONNECT_S
        client.reconnect_delay_set(FIRST_WAIT_S, LONGEST_WAIT_S)
        if address.username is not None:
            client.username_pw_set(address.username, address.password)
        if address.secure:
            client.tls_set()
        client.on_connect, client.on_connect_fail = self._on_connect, self._on_connect_fail
        client.on_disconnect, client.on_message = self._on_disconnect, self._on_message
        client.on_subscribe = self._on_subscribe
        client.connect_async(address.host, address.port, self._keepalive_s)
        return client

    def _run(self) -> None:
        try:
            self._client.loop_forever(retry_first_connection=True)
        except Exception:
            log.exception("mqtt: the listener ended")
            self._counted["ended"] += 1

    def _on_connect(self, client: paho.Client, _data: Any, flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._failed(str(reason))
            return
        now = time.time()
        if flags.session_present:
            lost_at = self._lost_at
            since = now - KEPT_AT_MOST_S if lost_at is None else lost_at - 2 * self._keepalive_s
            self._away = Away(since, now)
        elif self._lost_at is not None:
            self._counted["sessions_lost"] += 1
            log.warning("mqtt: the broker has not kept the session; what was sent meanwhile may be lost")
        client.subscribe(self._topic, qos=1)
        self._connected_at, self._told = time.monotonic(), False

    def _on_subscribe(self, _client: paho.Client, _data: Any, _mid: int, reasons: Any, _properties: Any) -> None:
        if any(one.is_failure for one in reasons):
            self._counted["subscriptions_refused"] += 1
            log.error("mqtt: the broker does not let this client listen to %s", self._topic)
            return
        self._counted["connects"] += 1
        log.info("mqtt: listening to %s on %s:%d as %s", self._topic, self._address.host, self._address.port, self._id)

    def _on_connect_fail(self, _client: paho.Client, _data: Any) -> None:
        self._failed("no connection")

    def _failed(self, why: str) -> None:
        """Count an attempt that failed; the first in a row is told."""
        self._counted["connect_failures"] += 1
        if not self._told and not self._over.is_set():
            self._told = True
            host, port = self._address.host, self._address.port
            log.warning("mqtt: %s:%d: %s; tried again every %d s", host, port, why, LONGEST_WAIT_S)

    def _on_disconnect(self, _client: paho.Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if self._over.is_set() or self._connected_at is None:
            return
        self._counted["disconnects"] += 1
        self._lost_at = time.time()
        self._quick = self._quick + 1 if time.monotonic() - self._connected_at < QUICK_S else 0
        self._connected_at = None
        log.warning("mqtt: %s:%d: connection lost: %s", self._address.host, self._address.port, reason)
        if self._quick == QUICK_TIMES:
            log.error(
                "mqtt: the connection is lost each time soon after it was made: does another client have the id %s? "
                "Give each its own mqtt.client_id",
                self._id,
            )

    def _on_message(self, client: paho.Client, _data: Any, message: paho.MQTTMessage) -> None:
        """Take a message, waiting for room, and acknowledge it; at the end of the service the broker keeps it."""
        if self._over.is_set():
            return
        try:
            topic = message.topic
        except UnicodeDecodeError:
            self._counted["bad_topic"] += 1
        else:
            digest = hashlib.blake2b(topic.encode() + b"\0" + message.payload, digest_size=16).digest()
            if message.dup and digest in self._recent:  # taken before, but its acknowledgement was lost
                self._counted["messages_repeated"] += 1
            elif not self._taken(topic, bytes(message.payload)):
                return
            self._remember(digest)
        client.ack(message.mid, message.qos)

    def _taken(self, topic: str, payload: bytes) -> bool:
        """Offer a message until there is room for it; False when the service ends before."""
        told = False
        while True:
            try:
                take(topic, payload, self._topic, self._service.nodes, self._submit, self._counted)
            except Refused as error:
                if not told:
                    note("refused", topic, f"{error}; it is offered again", self._counted)
                told = True
                if self._over.wait(RETRY_S):
                    return False
            else:
                return True

    def _remember(self, digest: bytes) -> None:
        self._recent[digest] = None
        self._recent.move_to_end(digest)
        if len(self._recent) > RECENT:
            self._recent.popitem(last=False)

    def _submit(self, events: NodeEvents) -> Submitted:
        """Give events to the service; those that are old because the broker kept them are only stored."""
        if self._away is None:
            return self._service.submit_node_events(events)
        old = events.time < time.time() - self._late_s
        old &= (events.time >= self._away.since - self._late_s) & (events.time <= self._away.until)
        if not old.any():
            return self._service.submit_node_events(events)
        try:
            submitted = self._service.submit_node_events(events[~old]) if not old.all() else Submitted(0)
        except RefusedTime as error:
            submitted = Submitted(0, error.rows)
        self._service.keep_node_events(events[old])
        self._counted["events_late"] += int(old.sum())
        return Submitted(submitted.taken + int(old.sum()), submitted.refused)


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


def take(
    topic: str, payload: bytes, pattern: str, nodes: Sequence[NodeSite], submit: Submit, counted: Counter[str]
) -> None:
    """Take the events of a message; what is wrong is counted by reason.

    Raises Refused when there is no room now; nothing is counted then.
    """
    try:
        if len(payload) > MESSAGE_BYTES:
            raise BadMessage("too_many", f"{len(payload)} octets in one message; at most {MESSAGE_BYTES} are taken")
        parsed = parse_node_events(payload, nodes, MESSAGE_LIMIT, node=node_of_topic(topic, pattern))
        submitted = submit(parsed.rows)
    except BadMessage as error:
        wrong = list(error.rows) or [RefusedRow(0, error.reason, str(error))]
    except RefusedTime as error:
        wrong = [*parsed.bad, RefusedRow(0, "refused_time", str(error))]
        counted["events_refused"] += len(error.rows)
    else:
        wrong = list(parsed.bad)
        counted["events"] += submitted.taken
        counted["events_refused"] += len(submitted.refused)
    counted["messages"] += 1
    for bad in wrong:
        note(bad.reason, topic, bad.message, counted)


def note(reason: str, topic: str, why: str, counted: Counter[str]) -> None:
    """Count something that is not taken; the first of each reason is told in the log."""
    counted[reason] += 1
    if counted[reason] == 1:
        log.warning("mqtt: %s: %s (further ones of this kind are only counted)", topic, why)
