"""The display in a real browser, while a recording is replayed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import pytest

from tests.static.conftest import Screen
from tests.static.serving import Serving
from tests.support.fake_replay import BEGIN, LENGTH_S, FakeReplay
from tests.support.running import until

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def replay() -> FakeReplay:
    return FakeReplay()


@pytest.fixture(scope="module")
def replaying(replay: FakeReplay) -> Iterator[Serving]:
    made = Serving(replay=replay)
    yield made
    made.close()


@pytest.fixture
def screen(replaying: Serving, replay: FakeReplay, browser: Any) -> Iterator[Screen]:
    """A page of a replay that is paused 60 s from its beginning."""
    replay.steer(playing=False, speed=1.0, time=BEGIN + 60)
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    made = Screen(page)
    page.goto(replaying.url)
    made.until("window.airside && airside.counts().targets > 0 && document.querySelector('#loading').hidden")
    made.until("airside.replay() !== null")
    yield made
    context.close()


def text(screen: Screen, selector: str) -> str:
    return str(screen.page.locator(selector).inner_text())


def test_it_is_unmistakably_a_replay_in_every_palette(screen: Screen) -> None:
    assert text(screen, "#mode") == "REPLAY · not live"
    assert text(screen, "#data-date") == "2026-11-27"
    assert text(screen, "#data-clock") == "11:21:00"
    assert text(screen, "#link") == "connected", "not: live"
    words = "2026-11-27 11:21:00 UTC"
    for palette in ("night", "day", "contrast"):
        plate, faint = screen.page.locator(".plate"), screen.page.locator(".watermark span")
        assert plate.is_visible(), palette
        assert "REPLAY" in plate.inner_text()
        assert words in plate.inner_text()
        assert set(faint.all_inner_texts()) == {f"REPLAY {words}"}
        size = plate.locator("b").evaluate("(one) => parseFloat(getComputedStyle(one).fontSize)")
        assert size >= 30
        assert plate.evaluate("(one) => getComputedStyle(one).pointerEvents") == "none"
        letters = plate.locator("b").evaluate("(one) => getComputedStyle(one).color")
        ground = screen.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert contrast(letters, ground) > 4.5, palette
        screen.page.keyboard.press("p")
    order = "(one) => [...one.children].map((child) => child.className.split(' ').at(-1))"
    assert screen.page.locator("#stage").evaluate(order).index("watermark") == 2, "over the map, under the targets"
    assert screen.errors == []


def contrast(first: str, second: str) -> float:
    """The contrast ratio of WCAG 2.1 of two colours as the browser writes them."""

    def luminance(colour: str) -> float:
        parts = [int(one) / 255 for one in re.findall(r"\d+", colour)[:3]]
        linear = [one / 12.92 if one <= 0.03928 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    light, dark = sorted((luminance(first), luminance(second)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_everything_fits_on_the_screen(screen: Screen) -> None:
    for width, height in ((1280, 800), (1920, 1080)):
        screen.page.set_viewport_size({"width": width, "height": height})
        for selector in ("#help-toggle", "#replay-speed button:last-child", "#replay-play", "#replay-seek", ".plate"):
            box = screen.page.locator(selector).bounding_box()
            assert box is not None, selector
            assert box["x"] >= 0, selector
            assert box["x"] + box["width"] <= width, selector
            assert box["y"] + box["height"] <= height, selector


def test_play_and_pause_by_button_and_by_key(screen: Screen, replay: FakeReplay) -> None:
    play = screen.page.locator("#replay-play")
    assert play.get_attribute("aria-label") == "Play"
    play.click()
    until(lambda: replay.state().playing, "it plays")
    screen.until(f"airside.time() > {BEGIN + 60.5}")
    until(lambda: play.get_attribute("aria-label") == "Pause", "the button offers the pause")
    screen.page.locator("#stage").focus()
    screen.page.keyboard.press(" ")
    until(lambda: not replay.state().playing, "it is paused")
    stopped = replay.state().time
    screen.until(f"Math.abs(airside.time() - {stopped}) < 0.001")
    until(lambda: "paused" in text(screen, ".plate"), "the plate says so")
    until(lambda: text(screen, "#data-age") == "paused", "the age of the data says so")
    screen.page.keyboard.press("]")
    screen.page.locator("#replay-speed button", has_text="8×").click()
    until(lambda: replay.state().speed == 8.0, "the pace is chosen")
    until(lambda: screen.page.locator("#replay-speed button[aria-pressed=true]").inner_text() == "8×", "it is shown")
    assert screen.errors == []


def test_seeking_back_shows_the_picture_of_then_and_nothing_of_before(
    screen: Screen, replaying: Serving, replay: FakeReplay
) -> None:
    replay.steer(time=BEGIN + 600)
    screen.until(f"airside.time() === {BEGIN + 600}")
    alert = replaying.service.raise_alert()
    replaying.service.step()
    screen.until(f"airside.alerts().length === 1 && airside.replay().time === {BEGIN + 600}")
    epoch = screen.ask("position().epoch")
    screen.page.locator("#stage").focus()
    screen.page.keyboard.press(",")
    until(lambda: replay.state().time == pytest.approx(BEGIN + 590, abs=0.01), "it went back 10 s")
    screen.until("airside.alerts().length === 0")
    assert screen.ask("counts().cleared") == 0, f"alert {alert.id} has not been raised yet"
    screen.until(f"airside.position() && airside.position().epoch !== {epoch!r}")
    screen.until(f"Math.abs(airside.time() - {BEGIN + 590}) < 0.01")
    tracks = replaying.service.step().tracks
    first = "airside.positions().find((one) => one.id === 1)"
    east, north = tracks.state[0, 0], tracks.state[0, 1]
    screen.until(f"Math.hypot({first}.e - {east}, {first}.n - {north}) < 1")
    assert screen.page.locator(".mark-information").count() == 1, "the alert that was met is on the line"
    assert screen.errors == []


def test_the_line_seeks_and_carries_the_gaps(screen: Screen, replay: FakeReplay) -> None:
    assert screen.page.locator(".mark-gap").count() == 2
    line = screen.page.locator("#replay-seek")
    box = line.bounding_box()
    assert box is not None
    screen.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert "11:35" in text(screen, "#replay-hint")
    screen.page.mouse.down()
    screen.page.mouse.move(box["x"] + box["width"] * 0.75, box["y"] + box["height"] / 2, steps=4)
    assert replay.state().time == BEGIN + 60, "nothing is sent while the knob is held"
    screen.page.mouse.up()
    until(lambda: replay.state().time > BEGIN + 60, "it sought")
    sought = replay.state().time
    assert sought == pytest.approx(BEGIN + 0.75 * LENGTH_S, abs=LENGTH_S * 0.02)
    shown = datetime.fromtimestamp(sought, UTC).strftime("%H:%M:%S")
    screen.until(f"document.querySelector('#replay-time').innerText === '{shown}'")
    screen.until(f"document.querySelector('#data-clock').innerText === '{shown}'")
    assert screen.errors == []


def test_nothing_commands_the_live_service(screen: Screen, replaying: Serving) -> None:
    alert = replaying.service.raise_alert()
    replaying.service.step()
    screen.until("airside.alerts().length === 1")
    screen.page.locator("#alert-list .alert").wait_for()
    assert screen.page.locator(".alert-ack:visible").count() == 0
    screen.page.keyboard.press("a")
    screen.page.locator("#toast", has_text="This is a replay").wait_for()
    assert replaying.service._alerts[alert.id].state == "new"
    button = screen.page.locator(".runway-set").first
    assert button.is_disabled()
    assert "replay" in str(button.get_attribute("title"))
    assert screen.page.locator("#parts").is_hidden()
    assert screen.errors == []


def test_a_pause_longer_than_the_limit_is_no_lost_feed(screen: Screen) -> None:
    screen.page.wait_for_timeout(4500)  # the limits are 2 s (lost) and 3 s (late)
    assert screen.ask("health()") == "ok"
    assert screen.page.locator("#banner").is_hidden()
    assert screen.ask("counts().feed.connects") == 1
    assert screen.errors == []


def test_a_replay_whose_service_is_gone_is_a_lost_feed(screen: Screen, replaying: Serving) -> None:
    replaying.down()
    try:
        screen.until("airside.health() === 'lost'")
        assert screen.page.locator("#banner").is_visible()
    finally:
        replaying.up()
    screen.until("airside.health() === 'ok'")
