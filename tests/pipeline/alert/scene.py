"""A small hand-made airport and scripted traffic on it.

One runway 09/27, 3 km along the east axis, 45 m wide; holding positions 90 m (Cat I) north and south of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from shapely.geometry import LineString, Point, box

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Airport, HoldingPosition, Runway, RunwayEnd, TaxiGraph
from pipeline.alert import closed_runway, hold_entry, opposite_direction, runway_occupied
from pipeline.alert.monitor import AlertMonitor
from pipeline.picture import Alert, AlertChange, RunwayState
from pipeline.tables import NodeEvents, Source, TargetClass, TrackPhase, Tracks

RULES = (runway_occupied.PART(), hold_entry.PART(), opposite_direction.PART(), closed_runway.PART())
IN_USE = (RunwayState("09/27", in_use="09"),)


def hold(id: str, east: float, north: float, heading: float) -> HoldingPosition:
    bar = LineString([(east - 15, north), (east + 15, north)])
    return HoldingPosition(id, id, Point(east, north), bar, heading, "09/27")


def small_airport() -> Airport:
    ends = (RunwayEnd("09", Point(-1500, 0), np.pi / 2), RunwayEnd("27", Point(1500, 0), 3 * np.pi / 2))
    runway = Runway(
        "09/27",
        ends,
        LineString([(-1500, 0), (1500, 0)]),
        45.0,
        box(-1500, -22.5, 1500, 22.5),
        {"normal": box(-1600, -90, 1600, 90), "low": box(-1600, -150, 1600, 150)},
    )
    holds = (
        hold("A1", -1450, -90, 0.0),
        hold("B1", 0, -90, 0.0),
        hold("N1", 0, 90, np.pi),
        hold("E1", 1400, -90, 0.0),
        hold("F1", 700, -220, 0.0),
    )
    return Airport("TEST", "Test", LocalFrame(48.7, 2.4), (runway,), holds, (), TaxiGraph((), ()))


@dataclass
class Mover:
    """A target that follows (time s, east, north) waypoints at constant speed between them."""

    id: int
    path: list[tuple[float, float, float]]
    category: TargetClass = TargetClass.AIRCRAFT
    extra: dict[str, Any] = field(default_factory=dict)

    def at(self, time: float) -> tuple[float, float, float, float] | None:
        t, east, north = (np.array(one, float) for one in zip(*self.path, strict=True))
        if not t[0] <= time <= t[-1]:
            return None
        i = min(int(np.searchsorted(t, time, side="right")) - 1, len(t) - 2)
        share = (time - t[i]) / (t[i + 1] - t[i])
        v = np.array([east[i + 1] - east[i], north[i + 1] - north[i]]) / (t[i + 1] - t[i])
        return (
            float(east[i] + share * (east[i + 1] - east[i])),
            float(north[i] + share * (north[i + 1] - north[i])),
            float(v[0]),
            float(v[1]),
        )


def elongated(along: float, across: float, degrees: float = 0.0) -> np.ndarray[Any, Any]:
    """A covariance of two coordinates with these standard deviations, its first axis turned so far from the east."""
    turn = np.radians(degrees)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray(axes @ np.diag([along**2, across**2]) @ axes.T)


def _covariance(mover: Mover) -> np.ndarray[Any, Any]:
    """sd and speed_sd of `extra`: a standard deviation of both coordinates, or the covariance of the two."""
    whole = np.zeros((4, 4))
    for first, name, usual in ((0, "sd", 2.0), (2, "speed_sd", 0.7)):
        given = mover.extra.get(name, usual)
        whole[first : first + 2, first : first + 2] = given if np.ndim(given) else np.eye(2) * given**2
    return whole


def tracks_at(movers: list[Mover], time: float, noise: np.random.Generator | None = None) -> Tracks:
    rows = [(mover, state) for mover in movers if (state := mover.at(time)) is not None]
    if not rows:
        return Tracks.empty()
    states = np.array([state for _, state in rows])
    if noise is not None:
        states += noise.normal(0, [2.0, 2.0, 0.7, 0.7], states.shape)
    extra = {
        name: [mover.extra.get(name, default) for mover, _ in rows]
        for name, default in {
            "address": "",
            "callsign": "",
            "simulated": False,
            "altitude": np.nan,
            "heading": np.nan,
            "hits": 20,
            "born": 0.0,
            "phase": TrackPhase.CONFIRMED,
            "sources": Source.RADAR,
        }.items()
    }
    covariance = np.stack([_covariance(mover) for mover, _ in rows])
    return Tracks.build(
        len(rows),
        id=[mover.id for mover, _ in rows],
        time=time,
        state=states,
        covariance=covariance,
        category=[mover.category for mover, _ in rows],
        updated=time,
        **extra,
    )


def monitor(**settings: Any) -> AlertMonitor:
    return AlertMonitor(
        small_airport(), settings.pop("rules", RULES), runways=settings.pop("runways", IN_USE), **settings
    )


@dataclass
class Played:
    changes: list[AlertChange]
    live: list[tuple[float, tuple[Alert, ...]]]

    def raised(self, rule: str | None = None) -> list[Alert]:
        return [c.alert for c in self.changes if c.operation == "raise" and rule in (None, c.alert.rule)]

    def stages(self, rule: str) -> set[str]:
        return {c.alert.stage for c in self.changes if c.alert.rule == rule and c.operation != "clear"}


def play(
    watch: AlertMonitor,
    movers: list[Mover],
    start: float,
    end: float,
    step: float = 1.0,
    noise: int | None = None,
    degraded: bool = False,
    events: dict[float, int] | None = None,
) -> Played:
    """Update once a `step`. events: time -> node index. noise: seed of the tracks' errors."""
    rng = None if noise is None else np.random.default_rng(noise)
    played = Played([], [])
    for time in np.arange(start, end + 1e-9, step):
        felt = [node for at, node in (events or {}).items() if time - step < at <= time]
        table = NodeEvents.build(len(felt), time=float(time), node=felt) if felt else None
        played.changes += watch.update(tracks_at(movers, float(time), rng), float(time), degraded, table)
        played.live.append((float(time), watch.alerts))
    return played


def arrival(id: int = 1, threshold_at: float = 60.0, speed: float = 70.0, way: int = 1, **extra: Any) -> Mover:
    """On final from 60 s out, crosses the threshold at `threshold_at`, brakes and turns off at the middle."""
    x0 = -1500.0 * way
    return Mover(
        id,
        [
            (threshold_at - 60, x0 - way * 60 * speed, 0),
            (threshold_at, x0, 0),
            (threshold_at + 10, x0 + way * 600, 0),
            (threshold_at + 30, x0 + way * 1400, 0),
            (threshold_at + 40, x0 + way * 1500, 0),
            (threshold_at + 52, 0, 100 * way),
            (threshold_at + 80, 0, 300 * way),
        ],
        extra={"callsign": f"AFR{id}", "address": f"39000{id % 10}", **extra},
    )


def departure(id: int = 2, at: float = 0.0, way: int = 1, lineup: float = 40.0) -> Mover:
    """Lines up over `lineup` s before `at`, then rolls and leaves at the far end."""
    x0 = -1450.0 * way
    path = [(at - lineup - 60, x0, -130), (at - lineup, x0, -125), (at - lineup + 20, x0, 0), (at - 1, x0 + 5 * way, 0)]
    for t in range(0, 61, 2):
        path.append((at + t, x0 + way * (6 + min(0.9 * t * t, 1500) + max(0, t - 41) * 75), 0))
    return Mover(id, path, extra={"callsign": f"DEP{id}"})


def parked(id: int, east: float, north: float, category: TargetClass = TargetClass.VEHICLE, **extra: Any) -> Mover:
    return Mover(id, [(-1e4, east, north), (1e4, east, north + 1e-6)], category, extra)
