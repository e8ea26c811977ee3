"""What an alert rule is given and what it answers: the situation on the runways in, conflicts out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.picture import RunwayState, Stage
from pipeline.tables import TargetClass, Tracks

Array = NDArray[Any]


@dataclass(frozen=True)
class SituationSettings:
    """arrival_speed, roll_speed, vehicle_speed: m/s above which a target on final is an arrival, one on the strip is
    rolling, and "vehicle" is taken for a wrong class. arrival_alignment_deg, roll_alignment_deg: from the runway.
    corridor_m, corridor_deg: half width of the final approach at the threshold and how it widens.
    final_m: how far out an arrival is looked for. strip_margin_m: the strip is wider than its pavement by this.
    steep_deg, steep_m: higher than this slope plus this is a go-around or an overflight. airborne_m: higher than this
    over the runway is not on it. vacating_speed: m/s away from the centreline. margin_m, margin_sd, margin_most_m: how
    deep in the protection area a target must be, at least and in standard deviations of its position, and at most.
    braking: m/s^2 that a mobile could brake with before the area. together_m, together_speed: a pair so close with so
    little relative speed is a tow, an escort or one target seen twice. echo_s, echo_m, echo_share: so is a track
    without address and callsign, until it is so old, beside one that has them, so near and with a relative speed of at
    most this share of the other's. airframe_s, airframe_lag_s, airframe_kept_s: so are two that have landed or rolled
    together for so long, no further apart than together_m and so many seconds of way, and for so long after. lead_s: a
    fast track is carried on to the time of the picture by at most this. mover_hits, mover_sd: a track counts as
    arriving or rolling only after so many measurements, and when its speed is so many standard deviations: new tracks
    have wild speeds.
    """

    arrival_speed: float = 25.0
    roll_speed: float = 15.4
    vehicle_speed: float = 35.0
    arrival_alignment_deg: float = 8.0
    roll_alignment_deg: float = 15.0
    corridor_m: float = 60.0
    corridor_deg: float = 3.0
    final_m: float = 15000.0
    strip_margin_m: float = 7.5
    steep_deg: float = 6.0
    steep_m: float = 80.0
    airborne_m: float = 45.0
    vacating_speed: float = 0.7
    margin_m: float = 4.0
    margin_sd: float = 1.0
    margin_most_m: float = 20.0
    braking: float = 2.5
    together_m: float = 60.0
    together_speed: float = 4.0
    echo_s: float = 3.0
    echo_m: float = 120.0
    echo_share: float = 0.4
    airframe_s: float = 5.0
    airframe_lag_s: float = 1.0
    airframe_kept_s: float = 20.0
    lead_s: float = 2.0
    mover_hits: int = 4
    mover_sd: float = 3.0


@dataclass
class Entry:
    """A passed holding position. since: s on the monitor's clock. node: a node felt it. reached: it is in the area."""

    hold: int
    since: float
    node: bool = False
    reached: bool = False


@dataclass(frozen=True, eq=False)
class Situation:
    """What the rules look at. Rows of `tracks` are the columns of every array.

    position, velocity: (N, 2) at `time`. speed, sd: (N,) m/s and m, sd the larger axis of the position's uncertainty.
    usable: (N,) rows that may be held against anybody. certain: (N,) rows well established. landed: (N,) seen on final
    before. along, across, speed_along, speed_across: in each runway's frame. way: 0 when it moves towards ends[0]'s
    landing direction, 1 otherwise. depth: m inside the protection area. on_strip: on the paved runway. arrival: on
    final. time_to_threshold, distance_to_threshold: s and m, nan where not an arrival. rolling: fast along the strip,
    taking off or landing. outbound: flying off the far end. vacating: leaving the area. occupant: on the runway or in
    its area. entering: outside, and too fast to stop before the area. entries: row -> passed holding position.
    airframes: pairs of ids, the smaller first, that are one airframe seen twice.
    """

    airport: Airport
    tracks: Tracks
    time: float
    runways: tuple[RunwayState, ...]
    frames: RunwayFrames
    holds: HoldFrames
    settings: SituationSettings
    degraded: bool
    position: Array
    velocity: Array
    speed: Array
    sd: Array
    usable: Array
    certain: Array
    landed: Array
    along: Array
    across: Array
    speed_along: Array
    speed_across: Array
    way: Array
    depth: Array
    on_strip: Array
    arrival: Array
    time_to_threshold: Array
    distance_to_threshold: Array
    rolling: Array
    outbound: Array
    vacating: Array
    occupant: Array
    entering: Array
    entries: Mapping[int, Entry]
    airframes: frozenset[tuple[int, int]] = frozenset()

    def together(self, one: int, other: int) -> bool:
        """Two rows are a tow, an escort, or one target seen twice."""
        if self.tracks.address[one] and self.tracks.address[one] == self.tracks.address[other]:
            return True
        first, second = sorted((int(self.tracks.id[one]), int(self.tracks.id[other])))
        if (first, second) in self.airframes:
            return True
        apart = float(np.hypot(*(self.position[one] - self.position[other])))
        relative = float(np.hypot(*(self.velocity[one] - self.velocity[other])))
        if apart < self.settings.together_m and relative < self.settings.together_speed:
            return True
        return any(self._echo(*pair, apart, relative) for pair in ((one, other), (other, one)))

    def _echo(self, row: int, of: int, apart: float, relative: float) -> bool:
        """A row is so new, near and alike in motion that it may be an echo of another, which is named."""
        s = self.settings
        young = self.time - float(self.tracks.born[row]) < s.echo_s
        if not young or self._named(row) or not self._named(of):
            return False
        return apart < s.echo_m and relative <= s.echo_share * float(self.speed[of])

    def _named(self, row: int) -> bool:
        return bool(self.tracks.address[row] or str(self.tracks.callsign[row]).strip())

    def forward(self, runway: int, row: int) -> float:
        """+1 when the row moves along the centreline, -1 when against it."""
        return 1.0 if self.way[runway, row] == 0 else -1.0

    def designator(self, runway: int, row: int) -> str:
        """The direction in which the row uses the runway: "24"."""
        return self.frames.designators[runway][int(self.way[runway, row])]

    def doing(self, runway: int, row: int) -> str:
        """What somebody who uses the runway does, in one word for all texts."""
        if self.arrival[runway, row]:
            return "landing"
        if self.landed[row]:
            return "landed"
        return "departing" if self.outbound[runway, row] else "rolling"

    def label(self, row: int) -> str:
        """What a controller calls the target, as the displays do: "AFR123", or "#17" where it has no callsign."""
        return str(self.tracks.callsign[row]).strip() or f"#{int(self.tracks.shown_number[row])}"

    @cached_property
    def aircraft(self) -> Array:
        """(N,) rows held to be aircraft."""
        return np.asarray(self.tracks.category == TargetClass.AIRCRAFT)


@dataclass(frozen=True)
class Conflict:
    """One dangerous constellation, as seen in one situation. Times s, lengths m, (east, north) m.

    tracks: ids of tracks, the moving one first. intruder: which of them is where it must not be; None when none is
    more so than another, as with opposite directions. certain: no need to see it again before the alert is raised.
    cat004_type: message type of ASTERIX CAT004. cat011_type: alert type of CAT011 I600 (free; see each rule).
    """

    rule: str
    runway: str
    tracks: tuple[int, ...]
    stage: Stage
    text: str
    intruder: int | None = None
    certain: bool = False
    holding_point: str | None = None
    time_to_threshold: float | None = None
    distance_to_threshold: float | None = None
    time_to_conflict: float | None = None
    separation: float | None = None
    predicted_separation: float | None = None
    conflict_position: tuple[float, float] | None = None
    parameter_set: str = "default"
    cat004_type: int = 0
    cat011_type: int = 0


class AlertRule(Protocol):
    """A rule: settings in its fields; it keeps nothing between calls."""

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        """The conflicts in one situation, each pair once, the moving target first."""
