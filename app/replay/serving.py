"""Serves the displays with the picture of a journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace

from rich.console import Console

from app.api.application import create_app
from app.journal.names import JournalError
from app.journal.reader import Journal
from app.live.hub import Hub
from app.replay.player import JournalPlayer
from app.replay.recorded import changing, own_verbs, recorded_run
from app.replay.service import ReplayService
from app.run import begin_view, make_view, serve
from app.settings import load


class ReplayRunning:
    """The replaying service with its feed, displays and server; see `app.run.Running`."""

    def __init__(
        self,
        journal: Journal,
        orders: Sequence[str],
        window: tuple[float | None, float | None],
        port: int,
        speed: float,
    ) -> None:
        change = changing(journal, orders)
        attached = next((got for one in journal.files if (got := one.attachments())), None)
        if attached is None:
            raise JournalError(f"{journal.name}: no settings and no map in it")
        run = change(recorded_run(attached, journal.name))
        here = {"port": port, "host": "127.0.0.1", "mode": "replay", "log_format": load().log_format}
        self.settings = run.settings.model_copy(update=here)
        player = JournalPlayer(journal, change, window, speed, own=own_verbs(orders))
        self.service = ReplayService(replace(run, settings=self.settings), player)
        self.hub = Hub(self.service, self.settings)
        player.begin_anew = self.hub.begin_anew
        self.view3d, view_router = make_view(self.settings, run.airport, player)
        self.app = create_app(self.service, hub=self.hub, store=None, view3d_router=view_router)
        self._ends = ExitStack()

    def begin(self, step: Callable[[str], None]) -> None:
        """Start the replay; `step` hears what is being done."""
        service = self.service
        service.listen(self.hub.publish)
        if self.view3d is not None:
            begin_view(self.view3d, service, step, self._ends)
        step("journal: finding the first picture")
        service.player.start()
        self._ends.callback(service.player.stop)

    def end(self) -> None:
        """Stop everything in the opposite order."""
        self._ends.close()


def serve_journal(
    console: Console,
    journal: Journal,
    orders: Sequence[str],
    window: tuple[float | None, float | None],
    port: int,
    speed: float,
) -> int:
    """Serve until interrupted; the exit status. Raises JournalError, SettingsError."""
    running = ReplayRunning(journal, orders, window, port, speed)
    return serve(running.settings, console, running)
