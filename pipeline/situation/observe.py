"""The situation on the runways at one moment: what every rule needs to know about every track, computed once.

All columns are (R, N) = (runways, tracks) unless said otherwise. The alignment and corridor tests follow the usual
arrival prediction of runway monitors: fast, along the centreline, approaching, within a cone that widens outward.
"""

from __future__ import annotations

from collections.abc import Set
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.contracts.alert import Situation, SituationSettings
from pipeline.picture import RunwayState
from pipeline.tables import Source, TargetClass, TrackPhase, Tracks

Array = NDArray[Any]

CERTAIN_HITS, CERTAIN_SD_M = 5, 12.0
"""A confirmed track with so many measurements whose position has a smaller standard deviation is certain."""

STRIP_END_MARGIN_M = 30.0
"""The strip is longer than its pavement by this at either end."""

LEAST_CLOSING_SPEED = 1e-3
"""m/s; a slower target is taken for this fast where the time to the threshold is computed."""

CREEPING_SPEED = 3.0
"""m/s; a target that is not faster is not predicted to enter a runway: it can stop within a length of its own."""

OUTBOUND_DIVISOR = 3
"""A departure is followed beyond the far end for the distance at which arrivals are looked for, divided by this."""


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
    mobiles = _mobiles(tracks, time, settings)
    motion = _motion(frames, mobiles, settings)
    position, velocity, across = mobiles.position, mobiles.velocity, motion.across
    depths = [frames.depth(r, state.visibility, position) for r, state in enumerate(runways)]
    depth = np.stack(depths or [motion.along])
    outward = (np.sign(across) * motion.speed_across) > settings.vacating_speed
    vacating = (depth > 0) & ~motion.on_strip & outward
    needed = np.clip(settings.margin_sd * mobiles.sd, settings.margin_m, settings.margin_most_m)
    inside = (depth >= needed) | ((depth > 0) & motion.on_strip)
    flying = motion.arrival.any(axis=0) | motion.outbound.any(axis=0)
    able = mobiles.usable & mobiles.on_ground
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
        speed=mobiles.speed,
        sd=mobiles.sd,
        usable=mobiles.usable,
        certain=(tracks.phase == TrackPhase.CONFIRMED) & (tracks.hits >= CERTAIN_HITS) & (mobiles.sd < CERTAIN_SD_M),
        landed=np.isin(tracks.id, list(landed)),
        **motion._asdict(),
        time_to_threshold=motion.distance_to_threshold / np.maximum(np.abs(motion.speed_along), LEAST_CLOSING_SPEED),
        depth=depth,
        vacating=vacating,
        occupant=able & inside & ~vacating & ~flying,
        entering=_entering(frames, runways, settings, mobiles, able, depth, outward),
        entries={},
    )


class _Mobiles(NamedTuple):
    """What does not depend on a runway. (N, 2) position, velocity, else (N,); height: m over the airport, 0 where it
    is not known. credible: what it says of its motion may be believed."""

    position: Array
    velocity: Array
    speed: Array
    sd: Array
    height: Array
    usable: Array
    credible: Array
    on_ground: Array


def _mobiles(tracks: Tracks, time: float, s: SituationSettings) -> _Mobiles:
    velocity = np.ascontiguousarray(tracks.state[:, 2:4])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    lead = np.where(speed > s.roll_speed, np.clip(time - tracks.time, 0.0, s.lead_s), 0.0)
    known_height = np.isfinite(tracks.altitude)
    height = np.where(known_height, tracks.altitude, 0.0)
    usable = (tracks.phase != TrackPhase.TENTATIVE) | ((tracks.sources & (Source.NODE | Source.REPORT)) != 0)
    steady = (tracks.hits >= s.mover_hits) & (speed > s.mover_sd * _largest_deviation(tracks.covariance[:, 2:, 2:]))
    return _Mobiles(
        position=tracks.state[:, :2] + velocity * lead[:, None],
        velocity=velocity,
        speed=speed,
        sd=_largest_deviation(tracks.covariance),
        height=height,
        usable=usable,
        credible=usable & steady & ((tracks.category != TargetClass.VEHICLE) | (speed > s.vehicle_speed)),
        on_ground=np.where(known_height, (height <= s.airborne_m) | tracks.on_ground, True),
    )


class _Motion(NamedTuple):
    """Place and motion in the frame of each runway, (R, N), named as in Situation."""

    along: Array
    across: Array
    speed_along: Array
    speed_across: Array
    way: Array
    on_strip: Array
    arrival: Array
    distance_to_threshold: Array
    rolling: Array
    outbound: Array


def _motion(frames: RunwayFrames, mobiles: _Mobiles, s: SituationSettings) -> _Motion:
    along, across = frames.project(mobiles.position)
    speed_along, speed_across = frames.resolve(mobiles.velocity)
    way = (speed_along < 0).astype(np.int8)
    length, half = frames.length[:, None], frames.half_width[:, None]
    beside_centre = np.abs(across) <= half + s.strip_margin_m
    on_strip = (along >= -STRIP_END_MARGIN_M) & (along <= length + STRIP_END_MARGIN_M) & beside_centre
    remaining = np.where(way == 0, frames.threshold[:, :1] - along, along - frames.threshold[:, 1:])
    corridor = half + s.corridor_m + np.abs(remaining) * np.tan(np.radians(s.corridor_deg))
    on_course = _aligned(speed_along, speed_across, s.arrival_alignment_deg) & (np.abs(across) <= corridor)
    low = mobiles.height <= s.steep_m + np.maximum(remaining, 0) * np.tan(np.radians(s.steep_deg))
    fast = mobiles.credible & (mobiles.speed > s.arrival_speed)
    arrival = fast & on_course & low & (remaining > 0) & (remaining <= s.final_m) & ~on_strip
    on_runway = mobiles.credible & on_strip & (mobiles.height <= s.airborne_m)
    along_runway = (np.abs(speed_along) > s.roll_speed) & _aligned(speed_along, speed_across, s.roll_alignment_deg)
    beyond = np.where(way == 0, along - length, -along)
    return _Motion(
        along=along,
        across=across,
        speed_along=speed_along,
        speed_across=speed_across,
        way=way,
        on_strip=on_strip,
        arrival=arrival,
        distance_to_threshold=np.where(arrival, remaining, np.nan),
        rolling=on_runway & along_runway,
        outbound=fast & on_course & ~on_strip & (beyond > 0) & (beyond < s.final_m / OUTBOUND_DIVISOR),
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
    mobiles: _Mobiles,
    able: Array,
    depth: Array,
    outward: Array,
) -> Array:
    position, velocity, speed = mobiles.position, mobiles.velocity, mobiles.speed
    entering = np.zeros(depth.shape, bool)
    rows = np.nonzero(able & (speed > CREEPING_SPEED) & (speed < s.arrival_speed))[0]
    if not len(rows):
        return entering
    stop = position[rows] + velocity[rows] * (speed[rows, None] / (2 * s.braking))
    for r, state in enumerate(runways):
        reached = frames.depth(r, state.visibility, stop) >= s.margin_m
        entering[r, rows] = reached & (depth[r, rows] <= 0) & ~outward[r, rows]
    return entering
