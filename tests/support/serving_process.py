"""The web application over a service that stands still, served in a process of its own: FOLDER DESCRIPTORS."""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from app.api.application import create_app
from app.live.hub import Hub
from app.run import serve
from tests.support.fake_service import FakeService
from tests.support.running import settings_for_tests


class Standing:
    """What is served: a fake service whose picture moves once at the begin."""

    def __init__(self, folder: Path) -> None:
        self.settings = settings_for_tests(port=0, data_dir=folder)
        self.service = FakeService(self.settings)
        self.hub = Hub(self.service, self.settings)
        self.service.listen(self.hub.publish)
        self.app = create_app(self.service, hub=self.hub, store=None)

    def begin(self, step: Callable[[str], None]) -> None:
        """Show one picture."""
        step("picture")
        self.service.step()

    def end(self) -> None:
        """Nothing stays open."""


if __name__ == "__main__":
    folder, descriptors = Path(sys.argv[1]), int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))
    standing = Standing(folder)
    raise SystemExit(serve(standing.settings, Console(width=200), standing))
