"""The 3D view in a real browser, through the door of the real application."""

from __future__ import annotations

import io
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import uvicorn
from PIL import Image

from app.api.application import create_app
from app.live.hub import Hub
from app.view3d import View3D, router
from tests.app.view3d.pictures import alert, picture, tracks
from tests.support.fake_service import FakeService
from tests.support.running import until

pytestmark = pytest.mark.browser

GL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
CROWD = [[200.0 * i - 400.0, 150.0 * j - 300.0, 5.0, 0.0] for i in range(5) for j in range(4)]


@pytest.fixture
def shown() -> Iterator[tuple[View3D, str]]:
    service = FakeService(targets=0)
    view = View3D(service.airport, "demo", period_s=0.2)
    view.start()
    hub = Hub(service, service.settings)
    app = create_app(service, hub=hub, store=None, view3d_router=router(view, service.settings))
    listening = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(app, log_config=None, ws="websockets-sansio", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    until(lambda: server.started, "the server starts")
    assert view.ready.wait(30)
    yield view, f"http://127.0.0.1:{listening.getsockname()[1]}/3d/"
    server.should_exit = True
    thread.join(10)
    view.stop()


@pytest.fixture
def page() -> Iterator[Any]:
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium on this machine: the 3D view was not tried in a browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=GL)
        yield browser.new_page(viewport={"width": 800, "height": 500})
        browser.close()


def pixels(page: Any) -> np.ndarray[Any, Any]:
    """The left part of the window, where no panel is."""
    shot = Image.open(io.BytesIO(page.screenshot(timeout=60_000))).convert("RGB")
    return np.asarray(shot, np.int32)[60:, :460]


def red(picture: np.ndarray[Any, Any]) -> int:
    return int(((picture[..., 0] > 170) & (picture[..., 1] < 90) & (picture[..., 2] < 90)).sum())


def test_the_canvas_shows_the_field_the_targets_and_an_alarm(shown: tuple[View3D, str], page: Any) -> None:
    view, address = shown
    complaints: list[str] = []
    page.on("console", lambda one: complaints.append(one.text) if one.type == "error" else None)
    page.on("pageerror", lambda one: complaints.append(str(one)))
    page.on("request", lambda one: complaints.append(one.url) if "127.0.0.1" not in one.url[:30] else None)
    table = tracks(list(range(1, 21)), state=np.array(CROWD), category=1, heading=1.0)
    over = threading.Event()
    alerts: list[Any] = []

    def feed() -> None:
        while not over.wait(0.2):
            view.update(picture(table, *alerts))

    feeder = threading.Thread(target=feed)
    feeder.start()
    try:
        page.goto(address)
        page.get_by_text("LFPO DEMO").first.wait_for(timeout=30_000)
        _until(page, lambda: len(np.unique(pixels(page).reshape(-1, 3), axis=0)) > 200, "the canvas is not blank")
        (viewer,) = view.viewers()
        _until(page, lambda: 0 < viewer.label_count <= 40, "labels are shown")
        before = red(pixels(page))
        alerts.append(alert([6], runway="06/24"))
        _until(page, lambda: red(pixels(page)) > before + 150, "the alarm is seen")
        page.get_by_text("ALARM", exact=True).first.wait_for(timeout=10_000)
        place = next(one for one in range(1024) if view._movers.slots.bearer(one) == 6)
        view._picked(viewer.id, place)
        page.get_by_text("Track 6").first.wait_for(timeout=10_000)
    finally:
        over.set()
        feeder.join()
    assert [one for one in complaints if not one.startswith(("data:", "blob:"))] == []


def _until(page: Any, condition: Any, what: str, timeout: float = 40.0) -> None:
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"waited in vain until {what}"
        page.wait_for_timeout(200)
