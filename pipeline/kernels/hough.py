"""The Hough transform of a small picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

Floats = NDArray[np.float64]


def hough(weights: NDArray[np.float32], angles: int, width: float, origin: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """(angles, bins) what lies on each line: the normal of lines of row k points pi k / angles from the direction of
    the columns to that of the rows; a line is `width` pixels wide, and those of the middle bin go through `origin` (row
    and column). weights: (n, m), 0 where there is nothing."""
    reach = int(np.ceil(np.hypot(*weights.shape) / width)) + 1
    out = np.zeros((angles, 2 * reach + 1))
    _vote(weights, float(width), float(origin[0]), float(origin[1]), out)
    return out


def peaks(votes: Floats, many: int, apart: float) -> list[tuple[float, float]]:
    """The `many` angles (rad) with the fullest lines, at least `apart` rad from each other modulo pi, and what is on
    these lines; between two angles by a parabola."""
    angles = len(votes)
    step = np.pi / angles
    fullest = votes.max(axis=1)
    free = np.ones(angles, bool)
    made: list[tuple[float, float]] = []
    while len(made) < many and (free & (fullest > 0)).any():
        k = int(np.argmax(np.where(free, fullest, -1.0)))
        before, here, after = fullest[k - 1], fullest[k], fullest[(k + 1) % angles]
        bend = 2 * here - before - after
        off = float(np.clip(0.5 * (after - before) / bend, -0.5, 0.5)) if bend > 0 else 0.0
        made.append(((k + off) * step % np.pi, float(here)))
        away = np.abs((np.arange(angles) - k + angles / 2) % angles - angles / 2) * step
        free &= away >= apart
    return made


@allocating
def _vote(weights: Any, width: float, down: float, right: float, out: Any) -> None:
    angles, middle = out.shape[0], out.shape[1] // 2
    sine, cosine = np.empty(angles), np.empty(angles)
    for k in range(angles):
        sine[k], cosine[k] = np.sin(np.pi * k / angles), np.cos(np.pi * k / angles)
    for i in range(weights.shape[0]):
        for j in range(weights.shape[1]):
            w = weights[i, j]
            if w > 0.0:
                for k in range(angles):
                    out[k, int(np.rint(((j - right) * cosine[k] + (i - down) * sine[k]) / width)) + middle] += w
