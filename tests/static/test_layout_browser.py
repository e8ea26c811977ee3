"""The display on small screens and at strong browser zoom."""

from __future__ import annotations

import numpy as np
import pytest

from tests.static.conftest import Screen
from tests.static.serving import Serving
from tests.support.fake_traffic import Mover

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("width", "height", "picture"),
    # a screen of 1280 x 800 at a browser zoom z has a viewport of 1280 / z; the least size of the picture, px
    [
        (853, 533, (560, 400)),
        (731, 457, (440, 340)),
        (640, 400, (390, 290)),
        (512, 320, (310, 200)),
        (390, 844, (390, 400)),
        (360, 640, (360, 300)),
        (820, 1180, (500, 1000)),
    ],
)
def test_the_picture_keeps_most_of_a_small_screen_and_alerts_stay_in_sight(
    screen: Screen, serving: Serving, width: int, height: int, picture: tuple[int, int]
) -> None:
    made = serving.service.raise_alert()
    try:
        screen.page.set_viewport_size({"width": width, "height": height})
        alert = screen.page.locator("#alert-list .alert").first
        alert.wait_for()
        screen.until(f"airside.view().width >= {picture[0]} && airside.view().height >= {picture[1]}")
        assert screen.page.evaluate("document.documentElement.scrollWidth") == width, "nothing is cut at the side"
        for selector in ("#stage", "#alert-list .alert-stage", ".bar button#help-toggle", ".bar #data-age", ".tools"):
            box = screen.page.locator(selector).first.bounding_box()
            assert box is not None, selector
            assert box["x"] >= 0, selector
            assert box["x"] + box["width"] <= width, selector
            assert box["y"] + box["height"] <= height, selector
        alert.locator(".alert-ack").click()  # in reach, by scrolling its panel where need be
        screen.until("airside.alerts()[0].state === 'acknowledged'")
    finally:
        serving.service.clear_alert(made.id)
    assert screen.errors == []


def test_on_a_phone_the_list_lies_over_the_picture_and_help_fits(screen: Screen) -> None:
    page = screen.page
    page.set_viewport_size({"width": 360, "height": 640})
    page.locator("#list-toggle").click()
    screen.until("document.querySelectorAll('#list-rows button').length > 0")
    assert screen.ask("view().width") == 360, "the open list takes nothing from the picture"
    box = page.locator("#list").bounding_box()
    assert box is not None
    assert box["x"] == 0
    assert box["width"] <= 360
    page.locator("#list-close").click()
    page.locator("#help-toggle").click()
    help_box = page.locator("#help").bounding_box()
    assert help_box is not None
    assert help_box["x"] >= 0
    assert help_box["x"] + help_box["width"] <= 360
    assert help_box["y"] + help_box["height"] <= 640
    assert page.locator("#help").evaluate("(one) => one.scrollWidth <= one.clientWidth"), "its text is not cut"


def test_no_label_is_cut_at_an_edge(screen: Screen) -> None:
    for width, height in ((360, 640), (1280, 800)):
        screen.page.set_viewport_size({"width": width, "height": height})
        screen.until("airside.labels().length > 10")
        for _ in range(10):
            view = screen.ask("view()")
            for one in screen.ask("labels()"):
                assert one["x"] >= -0.5, one
                assert one["y"] >= -0.5, one
                assert one["x"] + one["w"] <= view["width"] + 0.5, one
                assert one["y"] + one["h"] <= view["height"] + 0.5, one
            screen.page.wait_for_timeout(100)  # they move on


def test_what_stands_at_a_holding_position_is_labelled_however_far_one_zooms_out(
    screen: Screen, serving: Serving
) -> None:
    service = serving.service
    kept = list(service.movers)
    standing = [i for i, one in enumerate(kept) if one.speed == 0.0]
    holds = service.airport.holding_positions
    for i, hold in zip(standing, holds, strict=False):
        service.movers[i] = Mover(np.asarray(hold.line.coords), 0.0, 0.0)
    try:
        screen.page.locator("#stage").focus()
        for _ in range(4):
            screen.page.keyboard.press("-")
        assert screen.ask("view().scale") < 0.1
        wanted = {i + 1 for i, _ in zip(standing, holds, strict=False)}
        assert len(wanted) > 4
        shown = "new Set(airside.labels().map((one) => one.id))"
        screen.until(f"((shown) => {sorted(wanted)}.every((id) => shown.has(id)))({shown})")
    finally:
        service.movers[:] = kept
    assert screen.errors == []
