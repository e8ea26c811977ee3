"""What enters the surface engine: measurements, the passing of time, the health of the sensors, operators' commands.

Everything that can change a picture is one of these values. The engine is a function of their order and their contents,
so that writing them down is enough to make the same pictures again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pipeline.picture import Visibility
from pipeline.tables import NodeEvents, SectorPlots, TargetReports


@dataclass(frozen=True, slots=True)
class Tick:
    """Time passes, whether or not a sensor speaks. The host sends it several times a second."""


@dataclass(frozen=True, slots=True)
class ClockStep:
    """The host's clock was set: from here on arrival times are `seconds` later than they would have been."""

    seconds: float


@dataclass(frozen=True, slots=True)
class SensorHealth:
    """degraded: ids of the sensors without which the picture is not whole; alerts are held at information while any is.

    They are the radars that are silent, waiting, cut short or too late; without a radar the reports when silent.
    """

    degraded: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """An operator acknowledges a live alert. by: who."""

    alert: int
    by: str


@dataclass(frozen=True, slots=True)
class SetRunway:
    """An operator sets how a runway is used. None leaves as it is; "" for in_use is "not in use"."""

    runway: str
    open: bool | None = None
    in_use: str | None = None
    visibility: Visibility | None = None


@dataclass(frozen=True, slots=True)
class PartsChanged:
    """Other parts now work on a radar's video; plots that follow are theirs. parts: of each verb, name and settings.

    The engine itself does nothing with it: it is there for those who read a journal.
    """

    radar: str
    parts: dict[str, Any] = field(default_factory=dict)


Command = Acknowledge | SetRunway
Input = SectorPlots | NodeEvents | TargetReports | Tick | ClockStep | SensorHealth | PartsChanged | Command


@dataclass(frozen=True, slots=True)
class Envelope:
    """One input with the time of its arrival: UTC s of the host's clock, from the shell."""

    arrival: float
    body: Input
