"""The types of aircraft and vehicles with their dimensions, as simulator and bearing templates need them."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from pipeline.tables import TargetClass


@dataclass(frozen=True, slots=True)
class TargetType:
    """Dimensions of a type in metres. fuselage: diameter of the body. sweep: rad of the wing. engines: a count.

    cross_section: mean radar cross section in square metres, summed over the scattering centres.
    """

    name: str
    category: TargetClass
    length: float
    width: float
    height: float
    fuselage: float
    sweep: float
    engines: int
    cross_section: float


_AIRCRAFT, _VEHICLE = TargetClass.AIRCRAFT, TargetClass.VEHICLE

TYPES: dict[str, TargetType] = {
    one.name: one
    for one in (
        TargetType("A320", _AIRCRAFT, 37.6, 35.8, 11.8, 4.0, 0.44, 2, 90.0),
        TargetType("A321", _AIRCRAFT, 44.5, 35.8, 11.8, 4.0, 0.44, 2, 100.0),
        TargetType("B738", _AIRCRAFT, 39.5, 35.8, 12.5, 3.8, 0.44, 2, 90.0),
        TargetType("E190", _AIRCRAFT, 36.2, 28.7, 10.6, 3.0, 0.42, 2, 70.0),
        TargetType("AT72", _AIRCRAFT, 27.2, 27.1, 7.7, 2.9, 0.02, 2, 45.0),
        TargetType("A332", _AIRCRAFT, 58.8, 60.3, 17.4, 5.6, 0.52, 2, 170.0),
        TargetType("B77W", _AIRCRAFT, 73.9, 64.8, 18.5, 6.2, 0.55, 2, 200.0),
        TargetType("CAR", _VEHICLE, 4.6, 1.9, 1.7, 1.8, 0.0, 0, 8.0),
        TargetType("TUG", _VEHICLE, 8.0, 3.2, 1.9, 3.0, 0.0, 0, 15.0),
        TargetType("TRUCK", _VEHICLE, 8.6, 2.5, 3.2, 2.5, 0.0, 0, 20.0),
        TargetType("BUS", _VEHICLE, 13.5, 3.0, 3.0, 3.0, 0.0, 0, 25.0),
    )
}
"""All types by name."""

NAMES = tuple(TYPES)
"""The names in the order of their codes: a truth table's `type` is an index into this."""

_MEDIUM = ("A320", "A320", "A320", "B738", "B738", "A321", "E190")
_OPERATORS: dict[str, tuple[str, ...]] = {
    "AFR": ("A320", "A321", "A320", "E190"),
    "TVF": ("B738",),
    "EJU": ("A320", "A320", "A321"),
    "VLG": ("A320", "A321"),
    "CCM": ("A320", "AT72"),
    "IBE": ("A320", "A321"),
    "TAP": ("A320", "A321", "E190"),
    "PGT": ("A320", "B738"),
    "CRL": ("A332",),
    "FMY": ("AT72",),
}


def type_of(callsign: str, address: str) -> TargetType:
    """A plausible type for an aircraft whose record does not say; the same for the same callsign and address."""
    operator = callsign[:3].upper()
    if operator == "AFR" and callsign[3:].isdigit() and len(callsign) == 6:
        choice: tuple[str, ...] = ("B77W", "A332")
    else:
        choice = _OPERATORS.get(operator, _MEDIUM)
    return TYPES[choice[zlib.crc32(address.encode()) % len(choice)]]
