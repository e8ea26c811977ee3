"""Bearing of greatest likelihood of a generic aircraft in the picture of the echo.

The echo is looked at in the frame of the line of sight, in decibels over its ground. Under every heading a plain
outline of generic proportions, blurred by the radar's resolution at this distance, is fitted with free place and
strength: what the fit leaves over tells how likely the heading is. All headings are looked at coarsely, the best ones
finely; an expected heading counts as it is sure. The types need not be known: the outline comes in a few sizes.
After Galati et al., "Airport surveillance processing chain for high resolution radar", section 4B, whose templates are
of known types.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.bearing.sense import pointed
from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected, TargetView
from pipeline.kernels.compiled import allocating, reassociating
from pipeline.kernels.correlate import belief, decibels, fit
from pipeline.kernels.echo import measured
from pipeline.kernels.planform import Planform, Templates, templates
from pipeline.kernels.scan_convert import convert, grid_of
from pipeline.sites import RadarSite
from pipeline.state import read_only
from pipeline.tables import VideoFormat

Floats = NDArray[np.float64]

FIELD = 1.26
"""Side of a template over the length of its aircraft: no part of it leaves it at any heading."""

NEAREST_WIDTH, RING_RATIO, MOST_RINGS = 1.5, 1.45, 8
"""m, resolution across of the first ring; of one ring over that of the ring before; rings at most."""

OTHER_AXES = 0.7
"""How much less than near the best heading the likelihood tells between headings far apart, where the outline that was
not there is what differs."""

PIXELS, SHIFT = 32, 3
"""Pixels of a template, a side, and those by which it is moved about the middle of the echo, each way; the coarse look
has half as many."""

COARSE = 3
"""Templates from one coarse trial to the next."""

MODES = 4
"""Headings that are looked at finely: two axes, both senses."""


@dataclass(frozen=True, eq=False)
class Bank:
    """The templates of one radar.

    widths: m, resolution across the line of sight of each ring. steps: m, side of a pixel of each size. fine: (rings,
    sizes, angles, pixels, pixels); coarse: the same with pixels twice as wide.
    """

    site: RadarSite
    widths: Floats
    steps: Floats
    fine: NDArray[np.float32]
    coarse: NDArray[np.float32]


@dataclass(frozen=True)
class MaximumLikelihood:
    """length_m, span_m, fuselage_m, sweep_deg: the generic aircraft. sizes: how many times as large it is tried.

    angles: headings of the templates, all around. contrast_db: of the outline over its ground. limit_db: what is
    brighter counts as this. cell_db: over the median of the ground, from which on a cell belongs to the echo.
    least_cells: echoes of fewer get no bearing. sharpness: likelihood of a resolution cell in proportion to one of
    independent normal errors. floor_deg: standard deviation that remains with very many cells. limit_deg: bearings less
    sure are not given. outliers: part of the expected headings that are wrong altogether.
    """

    length_m: float = 38.0
    span_m: float = 32.0
    fuselage_m: float = 4.0
    sweep_deg: float = 25.0
    sizes: tuple[float, ...] = (0.72, 1.0, 1.6)
    angles: int = 180
    contrast_db: float = 18.0
    limit_db: float = 22.0
    cell_db: float = 10.0
    least_cells: int = 12
    sharpness: float = 1.8
    floor_deg: float = 0.9
    limit_deg: float = 20.0
    outliers: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "sizes", tuple(float(one) for one in self.sizes))
        if not self.sizes or not all(0.2 <= one <= 5 for one in self.sizes):
            raise ValueError("sizes must be one or more numbers between 0.2 and 5")
        if min(self.length_m, self.span_m, self.fuselage_m) <= 0 or not 0 <= self.sweep_deg < 60:
            raise ValueError("the generic aircraft needs dimensions above 0 and a sweep from 0 to below 60 degrees")
        if self.angles < 36 or self.angles % COARSE:
            raise ValueError(f"angles must be 36 or more and a multiple of {COARSE}")
        if min(self.contrast_db, self.limit_db, self.cell_db, self.sharpness, self.floor_deg, self.limit_deg) <= 0:
            raise ValueError("contrast, limits, sharpness and floor must be above 0")
        if self.least_cells < 1 or not 0 <= self.outliers < 1:
            raise ValueError("least_cells must be 1 or more, outliers from 0 to below 1")

    def start(self, site: RadarSite) -> Bank:
        """The templates for the radar's resolution: from near, where the beam is narrow, to the last range cell."""
        return Bank(site, *_bank(self, site.video))

    def __call__(self, view: TargetView, expected: Expected | None, state: Bank) -> Bearing:
        """The bearing of one target."""
        site = state.site
        grid = grid_of(site, view.azimuth, view.range_m)
        db_per_step, beam = site.video.db_per_step, site.video.beamwidth_rad
        echo = measured(view.amplitude, view.plot, grid, beam, self.cell_db, db_per_step)
        if echo is None or echo.cells < self.least_cells:
            return NO_BEARING
        ring = int(np.argmin(np.abs(state.widths - echo.range_m * beam)))
        modes = np.empty((MODES, 3))
        prior = (math.nan, math.inf) if expected is None else (expected.heading, max(expected.sd, 1e-3))
        _search(
            read_only(view.amplitude), grid, (echo.east, echo.north, echo.azimuth, echo.background),
            (db_per_step, self.limit_db, self.sharpness * echo.resolution_cells, *prior, self.outliers),
            state.steps, state.coarse[ring], state.fine[ring], modes,
        )  # fmt: skip
        return self._judged(modes, expected)

    def _judged(self, modes: Floats, expected: Expected | None) -> Bearing:
        """The likeliest axis; the others count in its uncertainty by their distance and weight."""
        best = int(np.argmax(modes[:, 1]))
        bearing, top, variance = modes[best]
        if not (math.isfinite(top) and variance > 0):
            return NO_BEARING
        away = np.abs(np.mod(modes[:, 0] - bearing + math.pi / 2, math.pi) - math.pi / 2)
        weight = np.exp(OTHER_AXES * (modes[:, 1] - top))
        spread = float(weight @ away**2) / float(weight.sum())
        sd = math.sqrt(variance + spread + math.radians(self.floor_deg) ** 2)
        return pointed(float(bearing), sd, expected, math.radians(self.limit_deg))


@lru_cache(maxsize=8)
def _bank(part: MaximumLikelihood, video: VideoFormat) -> tuple[Floats, Floats, Templates, Templates]:
    farthest = (video.first_range_m + video.ranges * video.range_step_m) * video.beamwidth_rad
    widths = [NEAREST_WIDTH]
    while widths[-1] < farthest and len(widths) < MOST_RINGS:
        widths.append(widths[-1] * RING_RATIO)
    shapes = [
        Planform(one * part.length_m, one * part.span_m, one * part.fuselage_m, math.radians(part.sweep_deg))
        for one in part.sizes
    ]
    steps = np.array([FIELD * shape.length / PIXELS for shape in shapes])
    across = tuple(widths)
    fine = np.stack(
        [
            templates(shape, part.angles, PIXELS, float(step), video.range_step_m, across, part.contrast_db)
            for shape, step in zip(shapes, steps, strict=True)
        ],
        axis=1,
    )
    half = PIXELS // 2
    coarse = fine.reshape(*fine.shape[:3], half, 2, half, 2).mean(axis=(4, 6))
    coarse /= np.sqrt(np.square(coarse).sum(axis=(3, 4), keepdims=True))
    return np.array(widths), steps, read_only(fine), read_only(coarse, np.float32)


@reassociating
def _halved(picture: Any, out: Any) -> float:
    """The picture with pixels twice as wide; the sum of their squares is returned."""
    total = 0.0
    for i in range(out.shape[0]):
        a, b, row = picture[2 * i], picture[2 * i + 1], out[i]
        for j in range(row.size):
            k = np.uintp(2 * j)
            one = np.uintp(2 * j + 1)
            value = np.float32(0.25) * (a[k] + a[one] + b[k] + b[one])
            row[np.uintp(j)] = value
            total += value * value
    return total


@allocating
def _search(amplitude: Any, grid: Any, place: Any, rule: Any, steps: Any, coarse: Any, fine: Any, modes: Any) -> None:
    """The best headings, finely. modes: (n, 3) heading (rad from north), log likelihood, variance (rad^2)."""
    east, north, azimuth, background = place
    db_per_step, limit, resolution_cells = rule[0], rule[1], rule[2]
    prior = (rule[3], rule[4], rule[5])
    sizes, angles = fine.shape[0], fine.shape[1]
    turn = 2 * np.pi / angles
    side = PIXELS + 2 * SHIFT
    half = side // 2
    pictures = np.empty((sizes, side, side), np.float32)
    small = np.empty((sizes, half, half), np.float32)
    whole = whole_small = 1e-9
    for k in range(sizes):
        convert(amplitude, grid, (east, north, steps[k], azimuth, background), pictures[k])
        whole = max(whole, decibels(pictures[k], background, db_per_step, limit) * steps[k] ** 2)
        whole_small = max(whole_small, 4.0 * _halved(pictures[k], small[k]) * steps[k] ** 2)
    tries = angles // COARSE
    scores = np.full(tries, -np.inf)
    where = np.zeros((tries, 3), np.int64)
    for k in range(sizes):
        for a in range(tries):
            best: Any = np.float32(0.0)
            best_down = best_right = 0
            for down in range(SHIFT + 1):
                for right in range(SHIFT + 1):
                    value = fit(small[k], coarse[k, COARSE * a], down, right)
                    if value > best:
                        best, best_down, best_right = value, down, right
            left = max(1.0 - 4.0 * best * best * steps[k] ** 2 / whole_small, 1e-6)
            score = -0.5 * resolution_cells * np.log(left) + belief(azimuth + COARSE * a * turn, prior)
            if score > scores[a]:
                scores[a] = score
                where[a, 0], where[a, 1], where[a, 2] = k, best_down, best_right
    modes[:, 0], modes[:, 1], modes[:, 2] = 0.0, -np.inf, 0.0
    likely = np.empty(2 * COARSE + 3)
    for mode in range(modes.shape[0]):
        a = int(np.argmax(scores))
        if not np.isfinite(scores[a]):
            break
        for near in range(-2, 3):
            scores[(a + near) % tries] = -np.inf
        _refine(
            pictures[where[a, 0]], fine[where[a, 0]], COARSE * a, 2 * where[a, 1], 2 * where[a, 2],
            (azimuth, whole / steps[where[a, 0]] ** 2, resolution_cells), prior, likely, modes[mode],
        )  # fmt: skip


@allocating
def _refine(
    picture: Any, bank: Any, middle: int, down: int, right: int, scene: Any, prior: Any, likely: Any, mode: Any
) -> None:
    """Look at all templates and places about a coarse one; the peak of the parabola through the best three."""
    azimuth, whole, resolution_cells = scene
    angles = bank.shape[0]
    turn = 2 * np.pi / angles
    reach = likely.size // 2
    for a in range(-reach, reach + 1):
        template = bank[(middle + a) % angles]
        best: Any = np.float32(0.0)
        for i in range(max(down - 1, 0), min(down + 1, 2 * SHIFT) + 1):
            for j in range(max(right - 1, 0), min(right + 1, 2 * SHIFT) + 1):
                best = max(best, fit(picture, template, i, j))
        left = max(1.0 - best * best / whole, 1e-6)
        likely[a + reach] = -0.5 * resolution_cells * np.log(left) + belief(azimuth + (middle + a) * turn, prior)
    at = min(max(np.argmax(likely), 1), likely.size - 2)
    before, here, after = likely[at - 1], likely[at], likely[at + 1]
    bend = max(2 * here - before - after, 1e-9)
    off = min(max(0.5 * (after - before) / bend, -1.0), 1.0)
    mode[0] = azimuth + (middle + at - reach + off) * turn
    mode[1] = here + 0.25 * (after - before) * off
    mode[2] = turn * turn / bend


PART = MaximumLikelihood
