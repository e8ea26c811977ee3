"""Pictures of echoes against templates."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.kernels.compiled import allocating, reassociating
from pipeline.kernels.scan_convert import convert


@reassociating
def decibels(picture: Any, background: float, db_per_step: float, limit: float) -> float:
    """Steps to decibels over the ground, in place; the sum of their squares is returned."""
    total = 0.0
    for i in range(picture.shape[0]):
        row = picture[i]
        for j in range(row.size):
            value = min(max((row[j] - background) * db_per_step, 0.0), limit)
            row[j] = value
            total += value * value
    return total


@reassociating
def fit(picture: Any, template: Any, down: int, right: int) -> Any:
    """Sum of the products with the template laid `down` and `right` pixels into the picture."""
    total = np.float32(0.0)
    for i in range(template.shape[0]):
        row, line = picture[i + down][right : right + template.shape[1]], template[i]
        for j in range(line.size):
            total += row[j] * line[j]
    return total


@allocating
def belief(heading: float, prior: Any) -> Any:
    """Log of how likely a heading is beforehand, over that of any heading whatever."""
    expected, sd, outliers = prior
    if not np.isfinite(sd):
        return 0.0
    off = (heading - expected + np.pi) % (2 * np.pi) - np.pi
    near = np.sqrt(2 * np.pi) / sd * np.exp(-0.5 * (off / sd) ** 2)
    return np.log((1.0 - outliers) * near + outliers + 1e-12)


@allocating
def explained(
    amplitude: Any, grid: Any, place: Any, scale: Any, bank: Any, headings: Any, picture: Any, out: Any
) -> float:
    """Energy of the picture that each template explains at its best place; the energy of the picture is returned.

    place: east, north, azimuth, background of the echo. scale: metres a pixel, decibels a step, greatest decibels.
    bank: (kinds, angles, n, n). headings: the angles to look at. picture: room, larger than the templates by all the
    pixels that they are moved. out: (kinds, headings).
    """
    east, north, azimuth, background = place
    step, db_per_step, limit = scale
    convert(amplitude, grid, (east, north, step, azimuth, background), picture)
    whole = decibels(picture, background, db_per_step, limit)
    room = picture.shape[0] - bank.shape[2] + 1
    for kind in range(bank.shape[0]):
        for k in range(headings.size):
            best: Any = np.float32(0.0)
            for down in range(room):
                for right in range(room):
                    best = max(best, fit(picture, bank[kind, headings[k]], down, right))
            out[kind, k] = best * best
    return whole
