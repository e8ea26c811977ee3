"""What is painted on a runway: threshold bars, designators, centreline, aiming points, side stripes.

Proportions after ICAO Annex 14, section 5.2; designators are painted larger than life so that they can be read from
the tower.
"""

from __future__ import annotations

import numpy as np
from shapely.affinity import affine_transform
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from pipeline.airport.model import Runway, RunwayEnd

BAR_M = 30.0
DIGIT_HEIGHT_M = 36.0
DIGIT_WIDTH_M = 13.0
STROKE_M = 3.2
DASH_M, GAP_M = 30.0, 20.0
AIMING_M = 400.0

# Seven segments: top, upper left, upper right, middle, lower left, lower right, bottom.
SEGMENTS = {
    "0": "1110111", "1": "0010010", "2": "1011101", "3": "1011011", "4": "0111010", "5": "1101011", "6": "1101111",
    "7": "1010010", "8": "1111111", "9": "1111011", "L": "0100101", "C": "1100101", "R": "1111110",
}  # fmt: skip


def runway_paint(runway: Runway) -> list[BaseGeometry]:
    """The painted shapes in local metres; they may reach a little over the pavement's edge."""
    length = runway.centreline.length
    shapes: list[BaseGeometry] = []
    for end in runway.ends:
        shapes += [_placed(one, end) for one in _end_marks(end.designator, runway.width, length)]
    first = runway.ends[0]
    reach = first.threshold.distance(runway.ends[1].threshold)
    start = 6.0 + BAR_M + 12.0 + DIGIT_HEIGHT_M + 24.0
    for x in np.arange(start, reach - start - DASH_M, DASH_M + GAP_M):
        shapes.append(_placed(box(x, -0.6, x + DASH_M, 0.6), first))
    shapes.append(runway.strip.difference(runway.strip.buffer(-1.1)))
    return shapes


def glyph(character: str) -> list[Polygon]:
    """One digit or letter, upright in x from 0 to its width and y from 0 to its height; nothing for others."""
    lit = SEGMENTS.get(character, "0000000")
    w, h, s = DIGIT_WIDTH_M, DIGIT_HEIGHT_M, STROKE_M
    middle = h / 2
    all_of = (
        box(0, h - s, w, h), box(0, middle, s, h), box(w - s, middle, w, h), box(0, middle - s / 2, w, middle + s / 2),
        box(0, 0, s, middle), box(w - s, 0, w, middle), box(0, 0, w, s),
    )  # fmt: skip
    return [one for one, on in zip(all_of, lit, strict=True) if on == "1"]


def _end_marks(designator: str, width: float, length: float) -> list[BaseGeometry]:
    """Marks of one end: x along the landing direction from the threshold, y to the left."""
    shapes: list[BaseGeometry] = []
    pairs = max(2, int(width / 2 / 3.7) - 1)
    for k in range(pairs):
        near = 1.4 + k * 3.7
        shapes += [box(6, near, 6 + BAR_M, near + 1.9), box(6, -near - 1.9, 6 + BAR_M, -near)]
    shapes += _text(designator, 6 + BAR_M + 12)
    if length > 2 * AIMING_M + 200:
        shapes += [box(AIMING_M, 6, AIMING_M + 50, 13), box(AIMING_M, -13, AIMING_M + 50, -6)]
    return shapes


def _text(text: str, x: float) -> list[BaseGeometry]:
    """Read by a pilot who lands: up is ahead, right is to the right."""
    gap = 4.0
    left = (len(text) * DIGIT_WIDTH_M + (len(text) - 1) * gap) / 2
    made: list[BaseGeometry] = []
    for k, character in enumerate(text):
        aside = left - k * (DIGIT_WIDTH_M + gap)
        made += [affine_transform(one, [0, 1, -1, 0, x, aside]) for one in glyph(character)]
    return made


def _placed(shape: BaseGeometry, end: RunwayEnd) -> BaseGeometry:
    along = (np.sin(end.heading), np.cos(end.heading))
    left = (-along[1], along[0])
    return affine_transform(shape, [along[0], left[0], along[1], left[1], end.threshold.x, end.threshold.y])
