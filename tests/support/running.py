"""A real server on a free port, in a thread of the test."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import APIRouter

from app.api.application import create_app
from app.connections import Connections
from app.live.hub import Hub
from app.settings import FeedSettings, LimitsSettings, RadarSettings, Settings
from app.store.store import Store
from app.web_server import web_server
from tests.support.fake_replay import FakeReplay
from tests.support.fake_service import FakeService


def settings_for_tests(**values: Any) -> Settings:
    radar = RadarSettings(id="smr-1", latitude=48.72, longitude=2.38)
    return Settings(**{"mode": "demo", "radars": (radar,), **values})


@dataclass
class Server:
    service: FakeService
    hub: Hub
    store: Store | None
    port: int
    app: Any
    connections: Connections

    @property
    def refused(self) -> Counter[str]:
        """What the web server refused or cut."""
        return self.connections.refused

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def live(self) -> str:
        return f"ws://127.0.0.1:{self.port}/api/v1/live"


def first_picture(server: Server) -> None:
    """Let the service make a picture, and wait until the feed has it."""
    server.service.step()
    until(lambda: server.hub.picture is not None, "the first picture is numbered")


@contextlib.contextmanager
def running(
    folder: Path | None = None,
    *,
    feed: FeedSettings | None = None,
    limits: LimitsSettings | None = None,
    root_path: str = "",
    view3d: Callable[[FakeService], APIRouter] | None = None,
    **fake: Any,
) -> Iterator[Server]:
    """Serve a fake service that stands still until the test calls `service.step()`. view3d: makes its routes."""
    replay: FakeReplay | None = fake.get("replay")
    mode = "demo" if replay is None else "replay"
    settings = settings_for_tests(
        mode=mode, feed=feed or FeedSettings(), limits=limits or LimitsSettings(), root_path=root_path
    )
    service = FakeService(settings, **fake)
    hub = Hub(service, settings)
    if replay is not None:
        replay.on_seek.append(hub.begin_anew)
    service.listen(hub.publish)
    store = None
    if folder is not None:
        store = Store(f"sqlite:///{folder / 'airside.sqlite3'}", settings, service.airport)
        store.start()
        service.listen(store.record)
    app = create_app(service, hub=hub, store=store, view3d_router=view3d(service) if view3d is not None else None)
    listening = socket.create_server(("127.0.0.1", 0))
    server = web_server(app, settings, app.state.refused, graceful_s=2)
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    try:
        until(lambda: server.started, "the server starts")
        yield Server(service, hub, store, listening.getsockname()[1], app, server.connections)
    finally:
        server.should_exit = True
        thread.join(15.0)
        if store is not None:
            store.stop()
    assert not thread.is_alive(), "the server did not end"


def until(condition: Any, what: str, timeout: float = 15.0) -> None:
    """Wait for a condition; fail with words when it does not come."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"waited in vain until {what}"
        time.sleep(0.005)
