"""The small picture in a line of the report's table: ours with its interval, the paper's figure, the bound wanted."""

from __future__ import annotations

import math
from collections.abc import Callable

from app.evaluate import words
from pipeline.lab.evaluate import Row

WIDE, EDGE = 132.0, 8.0


def gauge(row: Row) -> str:
    """Inline SVG; nothing when there is nothing to compare with. Each line of the table has a scale of its own."""
    marks = [one for one in (row.paper, row.wanted) if one is not None and math.isfinite(one)]
    if not marks or not math.isfinite(row.measured):
        return ""
    low, high = (end if math.isfinite(end) else row.measured for end in (row.low, row.high))
    near = [] if row.paper is None else [row.paper - row.tolerance, row.paper + row.tolerance]
    values = [row.measured, low, high, *marks, *near]
    at = _scale(values)
    band = f'<path d="M{at(near[0]):.1f} 12H{at(near[1]):.1f}" stroke="var(--grid)" stroke-width="16"/>' if near else ""
    paper = (
        f'<path d="M{at(row.paper):.1f} 4v16" stroke="var(--dim)" stroke-width="2.5"/>' if row.paper is not None else ""
    )
    colour = "var(--bad)" if row.met is False or row.verdict == "not reproduced" else "var(--good)"
    told = f"ours {words.figure(row.measured)}"
    told += f", paper {words.figure(row.paper)}" if row.paper is not None else ""
    told += f", wanted {words.wanted(row)}" if row.wanted is not None else ""
    return (
        f'<svg viewBox="0 0 {WIDE:.0f} 24" role="img" aria-label="{told}" fill="none">'
        f'<path d="M{EDGE / 2:.0f} 12H{WIDE - EDGE / 2:.0f}" stroke="var(--grid)"/>{band}{paper}{_bound(row, at)}'
        f'<path d="M{at(low):.1f} 12H{at(high):.1f}" stroke="{colour}" stroke-width="3" opacity=".45"/>'
        f'<circle cx="{at(row.measured):.1f}" cy="12" r="4.2" fill="{colour}" stroke="var(--card)"/></svg>'
    )


def key(asked: bool) -> str:
    """What the signs mean."""
    paper = '<path d="M11 0v14" stroke="var(--dim)" stroke-width="2.5"/>'
    ours = (
        '<path d="M2 7H20" stroke="var(--good)" stroke-width="3" opacity=".45"/>'
        '<circle cx="11" cy="7" r="4.2" fill="var(--good)"/>'
    )
    bound = '<path d="M11 0v14M11 7h6M14 4l3 3-3 3" stroke="var(--accent)" stroke-width="1.6"/>'
    signs = [
        (ours, "ours with its 95 % interval"),
        (paper, "the paper, and what counts as reproduced"),
        *([(bound, "wanted: this way")] if asked else []),
    ]
    told = "".join(
        f'<span><svg viewBox="0 0 22 14" aria-hidden="true" fill="none">{one}</svg>{what}</span>' for one, what in signs
    )
    return f'<p class="key">{told}<span>each line has its own scale</span></p>\n'


def _bound(row: Row, at: Callable[[float], float]) -> str:
    if row.wanted is None:
        return ""
    place = at(row.wanted)
    head = {"higher": f"M{place:.1f} 4h6M{place + 3:.1f} 1.5l3 2.5-3 2.5", "near": ""}.get(
        row.better, f"M{place:.1f} 4h-6M{place - 3:.1f} 1.5l-3 2.5 3 2.5"
    )
    return f'<path d="M{place:.1f} 3v18{head}" stroke="var(--accent)" stroke-width="1.6"/>'


def _scale(values: list[float]) -> Callable[[float], float]:
    """A place for each value; by ratios when all are positive and far apart."""
    by_ratio = min(values) > 0 and max(values) > 20 * min(values)

    def measure(value: float) -> float:
        return math.log(value) if by_ratio else value

    least, most = min(map(measure, values)), max(map(measure, values))
    if most - least <= 1e-12 * max(abs(least), abs(most)):
        return lambda _: WIDE / 2
    return lambda value: EDGE + (WIDE - 2 * EDGE) * (measure(value) - least) / (most - least)
