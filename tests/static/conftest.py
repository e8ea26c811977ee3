from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.static.serving import Serving

CHROMIUM = next(
    (str(path) for path in (Path("/usr/bin/chromium"), Path("/usr/bin/chromium-browser")) if path.exists()), None
)


@pytest.fixture(scope="session")
def serving() -> Iterator[Serving]:
    made = Serving()
    yield made
    made.close()


@pytest.fixture(scope="module")  # not for the session: its event loop would be in the way of other tests' loops
def browser() -> Iterator[Any]:
    path = CHROMIUM or shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium on this machine: the display was not tried in a browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield made
        made.close()


class Screen:
    """One page with what it complained about. errors: console errors, page errors, CSP violations, failed requests."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.errors: list[str] = []
        page.on("console", lambda one: self.errors.append(one.text) if one.type in ("error", "warning") else None)
        page.on("pageerror", lambda one: self.errors.append(str(one)))

    def ask(self, expression: str) -> Any:
        return self.page.evaluate(f"airside.{expression}")

    def until(self, expression: str, timeout_s: float = 20.0) -> None:
        # wait_for_function evaluates text in the page, which the page's policy rightly forbids
        deadline = time.monotonic() + timeout_s
        while not self.page.evaluate(expression):
            assert time.monotonic() < deadline, f"not within {timeout_s:g} s: {expression} (errors: {self.errors})"
            self.page.wait_for_timeout(40)


@pytest.fixture
def screen(serving: Serving, browser: Any) -> Iterator[Screen]:
    """A fresh page with the picture on it."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, reduced_motion="no-preference")
    page = context.new_page()
    made = Screen(page)
    page.goto(serving.url)
    made.until("window.airside && airside.counts().targets > 0 && document.querySelector('#loading').hidden")
    yield made
    context.close()
