"""The 2D display in a browser, through the real demonstration."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.static.conftest import Screen, browser
from tests.whole.conftest import Airside, launch
from tests.whole.test_demo import eventually

__all__ = ["browser"]

pytestmark = pytest.mark.browser


@pytest.fixture
def looking(browser: Any) -> Iterator[Any]:
    """Opens the display of a running service; closes what was opened."""
    contexts: list[Any] = []

    def look(running: Airside) -> Screen:
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        contexts.append(context)
        made = Screen(context.new_page())
        made.page.goto(running.url)
        made.until("window.airside && airside.counts().targets > 0 && document.querySelector('#loading').hidden", 60)
        return made

    yield look
    for context in contexts:
        context.close()


def test_orly_moves_with_its_radar_picture_and_an_alert_can_be_acknowledged(demo: Airside, looking: Any) -> None:
    screen = looking(demo)
    page = screen.page
    assert "DEMO" in page.locator("#mode").inner_text()
    page.evaluate("window.before = new Map(airside.positions().map((one) => [one.id, one]))")
    screen.until(
        """airside.positions().filter(({ id, e, n }) => {
          const old = window.before.get(id);
          return old && Math.hypot(e - old.e, n - old.n) > 10;
        }).length >= 3""",
        40,
    )
    page.keyboard.press("r")
    screen.until("airside.counts().radarPictures > 0")
    # the first incident begins at 20 s, the next ones 90 s apart; ordinary traffic may alert before
    button = page.locator("#alert-list .alert.open .alert-ack").first
    button.wait_for(timeout=120_000)
    button.click()
    eventually(lambda: any(one["acknowledged_by"] for one in said(demo)), 20, "the acknowledgement in the service")
    assert screen.ask("counts().drawErrors") == 0
    assert screen.errors == []


def said(running: Airside) -> list[dict[str, Any]]:
    """All alerts, live and stored."""
    answer = running.get("/api/v1/alerts?from=0&to=4102444800")
    return list(answer.json()["alerts"])


def test_a_service_that_hangs_or_dies_is_said_at_once_and_its_return_too(tmp_path: Path, looking: Any) -> None:
    running = launch("demo", tmp_path / "data")
    try:
        running.wait_ready()
        screen = looking(running)
        banner = screen.page.locator("#banner")
        screen.until("airside.health() === 'ok'")
        assert banner.is_hidden()
        running.process.send_signal(signal.SIGSTOP)
        screen.until("!document.querySelector('#banner').hidden", 30)
        assert screen.ask("health()") == "lost"
        assert banner.inner_text()
        running.process.send_signal(signal.SIGCONT)
        screen.until("document.querySelector('#banner').hidden", 40)
        running.end(signal.SIGKILL)
        screen.until("!document.querySelector('#banner').hidden", 30)
        assert screen.page.evaluate("airside.counts().targets") > 0
    finally:
        running.process.send_signal(signal.SIGCONT)
        running.end(signal.SIGKILL)
