"""Somebody is on the runway or in its protection area, and an aircraft comes to land or rolls towards it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.alert.conflict import RuleSettings, approach_fields, closest_approach, stage_of, track_ids
from pipeline.contracts.alert import Conflict, Situation

CAT004_ARRIVAL, CAT004_DEPARTURE = 9, 12
CAT011_TYPE = 1

MOVING_SPEED = 3.0
"""m/s; one that has landed and is slower is taken for stopped: nobody can say that it will leave the runway."""


@dataclass(frozen=True)
class RunwayOccupied(RuleSettings):
    """Arrival: stages by time to threshold. Rolling: stages by time until it reaches the occupant ahead.

    departure_information_s, departure_alarm_s: the stages for a departure, in any visibility (it must abort early).
    departure_acceleration: m/s^2 that a departure is expected to gain. anticipate: who rolls ahead of the arrival does
    not count before the alarm stage, and a departure faster than lead_speed (m/s) not at all, unless the arrival still
    gains on it. vacates_s: nor does one that has landed and still moves, as to its exit, while the arrival needs longer
    than this to reach it. predicted: who cannot stop before the area counts, as information. nearest: at most so many
    occupants are reported for one mover.
    """

    departure_acceleration: float = 1.5
    departure_information_s: float = 45.0
    departure_alarm_s: float = 30.0
    anticipate: bool = True
    lead_speed: float = 41.0
    vacates_s: float = 45.0
    predicted: bool = True
    nearest: int = 4

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        """All arrivals and rolling aircraft against all occupants ahead of them."""
        found: list[Conflict] = []
        for r, runway in enumerate(situation.frames.ids):
            settings, parameters = self.on(runway)
            times = settings.times(situation.runways[r].visibility)
            present = situation.occupant[r] | (situation.entering[r] & settings.predicted)
            if not present.any():
                continue
            for row in np.nonzero(situation.arrival[r])[0]:
                found += settings._arrival(situation, r, int(row), present, times, parameters)
            for row in np.nonzero(situation.rolling[r])[0]:
                found += settings._rolling(situation, r, int(row), present, times, parameters)
        return tuple(found)

    def _arrival(
        self, s: Situation, r: int, row: int, present: Any, times: tuple[float, float], parameters: str
    ) -> Iterator[Conflict]:
        time = float(s.time_to_threshold[r, row])
        stage = stage_of(time, times)
        if stage is None:
            return
        for other in self._ahead(s, r, row, present):
            rolls_ahead = s.rolling[r, other] and s.way[r, other] == s.way[r, row]
            drawing_away = _closing_speed(s, r, row, other) <= s.settings.together_speed
            leads = not s.landed[other] and s.speed[other] >= self.lead_speed and drawing_away
            if rolls_ahead and self.anticipate and (stage != "alarm" or leads):
                continue
            gap = float(s.along[r, other] - s.along[r, row]) * s.forward(r, row)
            moves_on = s.landed[other] and s.speed[other] > MOVING_SPEED
            if moves_on and gap > self.vacates_s * _closing_speed(s, r, row, other):
                continue  # the one before, on the way to an exit far ahead
            inside = bool(s.occupant[r, other])
            yield self._conflict(
                s,
                r,
                row,
                other,
                stage=stage if inside else "information",
                text=f"{s.label(row)} landing {s.designator(r, row)} in {time:.0f} s, {s.label(other)} "
                f"{'on' if s.on_strip[r, other] else 'near' if inside else 'entering'} runway {s.frames.ids[r]}",
                certain=bool(s.certain[row] and s.certain[other] and inside),
                parameters=parameters,
                type=CAT004_ARRIVAL,
            )

    def _rolling(
        self, s: Situation, r: int, row: int, present: Any, times: tuple[float, float], parameters: str
    ) -> Iterator[Conflict]:
        forward = s.forward(r, row)
        for other in self._ahead(s, r, row, present):
            closing = _closing_speed(s, r, row, other)
            opposite = s.way[r, other] != s.way[r, row]
            if s.rolling[r, other] and (opposite or closing <= s.settings.together_speed):
                continue  # the opposite direction has its own rule; who draws away is no danger
            gap = float(s.along[r, other] - s.along[r, row]) * forward
            landed = bool(s.landed[row])
            time = self._time_to_reach(gap, closing, landed)
            stage = stage_of(time, times if landed else (self.departure_information_s, self.departure_alarm_s))
            if stage is None:
                continue
            inside = bool(s.occupant[r, other])
            yield self._conflict(
                s,
                r,
                row,
                other,
                stage=stage if inside else "information",
                text=f"{s.label(row)} {s.doing(r, row)} {s.designator(r, row)}, "
                f"{s.label(other)} {gap:.0f} m ahead "
                f"{'on' if s.on_strip[r, other] else 'near' if inside else 'entering'} runway {s.frames.ids[r]}",
                certain=bool(s.certain[row] and s.certain[other] and inside),
                parameters=parameters,
                type=CAT004_ARRIVAL if s.landed[row] else CAT004_DEPARTURE,
            )

    def _time_to_reach(self, gap: float, closing: float, landed: bool) -> float:
        """Time to cover `gap`: a landed aircraft keeps its speed at most, a departure gains speed."""
        if landed:
            return gap / closing if closing > 0.5 else np.inf
        a = self.departure_acceleration
        return (-closing + float(np.sqrt(closing * closing + 2 * a * gap))) / a if a > 0 else gap / max(closing, 0.5)

    def _ahead(self, s: Situation, r: int, row: int, present: Any) -> list[int]:
        gap = (s.along[r] - s.along[r, row]) * s.forward(r, row)
        rows = np.nonzero(present & (gap > 0))[0]
        rows = rows[np.argsort(gap[rows], kind="stable")]
        chosen = [int(one) for one in rows if one != row and not s.together(row, int(one))]
        return chosen[: self.nearest]

    def _conflict(
        self, s: Situation, r: int, row: int, other: int, *, parameters: str, type: int, **rest: Any
    ) -> Conflict:
        entry = s.entries.get(other)
        return Conflict(
            rule="runway_occupied",
            runway=s.frames.ids[r],
            tracks=track_ids(s, row, other),
            intruder=int(s.tracks.id[other]),
            holding_point=None if entry is None else s.holds.names[entry.hold],
            parameter_set=parameters,
            cat004_type=type,
            cat011_type=CAT011_TYPE,
            **approach_fields(s, r, row),
            **closest_approach(s, row, other),
            **rest,
        )


def _closing_speed(s: Situation, r: int, row: int, other: int) -> float:
    """m/s at which `row` gains on `other` ahead of it along the runway."""
    return abs(float(s.speed_along[r, row])) - float(s.speed_along[r, other]) * s.forward(r, row)


PART = RunwayOccupied
