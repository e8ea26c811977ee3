"""The real web application over the fake service, on a port that survives a restart."""

from __future__ import annotations

import contextlib
import re
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import uvicorn

from app.airports import load_airport
from app.api.application import create_app
from app.live.hub import Hub
from tests.support.fake_replay import FakeReplay
from tests.support.fake_service import FakeService

PERIOD_S = 0.25


class Serving:
    """Pictures at 4 Hz in one thread, the application in another; `down` and `up` leave the port as it is."""

    def __init__(self, targets: int = 40, replay: FakeReplay | None = None) -> None:
        airport, geojson = load_airport("LFPO")
        self.service = FakeService(targets=targets, airport=airport, geojson=geojson, replay=replay)
        self.replay = replay
        self.port = 0
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None
        self._unlisten: Any = None
        self._over = threading.Event()
        self._pictures = threading.Thread(target=self._move, daemon=True)
        self._pictures.start()
        self.up()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def _move(self) -> None:
        while not self._over.wait(PERIOD_S):
            if not self.service.still():
                self.service.step()

    def up(self) -> None:
        """Serve; returns when connections are taken."""
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(("127.0.0.1", self.port))
        self.port = listening.getsockname()[1]
        hub = Hub(self.service, self.service.settings)
        self._unlisten = self.service.listen(hub.publish)
        if self.replay is not None:
            self.replay.on_seek.append(hub.begin_anew)
        application = create_app(self.service, hub=hub, store=None)
        config = uvicorn.Config(application, log_level="error", timeout_graceful_shutdown=1)
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, args=([listening],), daemon=True)
        self._thread.start()
        deadline = time.monotonic() + 20
        while not self._server.started:
            if time.monotonic() > deadline:
                raise TimeoutError("the server did not start")
            threading.Event().wait(0.02)

    def down(self) -> None:
        """Stop serving; the pictures go on."""
        assert self._server is not None
        assert self._thread is not None
        self._unlisten()
        self._server.should_exit = True
        self._server.force_exit = True
        self._thread.join(20)

    def close(self) -> None:
        """End everything."""
        self.down()
        self._over.set()
        self._pictures.join(5)


@contextlib.contextmanager
def changing_host(port: int, host: str) -> Iterator[int]:
    """A proxy on loopback that gives another Host to what it passes on to `port`; yields the port of its own."""
    listening = socket.create_server(("127.0.0.1", 0))

    def pump(source: socket.socket, sink: socket.socket, changed: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(re.sub(rb"(?i)\r\nhost: [^\r]*", b"\r\nHost: " + host.encode(), data) if changed else data)
        for one in (source, sink):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def accept() -> None:
        with contextlib.suppress(OSError):
            while True:
                here, _ = listening.accept()
                there = socket.create_connection(("127.0.0.1", port))
                for way in ((here, there, True), (there, here, False)):
                    threading.Thread(target=pump, args=way, daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield listening.getsockname()[1]
    finally:
        listening.close()
