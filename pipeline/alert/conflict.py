"""What a rule reports, and the small geometry that rules share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipeline.contracts.alert import Situation
from pipeline.picture import Stage, Visibility


@dataclass(frozen=True)
class RuleSettings:
    """What every rule can be set to. information_s, alarm_s: s of the two stages, and the same in low visibility.

    runways: settings that differ on one runway: {"06/24": {"alarm_s": 20}}. Raises ValueError for settings that make no
    sense.
    """

    information_s: float = 30.0
    alarm_s: float = 15.0
    information_low_s: float = 45.0
    alarm_low_s: float = 30.0
    runways: Mapping[str, Mapping[str, Any]] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.alarm_s <= self.information_s or not 0 <= self.alarm_low_s <= self.information_low_s:
            raise ValueError("0 <= alarm <= information wanted for the times of both visibilities")
        for runway, changes in (self.runways or {}).items():
            try:
                replace(self, **{**changes, "runways": None})
            except TypeError as error:
                raise ValueError(f"runways.{runway}: {error}") from error

    def on(self, runway: str) -> tuple[Self, str]:
        """The settings that hold on a runway, and the name of that parameter set."""
        changes = (self.runways or {}).get(runway)
        if not changes:
            return self, "default"
        return replace(self, **{**changes, "runways": None}), f"runway {runway}"

    def times(self, visibility: Visibility) -> tuple[float, float]:
        """(information, alarm) in s."""
        if visibility == "low":
            return self.information_low_s, self.alarm_low_s
        return self.information_s, self.alarm_s


def stage_of(time: float, times: tuple[float, float]) -> Stage | None:
    """The stage that a time to conflict calls for; None when there is time enough."""
    information, alarm = times
    if time <= alarm:
        return "alarm"
    return "information" if time <= information else None


def closest_approach(situation: Situation, one: int, other: int) -> dict[str, Any]:
    """Payload fields of a pair when both go on straight: separation now and least, when and where.

    t* = -(d . v) / (v . v), not before now, with d and v the relative position and velocity.
    """
    d = situation.position[other] - situation.position[one]
    v = situation.velocity[other] - situation.velocity[one]
    squared = float(v @ v)
    t = max(0.0, -float(d @ v) / squared) if squared > 1e-6 else 0.0
    there = situation.position[other] + situation.velocity[other] * t
    return {
        "time_to_conflict": t,
        "separation": float(np.hypot(*d)),
        "predicted_separation": float(np.hypot(*(d + v * t))),
        "conflict_position": (float(there[0]), float(there[1])),
    }


def approach_fields(situation: Situation, runway: int, row: int) -> dict[str, Any]:
    """Payload fields of an arrival; nothing for others."""
    time = float(situation.time_to_threshold[runway, row])
    if not np.isfinite(time):
        return {}
    return {
        "time_to_threshold": time,
        "distance_to_threshold": float(situation.distance_to_threshold[runway, row]),
    }


def label_of(situation: Situation, track: int) -> str:
    """What a controller would call the track with this id."""
    return situation.label(int(np.nonzero(situation.tracks.id == track)[0][0]))


def track_ids(situation: Situation, *rows: int) -> tuple[int, ...]:
    """The ids of the tracks in these rows."""
    return tuple(int(situation.tracks.id[row]) for row in rows)
