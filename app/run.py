"""From settings to a served service: start-up in steps that a person can follow, and an orderly end."""

from __future__ import annotations

import logging
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Protocol

import uvicorn
from fastapi import APIRouter
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from app.airports import load_airport
from app.api.application import create_app
from app.bus import connect_bus
from app.console import one_line
from app.contract import ReplayControl, Service
from app.ingest.mqtt import MqttThread
from app.live.hub import Hub
from app.private_files import make_private_folder
from app.secret_urls import MaskedFormatter
from app.service import SurfaceService
from app.settings import Settings, SettingsError
from app.store.store import Store
from pipeline.airport.model import Airport

if TYPE_CHECKING:
    from app.view3d import View3D

log = logging.getLogger("airside")


class Served(Protocol):
    """What can be served: an application over a service, with a begin and an end."""

    settings: Settings
    app: Any

    @property
    def service(self) -> Service:
        """What the application shows."""

    def begin(self, step: Callable[[str], None]) -> None:
        """Start it; `step` hears what is being done. Raises what goes wrong."""

    def end(self) -> None:
        """Stop everything."""


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
            mqtt = MqttThread(self.settings.mqtt, service)
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
    """Run until SIGINT or SIGTERM; the exit status. running: what is served, a service made of the settings if none."""
    _log_to(console, settings.log_level)
    listening = _listen(settings)
    running = running or Running(settings)
    config = uvicorn.Config(
        running.app,
        host=settings.host,
        port=settings.port,
        log_config=None,
        ws="websockets-sansio",
        ws_max_size=64 * 1024 * 1024,
        ws_ping_interval=20.0,
        ws_ping_timeout=20.0,
        ws_per_message_deflate=settings.feed.compress,
        timeout_graceful_shutdown=3,
        access_log=False,
    )
    server = uvicorn.Server(config)
    failed: list[BaseException] = []

    def start() -> None:
        try:
            _begin_aloud(running, console, server, listening.getsockname()[1])
        except BaseException as error:
            failed.append(error)
            log.error("start-up failed: %s", one_line(error), exc_info=settings.log_level == "debug")
            server.should_exit = True

    # uvicorn raises the signal that ended it once more, which would end us before the store has drained
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, lambda *_: None)
    starter = threading.Thread(target=start, name="start-up")
    starter.start()
    try:
        server.run(sockets=[listening])
    finally:
        starter.join()
        running.end()
    return 1 if failed or not server.started else 0


def _begin_aloud(running: Served, console: Console, server: uvicorn.Server, port: int) -> None:
    begun = time.monotonic()
    columns = (SpinnerColumn("line"), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=not console.is_terminal) as progress:
        tasks: list[Any] = []

        def step(text: str) -> None:
            if tasks:
                progress.update(tasks[-1], total=1, completed=1)
            if not console.is_terminal:
                console.print(f"  {text}")
            tasks.append(progress.add_task(text, total=None))

        running.begin(step)
        step("first picture")
        while not running.service.readiness().ready and not server.should_exit:
            time.sleep(0.05)
        progress.update(tasks[-1], total=1, completed=1)
    if server.should_exit:
        return
    settings = running.settings
    host = "127.0.0.1" if settings.host in ("0.0.0.0", "::") else settings.host
    console.print(
        f"\n[bold]Airside[/bold] {running.service.airport.icao} is ready after {time.monotonic() - begun:.1f} s:"
        f" [bold cyan]http://{host}:{port}[/bold cyan]   (Ctrl-C ends it)\n",
        highlight=False,
    )


def _listen(settings: Settings) -> socket.socket:
    """The listening socket; connections inherit its small send buffer, by which a client that does not read shows."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        opened = socket.create_server((settings.host, settings.port), family=family, backlog=2048)
    except OSError as error:
        raise SettingsError(f"cannot listen on {settings.host}:{settings.port}: {error.strerror}") from error
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
    return opened


def _log_to(console: Console, level: str) -> None:
    handler = RichHandler(console=console, show_path=False)
    handler.setFormatter(MaskedFormatter("%(message)s", "%H:%M:%S"))
    logging.basicConfig(level=level.upper(), handlers=[handler])
    for noisy in ("uvicorn.error", "uvicorn.access", "websockets", "alembic", "numba"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
