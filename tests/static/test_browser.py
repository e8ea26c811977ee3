"""The display in a real browser, against the real web application."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.static.conftest import Screen
from tests.static.serving import Serving, changing_host
from tests.support.running import until

pytestmark = pytest.mark.browser


@pytest.fixture
def alarm(serving: Serving) -> Iterator[int]:
    made = serving.service.raise_alert()
    serving.service.update_alert(made.id, stage="alarm", state="ongoing")
    yield made.id
    if made.id in serving.service._alerts:
        serving.service.clear_alert(made.id)


def text(screen: Screen, selector: str) -> str:
    return str(screen.page.locator(selector).inner_text())


def test_targets_are_shown_and_move_smoothly(screen: Screen, serving: Serving) -> None:
    assert screen.ask("counts().targets") == 40
    frames = screen.page.evaluate(
        """async () => {
          const id = airside.positions().find((one) => one.id === 1).id;
          const seen = [];
          for (let i = 0; i < 45; i += 1) {
            await new Promise(requestAnimationFrame);
            const now = airside.positions().find((one) => one.id === id);
            seen.push([performance.now(), now.e, now.n]);
          }
          return seen;
        }"""
    )
    steps = [
        (((b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2) ** 0.5, (b[0] - a[0]) / 1000) for a, b in itertools.pairwise(frames)
    ]
    assert sum(step for step, _ in steps) > 5, "the aircraft on the runway moves"
    # 65 m/s between updates; a correction may add to that for a moment, but nothing jumps
    assert all(step < 65 * max(dt, 0.07) * 3 + 5 for step, dt in steps)
    assert screen.ask("counts().drawErrors") == 0
    assert screen.errors == []


def test_every_layer_has_something_on_it(screen: Screen) -> None:
    screen.page.keyboard.press("r")
    screen.until("airside.counts().radarPictures > 0")
    screen.until(
        """(() => {
          const counts = [...document.querySelectorAll('canvas.layer')].map((canvas) => {
            // a copy that says it will be read: reading the layer itself more than once makes Chromium warn
            const { width, height } = canvas;
            const copy = Object.assign(document.createElement('canvas'), { width, height });
            const pen = copy.getContext('2d', { willReadFrequently: true });
            pen.drawImage(canvas, 0, 0);
            const { data } = pen.getImageData(0, 0, width, height);
            let count = 0;
            for (let i = 3; i < data.length; i += 4) if (data[i] > 20) count += 1;
            return count;
          });
          return counts.length === 4 && counts.every((count) => count > 500);
        })()"""
    )
    assert screen.errors == []


def test_an_alarm_appears_and_is_acknowledged(screen: Screen, serving: Serving, alarm: int) -> None:
    screen.until("airside.alerts().some((one) => one.stage === 'alarm')")
    item = screen.page.locator("#alert-list .alert.alarm.open")
    item.wait_for()
    assert "ALARM" in item.inner_text()
    assert "RWY 06/24" in item.inner_text()
    assert "Alarm" in text(screen, "#announce")
    scale = screen.ask("view().scale")
    item.locator(".alert-open").click()
    assert screen.ask("view().scale") != scale, "a click on the alert brings it into the picture"
    item.locator(".alert-ack").click()
    screen.page.locator("#alert-list .alert.alarm.acknowledged").wait_for()
    assert serving.service._alerts[alarm].state == "acknowledged"
    serving.service.clear_alert(alarm)
    screen.until("airside.alerts().length === 0 && airside.counts().cleared > 0")
    screen.page.locator("#alert-none").wait_for()
    assert screen.errors == []


def test_the_key_acknowledges_too(screen: Screen, serving: Serving, alarm: int) -> None:
    screen.until("airside.alerts().length === 1")
    screen.page.keyboard.press("a")
    screen.until("airside.alerts()[0]?.state === 'acknowledged'")
    assert serving.service._alerts[alarm].acknowledged_by == "display"


def test_an_alarm_flashes_at_most_once_a_second_and_not_at_all_when_motion_is_unwanted(
    screen: Screen, alarm: int
) -> None:
    item = screen.page.locator("#alert-list .alert.alarm.open")
    item.wait_for()
    style = "(one) => [getComputedStyle(one).animationName, parseFloat(getComputedStyle(one).animationDuration)]"
    name, seconds = item.evaluate(style)
    assert name != "none"
    assert seconds >= 1.0
    screen.page.emulate_media(reduced_motion="reduce")
    assert item.evaluate(style)[0] == "none"


def test_a_lost_feed_is_shown_and_comes_back(screen: Screen, serving: Serving) -> None:
    assert not screen.page.locator("#banner").is_visible()
    serving.down()
    try:
        screen.until("airside.health() === 'lost'")
        banner = screen.page.locator("#banner")
        banner.wait_for()
        assert "FEED LOST" in banner.inner_text()
        box = banner.bounding_box()
        assert box is not None
        assert box["width"] == 1280
        assert "grayscale" in screen.page.locator("canvas.layer").first.evaluate(
            "(one) => getComputedStyle(one).filter"
        )
    finally:
        serving.up()
    screen.until("airside.health() === 'ok'")
    screen.page.locator("#banner").wait_for(state="hidden")
    assert screen.ask("counts().targets") == 40
    real = [one for one in screen.errors if not re.search(r"WebSocket|ERR_CONNECTION|Failed to load", one)]
    assert real == []


def test_the_keyboard_drives_the_view_and_the_settings(screen: Screen) -> None:
    keys = screen.page.keyboard
    before = screen.ask("view()")
    keys.press("ArrowRight")
    assert screen.ask("view().east") > before["east"]
    keys.press("+")
    assert screen.ask("view().scale") > before["scale"]
    keys.press("e")
    assert screen.ask("view().rotation") > 0
    keys.press("n")
    assert screen.ask("view().rotation") == 0
    for key, name in (("v", "vector"), ("h", "history"), ("l", "labels"), ("p", "palette"), ("r", "radar")):
        old = screen.ask(f"choices().{name}")
        keys.press(key)
        assert screen.ask(f"choices().{name}") != old, name
    keys.press("?")
    assert screen.page.locator("#help").is_visible()
    keys.press("Escape")
    assert not screen.page.locator("#help").is_visible()
    keys.press("/")
    keys.type("VEH02")
    keys.press("Enter")
    assert screen.ask("selected()") == 3
    assert "VEH02" in text(screen, "#target-name")
    keys.press("Escape")
    keys.press("Escape")
    assert screen.ask("selected()") is None
    assert screen.errors == []


def test_choices_and_view_survive_a_reload(screen: Screen) -> None:
    screen.page.keyboard.press("p")
    screen.page.keyboard.press("+")
    scale = screen.ask("view().scale")
    screen.page.wait_for_url(re.compile(r"z="))
    screen.page.reload()
    screen.until("window.airside && airside.counts().targets > 0 && document.querySelector('#loading').hidden")
    assert screen.ask("choices().palette") == "day"
    assert screen.page.locator("html").get_attribute("data-palette") == "day"
    assert screen.ask("view().scale") == pytest.approx(scale, rel=1e-3)


def test_a_runway_is_closed_and_opened_from_its_menu(screen: Screen, serving: Serving) -> None:
    card = screen.page.locator("#runway-list .runway", has_text="07/25")
    card.locator(".runway-set").click()
    card.get_by_role("menuitemradio", name="Closed").click()
    assert serving.service.runways["07/25"].open is True, "it asks first"
    screen.page.keyboard.press("Enter")
    card.locator(".menu").wait_for(state="detached")
    assert serving.service.runways["07/25"].open is True, "an Enter too many does not close it"
    card.locator(".runway-set").click()
    card.get_by_role("menuitemradio", name="Closed").click()
    card.get_by_role("menuitem", name="Close runway 07/25").click()
    card.locator(".chip.closed").wait_for()
    assert serving.service.runways["07/25"].open is False
    card.locator(".runway-set").click()
    card.get_by_role("menuitemradio", name="Open").click()
    card.locator(".chip.closed").wait_for(state="detached")
    assert screen.errors == []


def test_a_closed_runway_is_as_before_after_undo_and_undo_is_offered_for_10_s(screen: Screen, serving: Serving) -> None:
    serving.service.set_runway("06/24", open=True, in_use="24", visibility="low")
    before = serving.service.runways["06/24"]
    card = screen.page.locator("#runway-list .runway", has_text="06/24")
    card.locator(".chip.lvp").wait_for()
    undo = card.locator(".runway-undo")
    assert undo.is_hidden()
    try:
        for wanted in (True, False):
            card.locator(".runway-set").click()
            card.get_by_role("menuitemradio", name="Closed").click()
            card.get_by_role("menuitem", name="Close runway 06/24").click()
            card.locator(".chip.closed").wait_for()
            undo.wait_for()
            if wanted:
                undo.click()
                until(lambda: serving.service.runways["06/24"] == before, "all of it is as it was")
                undo.wait_for(state="hidden")
                card.locator(".chip.closed").wait_for(state="detached")
        undo.wait_for(state="hidden", timeout=20000)
        assert serving.service.runways["06/24"].open is False
    finally:
        serving.service.set_runway("06/24", open=True, in_use="06", visibility="normal")
    assert screen.errors == []


def test_t_moves_the_focus_into_the_list_and_back(screen: Screen) -> None:
    page = screen.page
    focus = "document.activeElement.closest('#list-rows') !== null"
    page.keyboard.press("t")
    assert page.evaluate(focus)
    first = page.evaluate("document.activeElement.textContent")
    north = screen.ask("view().north")
    page.keyboard.press("ArrowDown")
    assert screen.ask("view().north") == north, "the arrows go through the list"
    assert page.evaluate(focus)
    assert page.evaluate("document.activeElement.textContent") != first
    page.keyboard.press("Enter")
    assert screen.ask("selected()") is not None
    page.keyboard.press("t")
    assert page.locator("#list").is_hidden()
    assert page.evaluate("document.activeElement.id") == "stage", "the focus does not stay in what is hidden"
    page.keyboard.press("t")
    assert page.evaluate("document.activeElement.getAttribute('aria-current')") == "true", (
        "it begins at the selected one"
    )
    assert screen.errors == []


def test_a_page_that_the_service_refuses_says_why(serving: Serving, browser: Any) -> None:
    """A proxy that does not pass on the Host of the request makes the page one of another origin."""
    with changing_host(serving.port, "localhost") as port:
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{port}")
        banner = page.locator("#banner", has_text="allowed_origins")
        banner.wait_for(timeout=20000)
        assert f"http://127.0.0.1:{port}" in banner.inner_text()
        assert "localhost" in banner.inner_text()
        assert page.locator("#link").inner_text() == "refused"
        page.close()


def test_the_wheel_zooms_at_the_cursor_and_a_click_selects(screen: Screen) -> None:
    page = screen.page
    host = page.locator("#stage").bounding_box()
    assert host is not None
    x, y = 300.0, 200.0

    def under() -> Any:
        view = screen.ask("view()")
        return (
            view["east"] + (x - view["width"] / 2) / view["scale"],
            view["north"] - (y - view["height"] / 2) / view["scale"],
        )

    page.mouse.move(host["x"] + x, host["y"] + y)
    before, scale = under(), screen.ask("view().scale")
    page.mouse.wheel(0, -240)
    screen.until(f"airside.view().scale > {scale}")
    assert under() == pytest.approx(before, abs=0.5)
    page.keyboard.press("0")
    frames = screen.ask("counts().frames")
    screen.until(f"airside.counts().frames > {frames} + 1")
    standing = next(one for one in screen.ask("positions()") if one["id"] == 6)
    page.mouse.click(host["x"] + standing["x"], host["y"] + standing["y"])
    assert screen.ask("selected()") is not None
    assert page.locator("#target").is_visible()


def test_the_picture_says_what_it_is(screen: Screen) -> None:
    assert "DEMO" in text(screen, "#mode")
    assert "OpenStreetMap" in text(screen, "#credit")
    assert re.fullmatch(r"\d\d:\d\d:\d\d", text(screen, "#data-clock"))
    screen.until("document.querySelector('#sensor-list').innerText.includes('silent')")
    name = screen.page.locator("button.sensor-name").first
    assert screen.page.locator(".sensor-all").first.is_hidden()
    name.click()
    assert screen.page.locator(".sensor-all").first.is_visible()
    assert name.get_attribute("aria-expanded") == "true"
    assert text(screen, "#sound") == "sound off"
    screen.page.locator("#sound").click()
    assert text(screen, "#sound") == "sound on"
    hrefs = [one.get_attribute("href") for one in screen.page.locator(".bar a").all()]
    assert hrefs == ["3d/", "docs/"]
    policy = screen.page.request.get(screen.page.url).headers["content-security-policy"]
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    replaced = "(() => { try { window.airside = 1 } catch {} return typeof airside.counts })()"
    assert screen.page.evaluate(replaced) == "function", "the hook cannot be replaced"
    screen.page.evaluate("airside.choices().vector = 99")
    assert screen.ask("choices().vector") != 99


def test_hostile_text_stays_text(screen: Screen, serving: Serving) -> None:
    made = serving.service.raise_alert(text="<img src=x onerror=alert(1)>")
    try:
        screen.page.locator("#alert-list .alert-text", has_text="<img").wait_for()
        assert screen.page.locator("#alert-list img").count() == 0
    finally:
        serving.service.clear_alert(made.id)
    screen.until("airside.alerts().length === 0")
    assert screen.errors == []


def test_a_layer_that_cannot_be_drawn_says_so_and_the_rest_goes_on(screen: Screen) -> None:
    screen.page.evaluate(
        """() => {
          window.kept = CanvasRenderingContext2D.prototype.fillText;
          CanvasRenderingContext2D.prototype.fillText = () => { throw new Error('broken on purpose'); };
        }"""
    )
    screen.until("airside.health() === 'fault'")
    assert "DISPLAY FAULT" in text(screen, "#banner")
    frames = screen.ask("counts().frames")
    screen.until(f"airside.counts().frames > {frames} + 5")
    screen.page.evaluate("() => { CanvasRenderingContext2D.prototype.fillText = window.kept; }")
    screen.until("airside.health() === 'ok'")


def test_the_parts_of_a_radar_are_changed_with_the_keyboard_alone(screen: Screen, serving: Serving) -> None:
    page = screen.page

    def running() -> Any:
        return serving.service.front_end("smr-1").running["detect"]["name"]

    for name in ("hybrid", "adaptive"):  # compiled before it is waited for
        serving.service.choose_parts("smr-1", {"detect": {"name": name}})
    assert running() == "adaptive"
    page.locator("#processing-open summary").wait_for()
    page.locator("#processing-open summary").focus()
    page.keyboard.press("Enter")
    first = page.locator('#processing-list [data-key="smr-1"]')
    first.wait_for()
    assert "214 plots a turn" in first.inner_text()
    assert "18 ms" in first.inner_text()
    assert first.locator(".processing-apply").is_hidden()
    page.keyboard.press("Tab")
    page.keyboard.type("hyb")
    first.locator(".processing-apply").wait_for()
    assert running() == "adaptive", "nothing is sent before it is applied"
    for _ in range(8):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.classList.contains('processing-apply')"):
            break
    page.keyboard.press("Enter")
    until(lambda: running() == "hybrid", "the hybrid detector runs")
    screen.until("document.querySelector('#processing-list .processing-words').textContent === ''")
    assert first.locator(".processing-orders").is_hidden()
    assert page.evaluate("document.activeElement.tagName") == "SELECT", "the keyboard is not lost"
    first.locator("select").first.select_option("adaptive")
    first.locator(".processing-orders .plain").click()
    assert first.locator("select").first.input_value() == "hybrid"
    serving.service.choose_parts("smr-1", {"detect": {"name": "adaptive"}})
    screen.until("document.querySelector('#processing-list select').value === 'adaptive'")
    assert screen.errors == []


def test_a_radar_that_leaves_something_out_is_told_in_words_until_it_is_over(screen: Screen, serving: Serving) -> None:
    words = "detections cut, 312 sweeps in the last 10 s"
    assert "smr-1" not in text(screen, "#degraded")
    serving.service.cut["smr-1"] = words
    try:
        screen.until("document.querySelector('#degraded').innerText.includes('◐ smr-1 degraded')")
        assert f"radar smr-1: {words}" in str(screen.page.locator("#degraded").get_attribute("title"))
        assert words in text(screen, '#sensor-list [data-key="smr-1"]')
    finally:
        serving.service.cut.clear()
    screen.until("!document.querySelector('#degraded').innerText.includes('smr-1')")
    assert screen.errors == []
