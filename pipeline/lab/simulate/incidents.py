"""The scripted incident: a vehicle passes a holding position while an aircraft is on final or rolling."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Point

from pipeline.airport.model import Airport, HoldingPosition, Runway
from pipeline.lab.simulate.paths import Movement
from pipeline.lab.simulate.traffic import motion
from pipeline.lab.simulate.vehicles import along, distances

Floats = NDArray[np.float64]
STANDS_BEFORE = 15
"""Seconds for which the vehicle stands beyond the hold before it moves."""


@dataclass(frozen=True, slots=True)
class Use:
    """A second in which an aircraft needs a runway. `time`: s into the loop. end: designator it lands or takes off on.

    to_threshold: s to the threshold; 0 when it rolls on the runway. along: m past the threshold. movement: its index.
    """

    time: float
    runway: str
    end: str
    to_threshold: float
    along: float
    movement: int


@dataclass(frozen=True, slots=True)
class Incident:
    """What was scripted. nominal, time: s into the loop, when it was due and when the vehicle passes the hold."""

    nominal: float
    time: float
    hold: str
    runway: str
    use: Use
    vehicle: Movement
    arrival: Movement | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """A way past a holding position to the runway's edge: straight along the hold's heading. Lengths in metres."""

    hold: HoldingPosition
    line: LineString
    before: float
    along: dict[str, float]


def uses(movements: Sequence[Movement], airport: Airport) -> list[Use]:
    """Every second in which an aircraft is 12 to 60 s from a threshold on final or rolls fast on a runway."""
    found: list[Use] = []
    for number, one in enumerate(movements):
        if one.name in ("CAR", "TUG", "TRUCK", "BUS"):
            continue
        for runway in airport.runways:
            for end in runway.ends:
                forward = (one.east - end.threshold.x) * math.sin(end.heading) + (
                    one.north - end.threshold.y
                ) * math.cos(end.heading)
                right = (one.east - end.threshold.x) * math.cos(end.heading) - (one.north - end.threshold.y) * math.sin(
                    end.heading
                )
                aligned = np.cos(one.heading - end.heading) > math.cos(math.radians(12.0))
                late = -forward / np.maximum(one.speed, 1.0)
                final = (one.altitude > 3.0) & (forward < 0) & (late >= 12) & (late <= 60) & (one.speed > 40)
                final &= aligned & (np.abs(right) < 60.0 - 0.05 * forward)
                length = runway.centreline.length
                rolling = one.on_ground & (forward > 0) & (forward < 0.6 * length) & (one.speed > 15)
                rolling &= aligned & (np.abs(right) < runway.width)
                found += [
                    Use(
                        one.start + float(i), runway.id, end.designator,
                        float(late[i]) if final[i] else 0.0, float(forward[i]), number,
                    )
                    for i in np.flatnonzero(final | rolling)
                ]  # fmt: skip
    return sorted(found, key=lambda use: (use.time, use.movement))


def approaches(airport: Airport, before: float = 60.0) -> list[Approach]:
    """The straight ways past the holding positions that reach their runway within 30 to 220 m."""
    made = []
    for hold in airport.holding_positions:
        runway = next((one for one in airport.runways if one.id == hold.runway), None)
        if runway is None:
            continue
        direction = np.array([math.sin(hold.heading), math.cos(hold.heading)])
        here = np.array([hold.position.x, hold.position.y])
        ray = LineString([here, here + 260.0 * direction]).intersection(runway.strip)
        if ray.is_empty:
            continue
        edge = Point(here).distance(ray)
        if not 25.0 <= edge <= 220.0:
            continue
        end = here + (edge + min(10.0, runway.width / 4)) * direction
        made.append(
            Approach(
                hold,
                LineString([here - before * direction, end]),
                before,
                {one.designator: _forward(one.threshold, one.heading, end) for one in runway.ends},
            )
        )
    return made


def _forward(threshold: Point, heading: float, place: Floats) -> float:
    return float((place[0] - threshold.x) * math.sin(heading) + (place[1] - threshold.y) * math.cos(heading))


def intruder(way: Approach, time: float, number: int, stay: int = 9) -> Movement:
    """The vehicle that passes the hold at `time`, stands just inside the runway's edge, and drives back.

    Time may be anything; the movement begins where it falls.
    """
    # the longer the way, the faster: the next incident is due in a minute and a half
    speed = min(max(8.0, way.line.length / 21.0), 13.0)
    out = distances(way.line.length, speed, 1.5)
    run = np.concatenate(
        [
            np.zeros(STANDS_BEFORE),
            out,
            np.full(stay, way.line.length),
            way.line.length - distances(way.line.length, speed, 1.5),
            np.zeros(8),
        ]
    )
    passes = float(np.interp(way.before, run[: STANDS_BEFORE + len(out)], np.arange(STANDS_BEFORE + len(out))))
    east, north, heading, pace = along(way.line, run, 1.2)
    n = len(run)
    return Movement(
        "CAR", f"FLCO {number % 9 + 1}", f"{0x3A0100 + number:06x}", time - passes, east, north, np.zeros(n), heading,
        pace, np.ones(n, bool), np.ones(n, bool),
    )  # fmt: skip


def simulated_arrival(runway: Runway, end: str, time: float, to_threshold: float, number: int) -> Movement:
    """An aircraft `to_threshold` s from landing at `time` that goes around 700 m short of the threshold."""
    this = runway.end(end)
    speed = 72.0
    t = np.arange(-50.0, 101.0)
    forward = speed * (t - to_threshold)
    glide = np.maximum(-forward, 0.0) * math.tan(math.radians(3.0)) + 15.0
    lowest = 700.0 * math.tan(math.radians(3.0)) + 15.0
    altitude = np.where(forward < -700.0, glide, lowest + np.maximum(forward + 700.0, 0.0) * 0.11)
    east = this.threshold.x + forward * math.sin(this.heading)
    north = this.threshold.y + forward * math.cos(this.heading)
    pace, heading = motion(east, north)
    n = len(t)
    return Movement(
        "A320", f"SIM{400 + number}", f"{0x3A0200 + number:06x}", time - 50.0, east, north, altitude, heading, pace,
        np.zeros(n, bool), np.ones(n, bool),
    )  # fmt: skip


def choose(use: Use, ways: Sequence[Approach], number: int) -> Approach | None:
    """A way onto the runway in front of the aircraft: at least 700 m ahead of one that rolls."""
    ahead = [
        way
        for way in ways
        if way.hold.runway == use.runway and (use.to_threshold > 0 or way.along[use.end] > use.along + 900.0)
    ]
    if not ahead:
        return None
    if use.to_threshold == 0:
        return min(ahead, key=lambda way: way.along[use.end])
    return ahead[number % len(ahead)]


def worth(use: Use, wanted: float) -> float:
    """Seconds by which a moment is away from the one wanted; finals of 25 to 45 s are preferred to the rest."""
    penalty = 0.0 if 25.0 <= use.to_threshold <= 45.0 else 8.0
    return abs(use.time - wanted) + penalty


def script(
    movements: Sequence[Movement], airport: Airport, length: float, first: float, every: float, reach: float = 30.0
) -> list[Incident]:
    """One incident every `every` s of the loop, from `first` (s into the loop) on round it.

    Looks ahead in the movements for the moment nearest to each nominal time, at most `reach` away, in which an aircraft
    needs a runway; where there is none, an arrival is simulated that goes around. None at all when the airport has no
    holding position from which a runway is reached.
    """
    ways = approaches(airport)
    known = uses(movements, airport)
    if not ways:
        return []
    made: list[Incident] = []
    last = ""
    ends = [(one.runway, one.end) for one in known if one.to_threshold > 0] or [
        (ways[0].hold.runway, next(iter(ways[0].along)))
    ]
    usual = max(sorted(set(ends)), key=ends.count)
    for number in range(max(1, int(length // every))):
        nominal = (first + number * every) % length
        # the vehicle before may still stand at its hold: another hold is taken where there is one
        others = [way for way in ways if way.hold.id != last]
        incident = _recorded(number, nominal, known, movements, others, length, reach) or _recorded(
            number, nominal, known, movements, ways, length, reach
        )
        made.append(incident or _invented(number, nominal, airport, usual, others or ways, length))
        last = made[-1].hold
    return made


def _recorded(
    number: int,
    nominal: float,
    known: Sequence[Use],
    movements: Sequence[Movement],
    ways: Sequence[Approach],
    length: float,
    reach: float,
) -> Incident | None:
    candidates = [
        use
        for use in known
        if abs(use.time - nominal) <= reach and movements[use.movement].end >= use.time + use.to_threshold + 5.0
    ]
    for use in sorted(candidates, key=lambda use: (worth(use, nominal), use.time)):
        way = choose(use, ways, number)
        if way is not None:
            vehicle = _into_loop(intruder(way, use.time, number), length)
            return Incident(nominal, use.time, way.hold.id, use.runway, use, vehicle)
    return None


def _invented(
    number: int, nominal: float, airport: Airport, usual: tuple[str, str], ways: Sequence[Approach], length: float
) -> Incident:
    runway, end = usual
    use = Use(nominal, runway, end, 40.0, 0.0, -1)
    way = choose(use, ways, number)
    if way is None:
        way = ways[number % len(ways)]
        runway = way.hold.runway
        end = next(iter(way.along))
        use = Use(nominal, runway, end, 40.0, 0.0, -1)
    arrival = simulated_arrival(airport.runway(runway), end, nominal, 40.0, number)
    vehicle = _into_loop(intruder(way, nominal, number), length)
    return Incident(nominal, nominal, way.hold.id, runway, use, vehicle, _into_loop(arrival, length))


def _into_loop(movement: Movement, length: float) -> Movement:
    if 0 <= movement.start < length:
        return movement
    columns = {name: getattr(movement, name) for name in movement.__dataclass_fields__}
    return Movement(**{**columns, "start": movement.start % length})
