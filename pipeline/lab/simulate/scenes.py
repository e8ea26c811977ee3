"""Synthetic worlds of a wanted size, for display and load tests."""

from __future__ import annotations

import numpy as np

from pipeline.airport.model import Airport
from pipeline.lab.simulate.paths import Movement, Paths
from pipeline.lab.simulate.vehicles import lap, service_roads, taxi_runs
from pipeline.lab.simulate.world import World
from pipeline.reference.types import NAMES, TYPES
from pipeline.tables import TargetClass

_SHARE_OF_AIRCRAFT = 0.6


def synthetic_world(airport: Airport, count: int, seed: int, *, start: float = 0.0, length: int = 600) -> World:
    """`count` aircraft and vehicles that drive up and down the taxiways (vehicles also round the buildings).

    length: s after which everything repeats without a seam. Raises ValueError when the airport has no ways to drive.
    """
    rng = np.random.default_rng([seed, 23])
    runs = taxi_runs(airport, rng, min(count, 40), 300.0)
    roads = service_roads(airport)
    if not runs and not roads:
        raise ValueError(f"{airport.icao} has neither taxiways nor buildings to drive along")
    aircraft = [name for name in NAMES if TYPES[name].category == TargetClass.AIRCRAFT]
    cars = [name for name in NAMES if TYPES[name].category == TargetClass.VEHICLE]
    made = []
    for number in range(count):
        flies = rng.random() < _SHARE_OF_AIRCRAFT and bool(runs)
        lines = runs if flies or not roads or rng.random() < 0.5 else roads
        line = lines[int(rng.integers(len(lines)))]
        name = str(rng.choice(aircraft if flies else cars))
        speed = float(rng.uniform(5.0, 12.0))
        east, north, heading, pace = lap(line, length, rng, speed, back=not line.is_ring)
        shift = int(rng.integers(length))
        east, north, heading, pace = (
            np.append(x, x[0]) for x in (np.roll(y, shift) for y in (east, north, heading, pace))
        )
        n = length + 1
        made.append(
            Movement(
                name, f"{'SYN' if flies else 'CAR'}{number:03d}", f"{0x3B0000 + number:06x}", 0.0, east, north,
                np.zeros(n), np.unwrap(heading), pace, np.ones(n, bool), np.full(n, number % 4 != 3),
            )
        )  # fmt: skip
    return World(airport, Paths(made, float(length)), start)
