"""Plots of the report: matplotlib to SVG whose colours are the page's custom properties, for light and for dark."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from pipeline.lab.evaluate import Figure, Line, Picture

SERIES = 8
"""Colours of lines, `--s0` and on, of the page's style sheet."""
_INK, _DIM, _GRID = "#0a0b01", "#0a0b02", "#0a0b03"
_PROPERTIES = {_INK: "--ink", _DIM: "--dim", _GRID: "--grid"} | {f"#0a0c0{k}": f"--s{k}" for k in range(SERIES)}
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.size": 10.5,
    "axes.edgecolor": _DIM,
    "axes.labelcolor": _INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10.5,
    "axes.titlecolor": _INK,
    "text.color": _INK,
    "xtick.color": _DIM,
    "xtick.labelcolor": _INK,
    "ytick.color": _DIM,
    "ytick.labelcolor": _INK,
    "grid.color": _GRID,
    "grid.linewidth": 0.8,
}
MARKED = 30
"""Up to so many points of a line are marked."""
WIDTH, HEIGHT = 11.0, 4.9
PAGE, LEAST = 1090, 620
"""Width in pixels of a plot that is WIDTH wide, and what no plot is narrower than: narrow screens scroll it."""


@dataclass(frozen=True)
class Look:
    """How a line is drawn. colour: as matplotlib sees it, a stand-in. dash: lengths on and off; () is solid."""

    colour: str
    dash: tuple[float, ...]
    marker: str
    width: float

    @property
    def css(self) -> str:
        """The colour as the page sees it."""
        return f"var({_PROPERTIES[self.colour]})"


def looks(lines: tuple[Line, ...]) -> list[Look]:
    """One look a line. A line of the paper has the colour of ours of the same name, as in "hybrid, paper"."""
    own = [line for line in lines if line.style in ("line", "points")]
    place = {_core(line.label): k for k, line in reversed(list(enumerate(own)))}
    made = []
    for line in lines:
        if line.style == "bound":
            made.append(Look(_DIM, (2.0, 3.0), "", 1.4))
        elif line.style == "paper":
            k = place.get(_core(line.label))
            made.append(Look(_INK if k is None else f"#0a0c0{k % SERIES}", (7.0, 4.0), "o", 1.5))
        else:
            k = next(number for number, one in enumerate(own) if one is line)
            dash = ((), (6.0, 2.5), (2.0, 2.0))[k // SERIES % 3] if line.style == "line" else ()
            marked = line.style == "points" or len(line.x) <= MARKED
            made.append(Look(f"#0a0c0{k % SERIES}", dash, _MARKERS[k % len(_MARKERS)] if marked else "", 2.0))
    return made


def svg(figure: Figure, salt: str) -> str:
    """The figure as inline SVG. salt: keeps names inside it apart from those of other figures of the page."""
    with mpl.rc_context({**_STYLE, "svg.hashsalt": salt}):
        canvas = _pictures(figure) if figure.pictures else _lines(figure)
        out = io.StringIO()
        canvas.savefig(
            out, format="svg", transparent=True, dpi=160, metadata={"Date": None, "Creator": None}, bbox_inches="tight"
        )
    return _inline(out.getvalue(), figure)


def _lines(figure: Figure) -> Canvas:
    canvas = Canvas(figsize=(WIDTH, HEIGHT), layout="constrained")
    axes = canvas.add_subplot()
    for line, look in zip(figure.lines, looks(figure.lines), strict=True):
        _draw(axes, line, look, figure.log_y)
    axes.set_xlabel(_text(figure.x))
    axes.set_ylabel(_text(figure.y))
    axes.grid(True, axis="both")
    axes.set_axisbelow(True)
    if figure.log_x and _positive(line.x for line in figure.lines):
        axes.set_xscale("log", nonpositive="mask")
    if figure.log_y and _positive(line.y for line in figure.lines):
        axes.set_yscale("log", nonpositive="mask")
    axes.margins(x=0.02)
    return canvas


def _draw(axes: Axes, line: Line, look: Look, log_y: bool) -> None:
    x, y = np.asarray(line.x, np.float64), np.asarray(line.y, np.float64)
    banded = line.low is not None and line.high is not None
    if banded and line.style == "points":
        low, high = np.asarray(line.low, np.float64), np.asarray(line.high, np.float64)
        reach = np.maximum(0.0, np.stack((y - low, high - y)))
        axes.errorbar(x, y, yerr=reach, fmt="none", ecolor=look.colour, elinewidth=1.2, capsize=2.5)
    elif banded:
        low, high = np.asarray(line.low, np.float64), np.asarray(line.high, np.float64)
        if log_y and bool((high > 0).any()):
            low = np.maximum(low, 0.1 * high[high > 0].min())  # a band down to nothing has no place on a log axis
        axes.fill_between(x, low, high, color=look.colour, alpha=0.16, linewidth=0)
    if line.style == "bound" and len(x) == 1:
        axes.axhline(y[0], color=look.colour, linewidth=look.width, linestyle=(0, look.dash))
        return
    axes.plot(
        x,
        y,
        color=look.colour,
        linewidth=look.width,
        linestyle="none" if line.style == "points" else (0, look.dash) if look.dash else "-",
        marker=look.marker,
        markersize=5.5,
        markerfacecolor="none" if line.style == "paper" else look.colour,
        zorder=2.5 if line.style == "bound" else 3,
    )


def _pictures(figure: Figure) -> Canvas:
    many = len(figure.pictures)
    columns = min(many, 3 if many != 4 else 2)
    rows = math.ceil(many / columns)
    shape = [_shape(one) for one in figure.pictures]
    tall = float(np.clip(np.mean([high / wide for wide, high in shape]), 0.35, 1.5))
    canvas = Canvas(figsize=(WIDTH, rows * min(6.5, WIDTH / columns * tall + 0.7)), layout="constrained")
    for k, (picture, (wide, high)) in enumerate(zip(figure.pictures, shape, strict=True)):
        axes = canvas.add_subplot(rows, columns, k + 1)
        values = np.asarray(picture.values)
        yes_or_no = values.dtype.kind in "bu" and bool(values.max(initial=0) <= 1)
        drawn = axes.imshow(
            values.astype(np.float32),
            origin="lower",
            extent=picture.extent,
            cmap="Greys_r" if yes_or_no else "viridis",
            aspect="equal" if 0.3 <= high / wide <= 3.0 else "auto",
            interpolation="nearest",
        )
        axes.set_title(_text(picture.label), loc="left")
        axes.set_xlabel(_text(figure.x))
        axes.set_ylabel(_text(figure.y if k % columns == 0 else ""))
        if picture.marks is not None and len(picture.marks):
            marks = np.asarray(picture.marks, np.float64)
            axes.plot(marks[:, 0], marks[:, 1], "+", color="#ff4d4f", markersize=9, markeredgewidth=1.6)
        if not yes_or_no:
            bar = canvas.colorbar(drawn, cax=axes.inset_axes((1.025, 0.0, 0.03, 1.0)))
            bar.set_label(_text(picture.unit))
            bar.outline.set_visible(False)
    return canvas


def _shape(picture: Picture) -> tuple[float, float]:
    """(width, height) in the units of the axes."""
    if picture.extent is None:
        high, wide = np.asarray(picture.values).shape
        return float(wide), float(high)
    left, right, bottom, top = picture.extent
    return abs(right - left) or 1.0, abs(top - bottom) or 1.0


def _inline(document: str, figure: Figure) -> str:
    """The svg element alone, with the page's colours and without names that nothing refers to."""
    text = document[document.index("<svg") :]
    for colour, name in _PROPERTIES.items():
        text = text.replace(colour, f"var({name})")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    referred = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))
    text = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in referred else "", text)
    text = re.sub(r"font: ([\d.]+)px '[^;\"]*", r"font: \1px system-ui, 'DejaVu Sans', sans-serif", text)
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    title = figure.title.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    size = re.search(r'viewBox="0 0 ([\d.]+)', text)
    wide = round((float(size[1]) if size else 72 * WIDTH) * PAGE / (72 * WIDTH))
    style = f"max-width: {wide}px; min-width: {min(wide, LEAST)}px"  # narrow pictures are not blown up
    return text.replace("<svg", f'<svg role="img" aria-label="{title}" style="{style}"', 1).strip()


def _positive(values: Iterable[Any]) -> bool:
    arrays: list[NDArray[np.float64]] = [np.asarray(one, np.float64) for one in values]
    return any(bool((one > 0).any()) for one in arrays)


def _text(words: str) -> str:
    return words.replace("$", r"\$")  # matplotlib would take it for mathematics


def _core(label: str) -> str:
    """What a label names, whether the paper's or ours."""
    return " ".join(word for word in re.split(r"[\s,:;()]+", label.lower()) if word not in ("paper", "the", "ours", ""))
