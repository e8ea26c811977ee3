"""A closed runway is used: somebody comes to land on it, rolls on it, or an aircraft taxies onto it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.alert.conflict import RuleSettings, approach_fields, stage_of, track_ids
from pipeline.contracts.alert import Conflict, Situation
from pipeline.picture import Stage

CAT004_CLOSED = 30
CAT011_TYPE = 4


@dataclass(frozen=True)
class ClosedRunway(RuleSettings):
    """Stages by time to threshold of an arrival; rolling is an alarm. taxi: aircraft on the strip are reported too.

    Vehicles are not: they are what a runway is closed for.
    """

    information_s: float = 60.0
    alarm_s: float = 30.0
    information_low_s: float = 90.0
    alarm_low_s: float = 45.0
    taxi: bool = True

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        """Everybody who uses a runway that is closed."""
        s, found = situation, []
        for r, state in enumerate(s.runways):
            if state.open:
                continue
            settings, parameters = self.on(state.id)
            times = settings.times(state.visibility)
            for row in np.nonzero(s.arrival[r])[0]:
                time = float(s.time_to_threshold[r, row])
                stage = stage_of(time, times)
                if stage is not None:
                    text = f"{s.label(int(row))} landing on closed runway {s.designator(r, int(row))} in {time:.0f} s"
                    found.append(_conflict(s, r, int(row), stage, text, parameters))
            for row in np.nonzero(s.rolling[r])[0]:
                text = f"{s.label(int(row))} rolling on closed runway {s.designator(r, int(row))}"
                found.append(_conflict(s, r, int(row), "alarm", text, parameters))
            if settings.taxi:
                taxiing = s.usable & s.aircraft & s.on_strip[r] & s.occupant[r] & ~s.rolling[r]
                for row in np.nonzero(taxiing)[0]:
                    text = f"{s.label(int(row))} on closed runway {state.id}"
                    found.append(_conflict(s, r, int(row), "information", text, parameters))
        return tuple(found)


def _conflict(s: Situation, r: int, row: int, stage: Stage, text: str, parameters: str) -> Conflict:
    position: tuple[Any, Any] = (float(s.position[row, 0]), float(s.position[row, 1]))
    return Conflict(
        rule="closed_runway",
        runway=s.frames.ids[r],
        tracks=track_ids(s, row),
        intruder=int(s.tracks.id[row]),
        stage=stage,
        text=text,
        certain=bool(s.certain[row]),
        conflict_position=position,
        parameter_set=parameters,
        cat004_type=CAT004_CLOSED,
        cat011_type=CAT011_TYPE,
        **approach_fields(s, r, row),
    )


PART = ClosedRunway
