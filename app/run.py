"""From settings to a served service, and its orderly end."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from fastapi import APIRouter
from rich.console import Console

from app.airports import load_airport
from app.api.application import create_app
from app.bus import connect_bus
from app.contract import ReplayControl, Service
from app.ingest.mqtt import MqttThread, client_id
from app.live.hub import Hub
from app.logs import log_to
from app.private_files import make_private_folder
from app.runtime.restart import RestartNote
from app.service import SurfaceService
from app.settings import Settings, SettingsError
from app.startup import Served, Starter, say
from app.stopping import STOPPED, end_now, handle_signals
from app.store.store import Store
from app.web_server import LISTEN_QUEUE, web_server
from pipeline.airport.model import Airport

if TYPE_CHECKING:
    from app.view3d import View3D

log = logging.getLogger(__name__)

STEP_END_S = 0.3
"""How long the step of the start-up that runs when the service is told to end is waited for: the compiler takes
longer, everything else less."""


class Running:
    """A service with its store, feeds and server. `begin` is run in a thread while the server already answers."""

    def __init__(self, settings: Settings) -> None:
        make_private_folder(settings.data_dir, "data_dir")
        self.settings = settings
        airport, document = load_airport(settings.airport)
        self.service = SurfaceService(settings, airport, document)
        self.store = Store(settings.database, settings, airport)
        self.hub = Hub(self.service, settings)
        if settings.journal.folder is not None and settings.journal.display:
            from app.journal.display import DisplayRecorder

            DisplayRecorder(self.hub, lambda: self.service.journal, self.service.clock.now)
        self.view3d, view_router = make_view(settings, airport, self.service.replay)
        self.app = create_app(self.service, hub=self.hub, store=self.store, view3d_router=view_router)
        self._ends = ExitStack()

    def begin(self, step: Callable[[str], None]) -> None:
        """Migrate, warm up, open the sockets; `step` hears what is being done. Raises what goes wrong."""
        service, store = self.service, self.store
        step("database: bringing the schema up to date")
        store.start()
        self._ends.callback(store.stop)
        restart = RestartNote(store.alerts("live", None, None))
        if restart.words:
            log.warning("%s", restart.words)
        service.extra_sensors.append(restart.state)
        store.close_open_alerts("restart", time.time())
        service.checks["database"] = True
        step("kernels: compiling or loading from the cache")
        service.prepare(first_alert=store.last_alert_id() + 1)
        service.extra_sensors.append(store.health)
        service.keep_node_events = store.record_node_events
        service.listen(store.record)
        service.listen(self.hub.publish)
        if self.view3d is not None:
            view = self.view3d
            begin_view(view, service, step, self._ends)
            service.extra_counters["view3d"] = lambda: {f"view3d_{k}": v for k, v in view.counters().items()}
        try:
            bus = connect_bus(self.settings.bus_url.get_secret_value(), service)
        except ValueError as error:
            raise SettingsError(f"bus_url: {error}") from error
        service.extra_counters["bus"] = bus.counters
        self._ends.callback(bus.close)
        step("sensors: opening the sockets")
        service.start()
        self._ends.callback(service.stop)
        if self.settings.mqtt.url is not None and self.settings.mqtt.url.get_secret_value():
            late_s = self.settings.clocks.nodes.max_offset_s
            mqtt = MqttThread(self.settings.mqtt, service, client_id(self.settings, service.airport.icao), late_s)
            mqtt.start()
            service.extra_counters["mqtt"] = mqtt.counters
            self._ends.callback(mqtt.stop)
        if self.settings.mode == "demo":
            step("simulator: bringing Orly to life")
            self._begin_demo()

    def end(self) -> None:
        """Stop everything in the opposite order; the store drains last."""
        self._ends.close()

    def _begin_demo(self) -> None:
        from app.demo import demo_feed

        feed = demo_feed(self.service, self.settings)
        self.service.extra_counters["demo"] = feed.counters
        feed.start()
        self._ends.callback(feed.stop)


def make_view(
    settings: Settings, airport: Airport, replay: ReplayControl | None
) -> tuple[View3D | None, APIRouter | None]:
    """The 3D view and its routes, where the settings want it. replay: steers the replay that is shown, if it is one."""
    if not settings.view3d:
        return None, None
    from app.view3d import View3D, router

    view = View3D(airport, settings.mode, replay=replay)
    return view, router(view, settings)


def begin_view(view: View3D, service: Service, step: Callable[[str], None], ends: ExitStack) -> None:
    """Start a 3D view and show it every picture of the service; `ends` stops it."""
    step("3D view: building the scene")
    view.start()
    ends.callback(view.stop)
    service.listen(lambda picture, _changes: view.update(picture))


def serve(settings: Settings, console: Console, running: Served | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit status: 0, 1 when it failed, 130 when it was stopped before it was ready.

    running: what is served, a service made of the settings if none. Does not return when it is stopped before it is
    ready: the process ends, as kernels may be compiling in a thread of it.
    """
    log_to(console, settings.log_level, settings.log_format)
    listening = _listen(settings)
    running = running or Running(settings)
    server = web_server(running.app, settings, running.app.state.refused)
    starter = Starter(running, console, server, listening.getsockname()[1])

    def stop() -> None:
        server.should_exit = True

    # uvicorn raises the signal that ended it once more, which would end us before the store has drained
    handle_signals(stop)
    starter.start()
    try:
        server.run(sockets=[listening])
    finally:
        starter.join(STEP_END_S)
        running.end()
    if starter.failed or not server.started:
        return 1
    say(console, settings, "stopped")
    if not starter.ready:
        end_now(STOPPED)
    return 0


def _listen(settings: Settings) -> socket.socket:
    """The listening socket; connections inherit its small send buffer, by which a client that does not read shows."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        opened = socket.create_server((settings.host, settings.port), family=family, backlog=LISTEN_QUEUE)
    except OSError as error:
        raise SettingsError(f"cannot listen on {settings.host}:{settings.port}: {error.strerror}") from error
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
    return opened
