"""What a radar would show of an aircraft's outline: templates for the correlation with images of echoes.

The outline is a plain planform (fuselage, swept and tapered wings, tailplane) that answers alike everywhere. A template
is its picture in decibels, blurred by the radar's resolution, in the frame of the line of sight: the first row is the
farthest from the radar, the last column the rightmost as seen from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

Floats = NDArray[np.float64]
Templates = NDArray[np.float32]

HALF_POWER = 2 * math.sqrt(2 * math.log(2))
"""Width between the half-power points of a Gaussian over its standard deviation."""


@dataclass(frozen=True, slots=True)
class Planform:
    """An aircraft seen from above: metres, sweep of the wing in rad."""

    length: float
    span: float
    fuselage: float
    sweep: float


@lru_cache(maxsize=32)
def templates(
    shape: Planform, angles: int, pixels: int, step: float, deep: float, widths: tuple[float, ...], contrast_db: float
) -> Templates:
    """(widths, angles, pixels, pixels) pictures of the outline at headings all around, each of norm 1; not writable.

    The heading of template k is 2 pi k / angles clockwise from the line of sight away from the radar. step: m, side of
    a pixel. deep, widths: m, the resolution in range, and those across, between half-power points. contrast_db: of the
    aircraft over its ground.
    """
    out = np.empty((len(widths), angles, pixels, pixels), np.float32)
    least = 0.05 * step
    sigmas = np.maximum(np.array(widths) / HALF_POWER, least)
    _templates(_corners(shape), float(step), max(deep / HALF_POWER, least), sigmas, 10 ** (contrast_db / 10), out)
    out.flags.writeable = False
    return out


def _corners(shape: Planform) -> Floats:
    """(pieces, 6): each piece between two ends across: distance across, nose and back of inner and outer end."""
    half, body, span = shape.length / 2, shape.fuselage / 2, shape.span / 2
    slope = math.tan(shape.sweep)

    def surface(outer: float, root: float, tip: float, nose: float) -> tuple[float, ...]:
        drop = outer * slope
        return (0.0, nose, nose - root, outer, nose - drop, nose - drop - tip)

    # the area of a tapered wing lies about the middle of the aircraft, whatever the sweep puts its root to
    root, tip = 0.17 * shape.length, 0.045 * shape.length
    nose = 0.02 * shape.length + root / 2 + 0.4 * span * slope
    return np.array(
        [
            (0.0, half, -half, body, 0.9 * half, -half),
            surface(span, root, tip, nose),
            surface(0.36 * span, 0.11 * shape.length, 0.05 * shape.length, -0.77 * half),
        ]
    )


@allocating
def _inside(forward: float, right: float, pieces: Floats) -> bool:
    across = abs(right)
    for k in range(pieces.shape[0]):
        inner, outer = pieces[k, 0], pieces[k, 3]
        if inner <= across < outer:
            u = (across - inner) / (outer - inner)
            nose = pieces[k, 1] + u * (pieces[k, 4] - pieces[k, 1])
            back = pieces[k, 2] + u * (pieces[k, 5] - pieces[k, 2])
            if back <= forward <= nose:
                return True
    return False


@allocating
def _weights(sigma: float, step: float) -> Any:
    reach = int(3.0 * sigma / step) + 1
    made = np.exp(-0.5 * ((np.arange(2 * reach + 1) - reach) * step / sigma) ** 2)
    return made / made.sum()


@allocating
def _templates(pieces: Floats, step: float, deep_sigma: float, sigmas: Floats, contrast: float, out: Templates) -> None:
    count, pixels = out.shape[1], out.shape[2]
    deep = _weights(deep_sigma, step)
    reach = len(deep) // 2
    sharp, blurred = np.empty((pixels, pixels)), np.empty((pixels, pixels))
    for a in range(count):
        _rasterise(pieces, step, 2 * np.pi * a / count, sharp)
        for i in range(pixels):
            for j in range(pixels):
                total = 0.0
                for k in range(max(-reach, -i), min(reach, pixels - 1 - i) + 1):
                    total += deep[k + reach] * sharp[i + k, j]
                blurred[i, j] = total
        for ring in range(sigmas.size):
            _widened(blurred, _weights(sigmas[ring], step), contrast, out[ring, a])


@allocating
def _rasterise(pieces: Floats, step: float, heading: float, out: Floats) -> None:
    """Part of each pixel that the outline covers, by nine points."""
    sine, cosine = np.sin(heading), np.cos(heading)
    pixels = out.shape[0]
    for i in range(pixels):
        for j in range(pixels):
            hits = 0
            for p in range(-1, 2):
                away = ((pixels - 1) / 2 - i + p / 3) * step
                for q in range(-1, 2):
                    right = (j - (pixels - 1) / 2 + q / 3) * step
                    if _inside(away * cosine + right * sine, right * cosine - away * sine, pieces):
                        hits += 1
            out[i, j] = hits / 9


@allocating
def _widened(blurred: Floats, wide: Floats, contrast: float, out: Templates) -> None:
    """Blurred across, in decibels, of norm 1."""
    pixels, reach = blurred.shape[0], len(wide) // 2
    square = 0.0
    for i in range(pixels):
        for j in range(pixels):
            total = 0.0
            for k in range(max(-reach, -j), min(reach, pixels - 1 - j) + 1):
                total += wide[k + reach] * blurred[i, j + k]
            value = 10.0 * np.log10(1.0 + contrast * total) if total > 1e-6 else 0.0
            out[i, j] = value
            square += value * value
    out *= np.float32(1.0 / np.sqrt(max(square, 1e-12)))
