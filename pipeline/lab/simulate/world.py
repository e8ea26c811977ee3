"""The world: everything that is true at a time, from recorded traffic, simulated vehicles and scripted incidents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.airport.model import Airport
from pipeline.lab.simulate.incidents import Incident, Use, script, uses
from pipeline.lab.simulate.parked import parked
from pipeline.lab.simulate.paths import Movement, Paths, Truth
from pipeline.lab.simulate.recording import Recording, recorded_movements
from pipeline.lab.simulate.vehicles import vehicles


@dataclass(frozen=True, eq=False)
class World:
    """What is where at any time; the same for the same arguments.

    start: UTC s at which the world begins. offset: s into the loop at that moment. The loop repeats for ever.
    runways: id -> designator of the direction in use.
    """

    airport: Airport
    paths: Paths
    start: float
    offset: float = 0.0
    incidents: tuple[Incident, ...] = ()
    runways: dict[str, str] | None = None

    def truth(self, time: float) -> Truth:
        """Everything at `time` (UTC s)."""
        return self.paths.at(self.offset + time - self.start)

    def incident_times(self, since: float, until: float) -> list[tuple[float, Incident]]:
        """(UTC s at which the hold is passed, incident) of every incident from `since` until before `until`."""
        found = []
        for one in self.incidents:
            first = self.start + (one.time - self.offset) % self.paths.length
            turn = int(np.ceil((since - first) / self.paths.length))
            while first + turn * self.paths.length < until:
                if first + turn * self.paths.length >= since:
                    found.append((first + turn * self.paths.length, one))
                turn += 1
        return sorted(found, key=lambda pair: pair[0])


def build_world(
    airport: Airport,
    recording: Recording,
    *,
    start: float,
    seed: int = 1,
    first_incident: float = 45.0,
    incident_every: float = 90.0,
    vehicle_count: int = 14,
    parked_count: int = 14,
) -> World:
    """The demonstration's world: begins where the recorded traffic has a conflict for the first incident."""
    movements = recorded_movements(recording)
    known = uses(movements, airport)
    length = recording.length
    offset = _offset(movements, known, length, first_incident)
    incidents = script(movements, airport, length, (offset + first_incident) % length, incident_every)
    driving = vehicles(airport, length, vehicle_count, seed)
    everything = [
        *movements,
        *parked(airport, movements, length, parked_count, seed, vehicles=driving),
        *driving,
        *(one.vehicle for one in incidents),
        *(one.arrival for one in incidents if one.arrival is not None),
    ]
    return World(airport, Paths(everything, recording.length), start, offset, tuple(incidents), in_use(known))


def in_use(known: Sequence[Use]) -> dict[str, str]:
    """Runway id -> the designator that most seconds of use are in."""
    counts: dict[str, dict[str, int]] = {}
    for one in known:
        ends = counts.setdefault(one.runway, {})
        ends[one.end] = ends.get(one.end, 0) + 1
    return {runway: max(sorted(ends), key=lambda end: ends[end]) for runway, ends in counts.items()}


def _offset(movements: Sequence[Movement], known: Sequence[Use], length: float, first: float) -> float:
    """Where in the loop to begin: at the busiest moment whose first incident meets an arrival 30 to 40 s out."""
    best, chosen = -1.0, 0.0
    for one in known:
        if not 30.0 <= one.to_threshold <= 40.0 or movements[one.movement].end < one.time + one.to_threshold + 20.0:
            continue
        begin = one.time - first
        if not 0.0 <= begin < length - 300.0:
            continue
        busy = sum(_moving(other, begin, begin + 300.0) for other in movements)
        if busy > best:
            best, chosen = busy, begin
    return chosen


def _moving(movement: Movement, since: float, until: float) -> float:
    a = max(int(since - movement.start), 0)
    b = max(int(until - movement.start), 0)
    return float(np.sum(movement.speed[a:b] > 1.0))
