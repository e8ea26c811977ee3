"""Classification by extent and speed, with hysteresis; what a cooperative target says of itself goes first."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables import TargetClass
from pipeline.tables.arrays import Array


@dataclass(frozen=True)
class ExtentSpeed:
    """Long or fast is an aircraft, short and slow a vehicle, what lies between stays what it was.

    aircraft_length, vehicle_length: m, above and below which the smoothed extent decides. aircraft_speed: m/s, no
    vehicle is faster. vehicle_speed: m/s, something short is called a vehicle only below it. settle: measurements of
    the extent before it counts.
    """

    aircraft_length: float = 18.0
    vehicle_length: float = 13.0
    aircraft_speed: float = 45.0
    vehicle_speed: float = 35.0
    settle: int = 5

    def __post_init__(self) -> None:
        if not 0 < self.vehicle_length < self.aircraft_length:
            raise ValueError("vehicle_length must be positive and less than aircraft_length")
        if not 0 < self.vehicle_speed < self.aircraft_speed:
            raise ValueError("vehicle_speed must be positive and less than aircraft_speed")

    def __call__(
        self, category: Array, claimed: Array, length: Array, width: Array, speed: Array, measurements: Array
    ) -> Array:
        """The new category (n,) uint8.

        category: what each was held to be. claimed: TargetCategory of its reports, 0 when they say nothing.
        length, width: smoothed extent m, nan when unknown. speed: m/s. measurements: how many extents were seen.
        """
        made = np.empty(len(category), np.uint8)
        _classify(
            category, claimed, length, width, speed, measurements, self.aircraft_length, self.vehicle_length,
            self.aircraft_speed, self.vehicle_speed, self.settle, made,
        )  # fmt: skip
        return made


PART = ExtentSpeed

AIRCRAFT, VEHICLE = int(TargetClass.AIRCRAFT), int(TargetClass.VEHICLE)


@allocating
def _classify(
    category: Array, claimed: Array, length: Array, width: Array, speed: Array, measurements: Array,
    aircraft_length: float, vehicle_length: float, aircraft_speed: float, vehicle_speed: float, settle: int,
    made: Array,
) -> None:  # fmt: skip
    for k in range(len(made)):
        made[k] = category[k]
        longest = width[k] if math.isnan(length[k]) else length[k]
        if not math.isnan(width[k]):
            longest = max(longest, width[k])
        if measurements[k] >= settle and math.isfinite(longest):
            if longest >= aircraft_length:
                made[k] = AIRCRAFT
            elif longest <= vehicle_length and speed[k] <= vehicle_speed:
                made[k] = VEHICLE
        if measurements[k] > 0 and speed[k] >= aircraft_speed:
            made[k] = AIRCRAFT
        if claimed[k] > 0:
            made[k] = claimed[k]
