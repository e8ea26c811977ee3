"""Rain: convective cells that drift over the airport and swell and fade."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.sites import RadarSite


@dataclass(frozen=True, slots=True)
class RainCell:
    """A cell: place at time 0 relative to the reference point, drift, radius, peak in dB over noise at 1 km.

    begin, ramp: s; it swells from `begin` on for `ramp` seconds, stays for `stay`, and fades for `ramp`.
    """

    east: float
    north: float
    drift_east: float
    drift_north: float
    radius: float
    peak: float
    begin: float
    ramp: float
    stay: float


def shower(seed: int, since: float, count: int = 4) -> tuple[RainCell, ...]:
    """Some cells that come over one after the other from `since` (UTC s) on."""
    rng = np.random.default_rng([seed, 5])
    direction = rng.uniform(0, 2 * np.pi)
    made = []
    for number in range(count):
        place = rng.uniform(-2200.0, 2200.0, 2)
        pace = rng.uniform(6.0, 12.0)
        made.append(
            RainCell(
                float(place[0]), float(place[1]), pace * math.sin(direction), pace * math.cos(direction),
                float(rng.uniform(350.0, 800.0)), float(rng.uniform(9.0, 14.0)), since + number * 70.0, 20.0, 160.0,
            )
        )  # fmt: skip
    return tuple(made)


def rain_power(
    cells: tuple[RainCell, ...], site: RadarSite, time: float, azimuth: float, slant: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(ranges,) power of the rain over noise (linear) along one azimuth at `time`."""
    power = np.zeros(len(slant))
    east = site.east + slant * math.sin(azimuth)
    north = site.north + slant * math.cos(azimuth)
    for one in cells:
        age = time - one.begin
        strength = min(1.0, max(0.0, min(age / one.ramp, (2 * one.ramp + one.stay - age) / one.ramp)))
        if strength <= 0:
            continue
        x, y = east - one.east - one.drift_east * age, north - one.north - one.drift_north * age
        shape = np.exp(-(x * x + y * y) / (2 * one.radius**2))
        # a filled beam loses with range what a point loses, less the growth of the volume
        power += strength * shape * 10 ** (one.peak / 10) * (np.maximum(slant, 150.0) / 1e3) ** -0.8
    return power
