"""The life of one alert: raised after k of n looks or at once, escalated at once, lowered and cleared after a while."""

from __future__ import annotations

from collections import deque
from collections.abc import Container
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.contracts.alert import Conflict, Situation
from pipeline.picture import Alert, AlertTarget, Stage
from pipeline.tables import Source, TargetClass

LOOKS_KEPT = 16
"""Looks at which a conflict was there, kept of each."""


@dataclass(frozen=True)
class LifeSettings:
    """raise_hits of raise_looks looks raise an alert that is not certain; looks closer than look_s count as one.

    clear_s: an alert is lowered or cleared after so long without reason. lost_s: an alarm is lowered, and any alert
    cleared, after so long when a target has been lost, which is no proof that the danger is over. refresh_s: a live
    alert's payload is sent again after so long.
    most: live alerts at most; alarms push out information, and what is held back is counted. Raises ValueError for
    settings with which no alert could be raised.
    """

    raise_hits: int = 2
    raise_looks: int = 3
    look_s: float = 0.4
    clear_s: float = 4.0
    lost_s: float = 8.0
    refresh_s: float = 1.0
    most: int = 64

    def __post_init__(self) -> None:
        if self.raise_hits > LOOKS_KEPT:
            raise ValueError(f"raise_hits is at most {LOOKS_KEPT}, the looks that are kept")
        if not 1 <= self.raise_hits <= self.raise_looks or self.most < 1:
            raise ValueError("1 <= raise_hits <= raise_looks and most >= 1 wanted")


@dataclass
class Case:
    """A conflict that is being watched, with its alert once that is raised. Times are on the monitor's own clock.

    alarmed: when the last look called for an alarm; alarm_tracks: the targets that it named.
    """

    conflict: Conflict
    addresses: tuple[str, ...]
    seen: float
    alarmed: float = -np.inf
    looks: deque[int] = field(default_factory=lambda: deque(maxlen=LOOKS_KEPT))
    alert: Alert | None = None
    sent: float = -np.inf
    acknowledged_stage: Stage | None = None
    alarm_tracks: tuple[int, ...] = ()

    def meet(self, conflict: Conflict, addresses: tuple[str, ...], clock: float, look: int) -> None:
        """The conflict is there in this look."""
        self.conflict, self.addresses, self.seen = conflict, addresses, clock
        if conflict.stage == "alarm":
            self.alarmed, self.alarm_tracks = clock, conflict.tracks
        if not self.looks or self.looks[-1] != look:
            self.looks.append(look)

    def ripe(self, look: int, settings: LifeSettings) -> bool:
        """Seen often enough, or certain, to be raised."""
        recent = sum(1 for one in self.looks if one > look - settings.raise_looks)
        return self.conflict.certain or recent >= settings.raise_hits

    def stage(self, clock: float, degraded: bool, present: Container[int], settings: LifeSettings) -> Stage:
        """Alarm as soon as one look says so, and until `clear_s` after the last that did; never on degraded sensors.

        Until `lost_s` when a target that the alarm named is not among those present. A loss raises nothing again.
        """
        lost = any(track not in present for track in self.alarm_tracks)
        still = lost and self.alert is not None and self.alert.stage == "alarm"
        alarm = not degraded and clock - self.alarmed < max(settings.lost_s if still else settings.clear_s, 1e-9)
        return "alarm" if alarm else "information"

    @property
    def intruder(self) -> tuple[int | None, str]:
        """Track and address of the intruder; None and nothing when no target is more to blame than another."""
        return intruder_of(self.conflict, self.addresses)

    def renamed(self, conflict: Conflict, addresses: tuple[str, ...]) -> bool:
        """The same targets although one has a new track: each is the same track or has the same address."""
        if len(self.conflict.tracks) != len(conflict.tracks):
            return False
        known = set(self.conflict.tracks)
        named = {one for one in self.addresses if one}
        return all(
            track in known or address in named for track, address in zip(conflict.tracks, addresses, strict=True)
        )


def intruder_of(conflict: Conflict, addresses: tuple[str, ...]) -> tuple[int | None, str]:
    """Track and address of a conflict's intruder. addresses: of its tracks, in their order."""
    if conflict.intruder is None:
        return None, ""
    return conflict.intruder, addresses[conflict.tracks.index(conflict.intruder)]


def write_alert(case: Case, situation: Situation, rows: dict[int, int], stage: Stage, former: Alert) -> Alert:
    """The alert's payload from the conflict and from the targets as they are now; those lost stay as they were."""
    conflict = case.conflict
    old = {one.track: one for one in former.targets}
    targets, sources, simulated = [], Source.NONE, former.simulated
    for track in conflict.tracks:
        row = rows.get(track)
        if row is None:
            targets += [old[track]] if track in old else []
            continue
        targets.append(describe(situation, row))
        sources |= Source(int(situation.tracks.sources[row]))
        simulated = simulated or bool(situation.tracks.simulated[row])
    fresh = bool(sources)
    runway = situation.runways[situation.frames.ids.index(conflict.runway)]
    return replace(
        former,
        rule=conflict.rule,
        stage=stage,
        worst_stage="alarm" if stage == "alarm" else former.worst_stage,
        text=conflict.text + (" (surveillance degraded)" if situation.degraded else ""),
        updated_at=situation.time,
        targets=tuple(targets),
        runway=conflict.runway,
        holding_point=conflict.holding_point or former.holding_point,
        time_to_threshold=conflict.time_to_threshold,
        distance_to_threshold=conflict.distance_to_threshold,
        time_to_conflict=conflict.time_to_conflict,
        separation=conflict.separation,
        predicted_separation=conflict.predicted_separation,
        conflict_position=conflict.conflict_position,
        visibility=runway.visibility,
        parameter_set=conflict.parameter_set,
        sensors=tuple(str(one.name).lower() for one in Source if one and one in sources) if fresh else former.sensors,
        degraded=situation.degraded,
        simulated=simulated,
        cat004_type=conflict.cat004_type,
        cat011_type=conflict.cat011_type,
    )


def describe(situation: Situation, row: int) -> AlertTarget:
    """A target's part of the payload."""
    tracks, speed = situation.tracks, float(situation.speed[row])
    course = float(np.arctan2(situation.velocity[row, 0], situation.velocity[row, 1]) % (2 * np.pi))
    return AlertTarget(
        track=int(tracks.id[row]),
        callsign=str(tracks.callsign[row]).strip() or None,
        address=str(tracks.address[row]) or None,
        category=TargetClass(int(tracks.category[row])).name.lower(),
        east=float(situation.position[row, 0]),
        north=float(situation.position[row, 1]),
        speed=speed,
        course=course if speed > 0.5 else None,
        number=int(tracks.number[row]) or None,
    )
