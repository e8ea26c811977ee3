"""Target reports: positions and identities that cooperative sensors (ADS-B, multilateration, vehicle beacons) give."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from pipeline.tables.schema import Array, Table, column


class TargetCategory(IntEnum):
    """What a report says its sender is."""

    UNKNOWN = 0
    AIRCRAFT = 1
    VEHICLE = 2


@dataclass(frozen=True, eq=False)
class TargetReports(Table):
    """One row a report."""

    time: Array = column("f8", "s", "UTC of applicability of the position")
    address: Array = column(
        "U7", "", "24-bit address as six lower-case hex digits, '~' before one not of ICAO; empty when unknown",
        default="",
    )  # fmt: skip
    callsign: Array = column("U8", "", "flight or vehicle identification; empty when unknown", default="")
    east: Array = column("f8", "m", "east of the airport's reference point")
    north: Array = column("f8", "m", "north of the airport's reference point")
    accuracy: Array = column("f4", "m", "standard deviation of each coordinate", default=7.5)
    altitude: Array = column("f4", "m", "height above the airport; nan when unknown", default=float("nan"))
    speed: Array = column("f4", "m/s", "ground speed; nan when unknown", default=float("nan"))
    course: Array = column("f4", "rad", "track over ground; nan when unknown", default=float("nan"))
    on_ground: Array = column("?", "", "the sender says that it is on the ground", default=True)
    category: Array = column("u1", "", "TargetCategory", default=0)
    simulated: Array = column("?", "", "made by a simulator", default=False)
    arrival: Array = column("f8", "s", "UTC when it arrived at this host; nan when unknown", default=float("nan"))
    source: Array = column(
        "U16", "", "name of the sensor or feed that the report came through; empty when unknown", default=""
    )
    ground_known: Array = column(
        "?", "", "whether the sender says if it is on the ground; otherwise on_ground means nothing", default=True
    )
