"""The report: one page that holds everything it shows."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.evaluate.circumstances import circumstances
from app.evaluate.documents import markdown
from app.evaluate.gauge import gauge
from app.evaluate.page import page
from app.evaluate.plots import looks, svg
from app.evaluate.runs import carry_out
from pipeline.lab.evaluate import Figure, Line, Row
from tests.pipeline.lab.evaluate.toy import Toy

ABOUT = circumstances("airside evaluate all --seed 1 --quick")


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    one, two = carry_out("toy", Toy(trials=3)), carry_out("other", Toy(trials=2, title="Another <mean>"))
    return {"toy": page("toy", [one], [], ABOUT), "all": page("all", [one, two], ["filmed is left out"], ABOUT)}


def test_nothing_is_fetched_from_elsewhere(pages: dict[str, str]) -> None:
    for text in pages.values():
        links = re.findall(r'(?:src|href)="([^"]*)"', text) + re.findall(r"url\(([^)]*)\)", text)
        assert all(link.startswith(("#", "data:image/png;base64,")) for link in links)
        assert "<script" not in text
        assert "@import" not in text


def test_what_is_told_is_escaped_and_complete(pages: dict[str, str]) -> None:
    assert "&lt;eq. 1&gt;" in pages["toy"]
    assert "<eq. 1>" not in pages["toy"]
    assert "Another &lt;mean&gt;" in pages["all"]
    assert "filmed is left out" in pages["all"]
    for word in ("Reading", "NOT MET", "not reproduced", "airside evaluate all --seed 1 --quick", "numpy", "snr_db"):
        assert word in pages["toy"], word
    assert pages["toy"].count("<figure>") == len(Toy().figures([]))


def test_a_long_table_shows_first_what_there_is_something_to_compare_with() -> None:
    run = carry_out("toy", Toy(trials=2))
    more = tuple(Row(f"cell {number}", 1.0, 0.9, 1.1, "dB") for number in range(40))
    long = replace(run, rows=(*run.rows, *more))
    for text in (page("toy", [long], [], ABOUT), markdown([long], [], ABOUT)):
        before, after = text.split("41 more rows", 1)
        assert "NOT MET" in before
        assert "cell 7" not in before
        assert "cell 39" in after
    assert "more rows" not in page("toy", [run], [], ABOUT)


def test_names_inside_the_page_are_unique_and_lead_somewhere(pages: dict[str, str]) -> None:
    for text in pages.values():
        names = re.findall(r'\bid="([^"]*)"', text)
        assert len(names) == len(set(names))
        assert set(re.findall(r'(?:url\(#|href="#)([^")]+)', text)) <= set(names)


def test_plots_take_their_colours_from_the_page_and_come_out_the_same() -> None:
    for figure in Toy().figures([]):
        drawn = svg(figure, "salt")
        assert drawn == svg(figure, "salt")
        assert "var(--ink)" in drawn
        assert "#0a0" not in drawn


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("y", [np.zeros(3), np.array([np.nan, 1e-3, 0.0]), np.zeros(0), np.full(3, -1.0)])
def test_lines_that_are_hard_to_draw_are_drawn(y: np.ndarray, log: bool) -> None:
    x = np.arange(float(len(y)))
    lines = (Line("a", x, y, y - 1, y + 1), Line("b", x, y, y - 1, y + 1, "points"), Line("c", x, y, style="bound"))
    assert svg(Figure("t", "x $", "y_$", (*lines, Line("d", x, y, style="paper")), log_x=log, log_y=log), "s")


def test_the_papers_line_has_the_colour_of_ours() -> None:
    x = np.zeros(2)
    lines = (
        Line("cm", x, x),
        Line("hybrid", x, x),
        Line("hybrid (paper)", x, x, style="paper"),
        Line("w", x, x, style="bound"),
    )
    own, ours, paper, bound = looks(lines)
    assert paper.colour == ours.colour != own.colour
    assert bound.colour not in (own.colour, ours.colour)


def test_the_gauge_of_a_line_stays_inside_its_picture() -> None:
    rows = (
        Row("a", 1e-7, 0.0, 1e-3, "", 1e-6, 1e-6, "lower", 1e-6),
        Row("b", 5.0, 5.0, 5.0, "", 5.0),
        Row("c", 88.0, 80.0, float("inf"), "", None, 0.0, "higher", 90.0),
    )
    for row in rows:
        places = [float(one) for one in re.findall(r"(?:M|H|cx=\")([\d.]+)", gauge(row))]
        assert places
        assert all(0 <= place <= 132 for place in places)
    assert gauge(Row("d", 1.0, 1.0, 1.0, "")) == ""
    assert gauge(Row("e", float("nan"), 1.0, 1.0, "", 2.0)) == ""


@pytest.mark.browser
def test_a_browser_shows_it_without_complaint_on_wide_and_narrow_screens(pages: dict[str, str], tmp_path: Path) -> None:
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium on this machine: the report was not tried in a browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        for name, text in pages.items():
            (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
            for scheme, width in (("light", 1280), ("dark", 390)):
                view = browser.new_page(color_scheme=scheme, viewport={"width": width, "height": 900})
                complaints: list[str] = []
                view.on("console", lambda one, said=complaints: said.append(one.text))
                view.on("pageerror", lambda one, said=complaints: said.append(str(one)))
                view.goto((tmp_path / f"{name}.html").as_uri())
                assert view.evaluate("document.documentElement.scrollWidth") <= width
                ink, ground = (
                    view.evaluate(f"getComputedStyle(document.body).{which}.match(/\\d+/g).map(Number)")
                    for which in ("color", "backgroundColor")
                )
                assert abs(sum(ink) - sum(ground)) > 450, "text must stand out"
                assert complaints == []
                view.close()
        browser.close()
