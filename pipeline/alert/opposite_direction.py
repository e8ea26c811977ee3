"""Two aircraft use one runway in opposite directions: both landing, both departing, or one of each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipeline.alert.conflict import RuleSettings, approach_fields, closest_approach, stage_of, track_ids
from pipeline.contracts.alert import Conflict, Situation

CAT004_OPPOSITE = 11
CAT011_TYPE = 3


@dataclass(frozen=True)
class OppositeDirection(RuleSettings):
    """Stages by the time until the two meet; two that both roll on the strip are an alarm at once.

    most: at most so many users of one runway are looked at, those nearest to its middle.
    """

    information_s: float = 60.0
    alarm_s: float = 30.0
    information_low_s: float = 90.0
    alarm_low_s: float = 45.0
    most: int = 12

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        """All pairs that face each other along a runway."""
        s, found = situation, []
        for r, runway in enumerate(s.frames.ids):
            settings, parameters = self.on(runway)
            times = settings.times(s.runways[r].visibility)
            using = s.arrival[r] | s.rolling[r] | s.outbound[r]
            rows = np.nonzero(using)[0]
            if len(rows) < 2 or np.all(s.way[r, rows] == s.way[r, rows[0]]):
                continue
            middle = np.abs(s.along[r, rows] - s.frames.length[r] / 2)
            rows = rows[np.argsort(middle, kind="stable")][: settings.most]
            for one, other in combinations((int(row) for row in rows), 2):
                conflict = settings._pair(s, r, one, other, times, parameters)
                if conflict is not None:
                    found.append(conflict)
        return tuple(found)

    def _pair(
        self, s: Situation, r: int, one: int, other: int, times: tuple[float, float], parameters: str
    ) -> Conflict | None:
        if s.way[r, one] == s.way[r, other] or (s.outbound[r, one] and s.outbound[r, other]):
            return None
        gap = float(s.along[r, other] - s.along[r, one]) * s.forward(r, one)
        closing = abs(float(s.speed_along[r, one])) + abs(float(s.speed_along[r, other]))
        if gap <= 0 or s.together(one, other):
            return None
        both_roll = bool(s.rolling[r, one] and s.rolling[r, other])
        stage = "alarm" if both_roll else stage_of(gap / closing, times)
        if stage is None:
            return None
        # the one on final first; its time to threshold goes into the payload
        first, second = (other, one) if s.arrival[r, other] and not s.arrival[r, one] else (one, other)
        names = " and ".join(f"{s.label(row)} {s.doing(r, row)} {s.designator(r, row)}" for row in (first, second))
        fields = closest_approach(s, first, second) | {"time_to_conflict": gap / closing}
        return Conflict(
            rule="opposite_direction",
            runway=s.frames.ids[r],
            tracks=track_ids(s, first, second),
            stage=stage,
            text=f"{names}, meeting in {gap / closing:.0f} s",
            certain=bool(s.certain[one] and s.certain[other]),
            parameter_set=parameters,
            cat004_type=CAT004_OPPOSITE,
            cat011_type=CAT011_TYPE,
            **approach_fields(s, r, first),
            **fields,
        )


PART = OppositeDirection
