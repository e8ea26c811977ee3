"""The situation on the runways at one moment: what every rule needs to know about every track, computed once.

All columns are (R, N) = (runways, tracks) unless said otherwise. The alignment and corridor tests follow the usual
arrival prediction of runway monitors: fast, along the centreline, approaching, within a cone that widens outward.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.monitor.geometry import HoldFrames, RunwayFrames
from pipeline.monitor.holds import Entry
from pipeline.picture import RunwayState
from pipeline.tables import Source, TargetClass, TrackPhase, Tracks

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
    little relative speed is a tow, an escort or one target seen twice. lead_s: a fast track is carried on to the time
    of the picture by at most this. mover_hits, mover_sd: a track counts as arriving or rolling only after so many
    measurements, and when its speed is so many standard deviations: new tracks have wild speeds.
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
    lead_s: float = 2.0
    mover_hits: int = 4
    mover_sd: float = 3.0


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

    def together(self, one: int, other: int) -> bool:
        """Two rows are a tow, an escort, or one target seen twice."""
        if self.tracks.address[one] and self.tracks.address[one] == self.tracks.address[other]:
            return True
        near = float(np.hypot(*(self.position[one] - self.position[other]))) < self.settings.together_m
        slow = float(np.hypot(*(self.velocity[one] - self.velocity[other]))) < self.settings.together_speed
        return near and slow

    def forward(self, runway: int, row: int) -> float:
        """+1 when the row moves along the centreline, -1 when against it."""
        return 1.0 if self.way[runway, row] == 0 else -1.0

    def designator(self, runway: int, row: int) -> str:
        """The direction in which the row uses the runway: "24"."""
        return self.frames.designators[runway][int(self.way[runway, row])]

    def label(self, row: int) -> str:
        """What a controller would call the target."""
        callsign = str(self.tracks.callsign[row]).strip()
        return callsign or f"{TargetClass(int(self.tracks.category[row])).name.title()} {int(self.tracks.id[row])}"

    @cached_property
    def aircraft(self) -> Array:
        """(N,) rows held to be aircraft."""
        return np.asarray(self.tracks.category == TargetClass.AIRCRAFT)


def observe(
    airport: Airport,
    frames: RunwayFrames,
    holds: HoldFrames,
    tracks: Tracks,
    time: float,
    runways: tuple[RunwayState, ...],
    settings: SituationSettings,
    degraded: bool = False,
    landed: Set[int] = frozenset(),
) -> Situation:
    """Look at the tracks. Rows with states that are not finite must have been left out. `entries` is empty."""
    s = settings
    velocity = np.ascontiguousarray(tracks.state[:, 2:4])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    lead = np.where(speed > s.roll_speed, np.clip(time - tracks.time, 0.0, s.lead_s), 0.0)
    position = tracks.state[:, :2] + velocity * lead[:, None]
    sd = _largest_deviation(tracks.covariance)
    known_height = np.isfinite(tracks.altitude)
    height = np.where(known_height, tracks.altitude, 0.0)
    usable = (tracks.phase != TrackPhase.TENTATIVE) | ((tracks.sources & (Source.NODE | Source.REPORT)) != 0)
    steady = (tracks.hits >= s.mover_hits) & (speed > s.mover_sd * _largest_deviation(tracks.covariance[:, 2:, 2:]))
    credible = usable & steady & ((tracks.category != TargetClass.VEHICLE) | (speed > s.vehicle_speed))

    along, across = frames.project(position)
    speed_along, speed_across = frames.resolve(velocity)
    way = (speed_along < 0).astype(np.int8)
    length, half = frames.length[:, None], frames.half_width[:, None]
    on_strip = (along >= -30) & (along <= length + 30) & (np.abs(across) <= half + s.strip_margin_m)
    remaining = np.where(way == 0, frames.threshold[:, :1] - along, along - frames.threshold[:, 1:])
    corridor = half + s.corridor_m + np.abs(remaining) * np.tan(np.radians(s.corridor_deg))
    on_course = _aligned(speed_along, speed_across, s.arrival_alignment_deg) & (np.abs(across) <= corridor)
    low = height <= s.steep_m + np.maximum(remaining, 0) * np.tan(np.radians(s.steep_deg))
    fast = credible & (speed > s.arrival_speed)
    arrival = fast & on_course & low & (remaining > 0) & (remaining <= s.final_m) & ~on_strip
    distance = np.where(arrival, remaining, np.nan)
    rolling = credible & on_strip & (np.abs(speed_along) > s.roll_speed) & (height <= s.airborne_m)
    rolling &= _aligned(speed_along, speed_across, s.roll_alignment_deg)
    beyond = np.where(way == 0, along - length, -along)
    outbound = fast & on_course & ~on_strip & (beyond > 0) & (beyond < s.final_m / 3)

    depth = np.stack([frames.depth(r, state.visibility, position) for r, state in enumerate(runways)] or [along])
    on_final = arrival.any(axis=0)
    outward = (np.sign(across) * speed_across) > s.vacating_speed
    vacating = (depth > 0) & ~on_strip & outward
    needed = np.clip(s.margin_sd * sd, s.margin_m, s.margin_most_m)
    on_ground = np.where(known_height, (height <= s.airborne_m) | tracks.on_ground, True)
    inside = (depth >= needed) | ((depth > 0) & on_strip)
    occupant = usable & inside & ~vacating & on_ground & ~on_final & ~outbound.any(axis=0)
    return Situation(
        airport=airport,
        tracks=tracks,
        time=time,
        runways=runways,
        frames=frames,
        holds=holds,
        settings=settings,
        degraded=degraded,
        position=position,
        velocity=velocity,
        speed=speed,
        sd=sd,
        usable=usable,
        certain=(tracks.phase == TrackPhase.CONFIRMED) & (tracks.hits >= 5) & (sd < 12.0),
        landed=np.isin(tracks.id, list(landed)),
        along=along,
        across=across,
        speed_along=speed_along,
        speed_across=speed_across,
        way=way,
        depth=depth,
        on_strip=on_strip,
        arrival=arrival,
        time_to_threshold=distance / np.maximum(np.abs(speed_along), 1e-3),
        distance_to_threshold=distance,
        rolling=rolling,
        outbound=outbound,
        vacating=vacating,
        occupant=occupant,
        entering=_entering(frames, runways, settings, position, velocity, speed, usable & on_ground, depth, outward),
        entries={},
    )


def _largest_deviation(covariance: Array) -> Array:
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    largest = (a + c) / 2 + np.sqrt(((a - c) / 2) ** 2 + b * b)
    return np.asarray(np.sqrt(np.maximum(largest, 0.0)))


def _aligned(along: Array, across: Array, degrees: float) -> Array:
    return np.asarray(np.abs(across) <= np.tan(np.radians(degrees)) * np.abs(along))


def _entering(
    frames: RunwayFrames,
    runways: tuple[RunwayState, ...],
    s: SituationSettings,
    position: Array,
    velocity: Array,
    speed: Array,
    able: Array,
    depth: Array,
    outward: Array,
) -> Array:
    entering = np.zeros(depth.shape, bool)
    rows = np.nonzero(able & (speed > 3.0) & (speed < s.arrival_speed))[0]
    if not len(rows):
        return entering
    stop = position[rows] + velocity[rows] * (speed[rows, None] / (2 * s.braking))
    for r, state in enumerate(runways):
        reached = frames.depth(r, state.visibility, stop) >= s.margin_m
        entering[r, rows] = reached & (depth[r, rows] <= 0) & ~outward[r, rows]
    return entering
