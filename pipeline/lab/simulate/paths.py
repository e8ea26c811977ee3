"""Movements through the loop: one sample a second each, ragged, looked up all at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.reference.types import NAMES, TYPES
from pipeline.tables.schema import Array, Table, column

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth(Table):
    """Everything on and near the airport at one moment, one row a target."""

    id: Array = column("i4", "", "unique to one movement in one turn of the loop")
    east: Array = column("f8", "m", "centre of the target, east of the reference point")
    north: Array = column("f8", "m", "centre of the target, north of the reference point")
    altitude: Array = column("f4", "m", "height of the wheels above the airport", default=0.0)
    heading: Array = column("f4", "rad", "where the nose points, clockwise from true north", default=0.0)
    speed: Array = column("f4", "m/s", "speed over the ground", default=0.0)
    length: Array = column("f4", "m", "along the heading")
    width: Array = column("f4", "m", "across the heading")
    height: Array = column("f4", "m", "of the target's top above its wheels")
    type: Array = column("u1", "", "index into pipeline.reference.types.NAMES")
    category: Array = column("u1", "", "TargetClass")
    callsign: Array = column("U8", "", "flight or vehicle identification; empty when it has none", default="")
    address: Array = column("U6", "", "24-bit address; empty when it has none", default="")
    on_ground: Array = column("?", "", "the wheels are on the ground", default=True)
    reporting: Array = column("?", "", "its transponder is heard", default=False)
    simulated: Array = column("?", "", "not recorded: made by the simulator", default=False)


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """One target's movement. start: s into the loop of sample 0; the samples follow at one second.

    name: of the type. reporting: (n,) transponder heard. Heading in rad, not necessarily within one turn.
    """

    name: str
    callsign: str
    address: str
    start: float
    east: Floats
    north: Floats
    altitude: Floats
    heading: Floats
    speed: Floats
    on_ground: NDArray[np.bool_]
    reporting: NDArray[np.bool_]
    simulated: bool = True

    @property
    def end(self) -> float:
        """Seconds into the loop of the last sample."""
        return self.start + len(self.east) - 1


class Paths:
    """All movements of a loop of `length` seconds, laid out for `at`.

    A movement is there from its start until before its end; one that passes the end of the loop is still there at the
    beginning of the next turn. At the seam a target that is somewhere else afterwards gets another id: it vanishes and
    appears, it does not jump.
    """

    def __init__(self, movements: Sequence[Movement], length: float) -> None:
        for one in movements:
            if one.start < 0 or one.end - one.start > length or len(one.east) < 2:
                raise ValueError(f"{one.callsign or one.name}: starts in the loop and lasts no longer than it")
        self.length = float(length)
        self.movements = tuple(movements)
        counts = np.array([len(one.east) for one in movements], np.int64)
        self._offset = np.concatenate([[0], np.cumsum(counts)])[:-1].astype(np.int64)
        self._start = np.array([one.start for one in movements], float)
        self._end = np.array([one.end for one in movements], float)
        self._last = counts - 2

        def flat(name: str) -> NDArray[np.float64]:
            parts = [np.asarray(getattr(one, name), float) for one in movements]
            return np.concatenate(parts) if parts else np.zeros(0)

        self._values = np.stack(
            [
                flat("east"),
                flat("north"),
                flat("altitude"),
                np.concatenate([np.unwrap(one.heading) for one in movements]) if movements else np.zeros(0),
                flat("speed"),
            ],
            axis=1,
        )
        self._on_ground = flat("on_ground").astype(bool)
        self._reporting = flat("reporting").astype(bool)
        kinds = [TYPES[one.name] for one in movements]
        self._type = np.array([NAMES.index(one.name) for one in kinds], np.uint8)
        self._size = np.array([(one.length, one.width, one.height) for one in kinds], np.float32).reshape(-1, 3)
        self._category = np.array([one.category for one in kinds], np.uint8)
        self._callsign = np.array([one.callsign for one in movements], "U8")
        self._address = np.array([one.address for one in movements], "U6")
        self._simulated = np.array([one.simulated for one in movements], bool)

    def at(self, time: float) -> Truth:
        """The truth `time` seconds after the first turn of the loop began; before that, as in a turn before it."""
        turn, into = divmod(time, self.length)
        now = np.flatnonzero((self._start <= into) & (into < self._end))
        late = into + self.length
        still = np.flatnonzero((self._start <= late) & (late < self._end))
        rows = np.concatenate([now, still])
        phase = np.concatenate([into - self._start[now], late - self._start[still]])
        # the turn in which the movement began makes its id: 10 turns, then the numbers come again
        began = np.concatenate([np.full(len(now), turn), np.full(len(still), turn - 1)])
        whole = np.minimum(phase.astype(np.int64), self._last[rows])
        part = (phase - whole)[:, None]
        index = self._offset[rows] + whole
        values = self._values[index] * (1 - part) + self._values[index + 1] * part
        size = self._size[rows]
        return Truth(
            id=(np.mod(began, 10) * 10000 + rows + 1).astype(np.int32),
            east=np.ascontiguousarray(values[:, 0]),
            north=np.ascontiguousarray(values[:, 1]),
            altitude=values[:, 2].astype(np.float32),
            heading=np.mod(values[:, 3], 2 * np.pi).astype(np.float32),
            speed=values[:, 4].astype(np.float32),
            length=size[:, 0],
            width=size[:, 1],
            height=size[:, 2],
            type=self._type[rows],
            category=self._category[rows],
            callsign=self._callsign[rows],
            address=self._address[rows],
            on_ground=self._on_ground[index],
            reporting=self._reporting[index],
            simulated=self._simulated[rows],
        )
