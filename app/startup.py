"""The start of a service, told step by step while its server already answers, and given up when it is to end."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import uvicorn
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from app.console import one_line
from app.contract import Service
from app.logs import in_lines
from app.settings import Settings

log = logging.getLogger("airside")

LOOK_S = 0.05
"""How often it is looked whether the first picture has come."""


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


class StartStopped(Exception):
    """The service is to end before it is ready."""


class Starter(threading.Thread):
    """Begins a service and says so; has the server end when that fails. A daemon, as a step may last for a minute.

    failed: something went wrong. ready: the service shows its first picture.
    """

    def __init__(self, running: Served, console: Console, server: uvicorn.Server, port: int) -> None:
        super().__init__(name="start-up", daemon=True)
        self.failed = self.ready = False
        self._running, self._console, self._server, self._port = running, console, server, port

    def run(self) -> None:
        """Begin, and wait for the first picture."""
        settings, begun = self._running.settings, time.monotonic()
        try:
            with steps(self._console, settings) as tell:
                self._begin(tell)
        except StartStopped:
            return
        except BaseException as error:
            if self._server.should_exit:
                return  # what it needed has been stopped under it
            self.failed = True
            log.error("start-up failed: %s", one_line(error), exc_info=settings.log_level == "debug")
            self._server.should_exit = True
            return
        self.ready = True
        self._say_ready(time.monotonic() - begun)

    def _begin(self, tell: Callable[[str], None]) -> None:
        def step(text: str) -> None:
            if self._server.should_exit:
                raise StartStopped
            tell(text)

        self._running.begin(step)
        step("first picture")
        while not self._running.service.readiness().ready:
            if self._server.should_exit:
                raise StartStopped
            time.sleep(LOOK_S)

    def _say_ready(self, seconds: float) -> None:
        settings, icao = self._running.settings, self._running.service.airport.icao
        host = "127.0.0.1" if settings.host in ("0.0.0.0", "::") else settings.host
        where = f"http://{host}:{self._port}"
        say(
            self._console,
            settings,
            f"Airside {icao} is ready after {seconds:.1f} s: {where}",
            f"\n[bold]Airside[/bold] {icao} is ready after {seconds:.1f} s: [bold cyan]{where}[/bold cyan]"
            "   (Ctrl-C ends it)\n",
        )


def say(console: Console, settings: Settings, text: str, styled: str | None = None) -> None:
    """Say something of the course of things: a line of the log outside a terminal, `styled` in rich's markup at one."""
    if in_lines(console, settings.log_format):
        log.info("%s", text)
    else:
        console.print(escape(text) if styled is None else styled, highlight=False)


@contextmanager
def steps(console: Console, settings: Settings) -> Iterator[Callable[[str], None]]:
    """What tells each step as it begins."""
    if in_lines(console, settings.log_format):
        yield lambda text: log.info("%s", text)
        return
    columns = (SpinnerColumn("line"), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        tasks: list[Any] = []

        def tell(text: str) -> None:
            if tasks:
                progress.update(tasks[-1], total=1, completed=1)
            tasks.append(progress.add_task(text, total=None))

        yield tell
        progress.update(tasks[-1], total=1, completed=1)
