"""A mobile has passed a holding position towards a runway that is in use.

With an aircraft about to land or rolling towards it this is an alarm; with nobody near it is information, and only for
those whose way onto a runway is not ordinary (vehicles and unknown targets, unless set otherwise), since without
clearances an aircraft that lines up looks the same as one that errs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.alert.conflict import RuleSettings, approach_fields, closest_approach, stage_of, track_ids
from pipeline.contracts.alert import Conflict, Entry, Situation
from pipeline.tables import TargetClass

CAT004_STOP_BAR, CAT004_CROSSING = 16, 13
CAT011_TYPE = 2


@dataclass(frozen=True)
class HoldEntry(RuleSettings):
    """information_s, alarm_s: time to threshold of the arrival, or until a rolling aircraft reaches the place.

    inform: classes whose entry is reported while the runway is in use though nobody is near.
    departure_acceleration: m/s^2 that a departure is expected to gain.
    """

    information_s: float = 45.0
    alarm_s: float = 30.0
    information_low_s: float = 60.0
    alarm_low_s: float = 45.0
    inform: tuple[str, ...] = ("vehicle", "unknown")
    departure_acceleration: float = 1.5

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "inform", tuple(self.inform))  # a settings file gives a list
        names = {one.name.lower() for one in TargetClass}
        if not set(self.inform) <= names:
            raise ValueError(f"inform: a list of classes wanted, out of {', '.join(sorted(names))}")

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        """Every open entry against the traffic of its runway."""
        found: list[Conflict] = []
        for row, entry in situation.entries.items():
            r = int(situation.holds.runway[entry.hold])
            settings, parameters = self.on(situation.frames.ids[r])
            if situation.usable[row] or entry.node:
                found += settings._entry(situation, r, row, entry, parameters)
        return tuple(found)

    def _entry(self, s: Situation, r: int, row: int, entry: Entry, parameters: str) -> list[Conflict]:
        times = self.times(s.runways[r].visibility)
        found: list[Conflict] = []
        for other in np.nonzero(s.arrival[r] | s.rolling[r])[0]:
            time = self._time(s, r, row, int(other))
            stage = stage_of(time, times)
            if stage is None or other == row or s.together(row, int(other)):
                continue
            when = f" in {time:.0f} s" if s.arrival[r, other] else f", there in {time:.0f} s"
            found.append(
                self._conflict(
                    s,
                    r,
                    entry,
                    tracks=track_ids(s, row, int(other)),
                    intruder=int(s.tracks.id[row]),
                    stage=stage,
                    text=f"{s.label(row)} passed {s.holds.names[entry.hold]}, {s.label(int(other))} "
                    f"{s.doing(r, int(other))} {s.designator(r, int(other))}{when}",
                    certain=bool(s.certain[other] and (entry.node or s.certain[row])),
                    parameter_set=parameters,
                    cat004_type=CAT004_CROSSING,
                    **approach_fields(s, r, int(other)),
                    **closest_approach(s, row, int(other)),
                )
            )
        state = s.runways[r]
        if not found and state.open and state.in_use and _class(s, row) in self.inform:
            text = f"{s.label(row)} passed {s.holds.names[entry.hold]}, runway {state.id} in use as {state.in_use}"
            found.append(
                self._conflict(
                    s,
                    r,
                    entry,
                    tracks=track_ids(s, row),
                    intruder=int(s.tracks.id[row]),
                    stage="information",
                    text=text,
                    certain=bool(entry.node),
                    parameter_set=parameters,
                    cat004_type=CAT004_STOP_BAR,
                )
            )
        return found

    def _time(self, s: Situation, r: int, row: int, other: int) -> float:
        if s.arrival[r, other]:
            # an arrival that will have passed the place behind which the mobile enters is past it for good
            return float(s.time_to_threshold[r, other])
        gap = float(s.along[r, row] - s.along[r, other]) * s.forward(r, other)
        speed = abs(float(s.speed_along[r, other]))
        if gap <= 0:
            return np.inf
        if s.landed[other]:
            return gap / max(speed, 0.5)
        a = self.departure_acceleration
        return (-speed + float(np.sqrt(speed * speed + 2 * a * gap))) / a if a > 0 else gap / max(speed, 0.5)

    @staticmethod
    def _conflict(s: Situation, r: int, entry: Entry, **rest: Any) -> Conflict:
        return Conflict(
            rule="hold_entry",
            runway=s.frames.ids[r],
            holding_point=s.holds.names[entry.hold],
            cat011_type=CAT011_TYPE,
            **rest,
        )


def _class(s: Situation, row: int) -> str:
    return TargetClass(int(s.tracks.category[row])).name.lower()


PART = HoldEntry
