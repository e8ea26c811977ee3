"""Values on the wire: pictures, tracks, alerts, sensors and runways as JSON-able rows in the units of the outside.

Every name carries its unit (`_m`, `_mps`, `_deg`, `_s`); times are Unix seconds (UTC) as floats; positions are WGS 84
degrees beside local metres; angles are degrees clockwise from true north; what is not known is null.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.picture import Alert, AlertTarget, Picture, RunwayState, SensorState
from pipeline.tables import Source, TargetClass, TrackPhase, Tracks

Row = dict[str, Any]
"""One JSON object."""

RADIUS_95 = math.sqrt(-2.0 * math.log(0.05))
"""Standard deviations along the long axis within which 95 % of a plane Gaussian's mass lies (2.4477)."""

MOVING_MPS = 0.5
"""Below this speed a course is noise and is reported as absent."""

CLASSES = tuple(one.name.lower() for one in TargetClass)
PHASES = tuple(one.name.lower() for one in TrackPhase)
SOURCES = tuple(
    tuple(str(one.name).lower() for one in (Source.RADAR, Source.NODE, Source.REPORT) if flags & one)
    for flags in range(8)
)

encoder = msgspec.json.Encoder(decimal_format="number")


def encode(value: Any) -> bytes:
    """The value as JSON; NaN and infinities become null."""
    return encoder.encode(value)


def plain(value: Any) -> Any:
    """The value as it comes back from JSON."""
    return msgspec.json.decode(encode(value))


def ellipse_95(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Semi-major and semi-minor axis (m) of the 95 % ellipse of each position, and the bearing of the longer (rad).

    covariance: (n, >=2, >=2) of east and north, m^2. The bearing is from true north, in [-pi/2, pi/2].
    """
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    half_sum, half_difference = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    major, minor = (
        RADIUS_95 * np.sqrt(np.maximum(one, 0.0)) for one in (half_sum + half_difference, half_sum - half_difference)
    )
    return major, minor, 0.5 * np.arctan2(2.0 * b, c - a)


def nullable(values: NDArray[Any], decimals: int) -> list[float | None]:
    """Rounded floats, null where not finite."""
    rounded = np.round(values.astype(np.float64), decimals)
    finite = np.isfinite(rounded)
    if finite.all():
        return rounded.tolist()  # type: ignore[no-any-return]
    made = rounded.astype(object)
    made[~finite] = None
    return made.tolist()  # type: ignore[no-any-return]


def degrees(values: NDArray[Any]) -> NDArray[np.float64]:
    """Radians as degrees in [0, 360), rounded to a tenth first so that 360.0 does not appear."""
    with np.errstate(invalid="ignore"):
        return np.mod(np.round(np.rad2deg(values.astype(np.float64)), 1), 360.0)


def half_degrees(values: NDArray[Any]) -> NDArray[np.float64]:
    """Radians of an axis, which has no sense, as degrees in [0, 180), rounded to a tenth first."""
    with np.errstate(invalid="ignore"):
        return np.mod(np.round(np.rad2deg(values.astype(np.float64)), 1), 180.0)


class Wire:
    """Makes wire rows for one airport. Stateless after construction; may be used from any thread."""

    def __init__(self, airport: Airport, mode: str) -> None:
        self.airport = airport
        self.mode = mode
        self._zones = np.array([*(one.name or one.id for one in airport.features), None], dtype=object)
        self._runways = np.array([*(one.id for one in airport.runways), None], dtype=object)

    def tracks(self, tracks: Tracks) -> list[Row]:
        """One row a track; one projection call for all of them."""
        n = len(tracks)
        if n == 0:
            return []
        columns = self.columns(tracks)
        names = tuple(columns)
        return [dict(zip(names, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def columns(self, tracks: Tracks) -> dict[str, list[Any]]:
        """The wire columns of a table of tracks, each a list of one value a track."""
        east, north = tracks.state[:, 0], tracks.state[:, 1]
        latitude, longitude = self.airport.frame.to_geodetic(east, north)
        speed = np.hypot(tracks.state[:, 2], tracks.state[:, 3])
        course = degrees(np.arctan2(tracks.state[:, 2], tracks.state[:, 3]))
        course[~(speed >= MOVING_MPS)] = np.nan
        major, minor, bearing = ellipse_95(tracks.covariance)
        return {
            "id": tracks.id.tolist(),
            "number": [one or None for one in tracks.number.tolist()],
            "time": np.round(tracks.time, 3).tolist(),
            "lat": nullable(latitude, 7),
            "lon": nullable(longitude, 7),
            "east_m": nullable(east, 2),
            "north_m": nullable(north, 2),
            "altitude_m": nullable(tracks.altitude, 1),
            "on_ground": tracks.on_ground.tolist(),
            "speed_mps": nullable(speed, 2),
            "course_deg": nullable(course, 1),
            "heading_deg": nullable(degrees(tracks.heading), 1),
            "axis_deg": nullable(half_degrees(tracks.axis), 1),
            "length_m": nullable(tracks.length, 1),
            "width_m": nullable(tracks.width, 1),
            "class": [CLASSES[min(one, 2)] for one in tracks.category.tolist()],
            "callsign": [one or None for one in tracks.callsign.tolist()],
            "address": [one or None for one in tracks.address.tolist()],
            "phase": [PHASES[min(one, 2)] for one in tracks.phase.tolist()],
            "zone": self.zone_names(tracks.zone).tolist(),
            "runway": self.runway_names(tracks.runway).tolist(),
            "sources": [SOURCES[one & 7] for one in tracks.sources.tolist()],
            "accuracy_m": nullable(major, 1),
            "accuracy_minor_m": nullable(minor, 1),
            "accuracy_bearing_deg": nullable(half_degrees(bearing), 1),
            "simulated": tracks.simulated.tolist(),
        }

    def zone_names(self, zone: NDArray[Any]) -> NDArray[Any]:
        """Names (or ids) of the features with these indices; None for -1 and for indices that do not exist."""
        last = len(self._zones) - 1
        return np.asarray(self._zones[np.where((zone >= 0) & (zone < last), zone, last)])

    def runway_names(self, runway: NDArray[Any]) -> NDArray[Any]:
        """Ids of the runways with these indices; None for -1."""
        last = len(self._runways) - 1
        return np.asarray(self._runways[np.where((runway >= 0) & (runway < last), runway, last)])

    def position(self, east: float, north: float) -> Row:
        """A point as lat, lon and local metres."""
        latitude, longitude = self.airport.frame.to_geodetic(east, north)
        return {
            "lat": round(float(latitude), 7),
            "lon": round(float(longitude), 7),
            "east_m": round(east, 2),
            "north_m": round(north, 2),
        }

    def alert(self, alert: Alert) -> Row:
        """An alert with everything that is known about it."""
        conflict = alert.conflict_position
        end = alert.cleared_at if alert.cleared_at is not None else alert.updated_at
        return {
            "id": alert.id,
            "rule": alert.rule,
            "stage": alert.stage,
            "worst_stage": alert.worst_stage,
            "state": alert.state,
            "text": alert.text,
            "raised_at": alert.raised_at,
            "updated_at": alert.updated_at,
            "duration_s": round(max(0.0, end - alert.raised_at), 3),
            "runway": alert.runway,
            "holding_point": alert.holding_point,
            "targets": [self._alert_target(one) for one in alert.targets],
            "cleared_at": alert.cleared_at,
            "clear_reason": alert.clear_reason,
            "acknowledged_at": alert.acknowledged_at,
            "acknowledged_by": alert.acknowledged_by,
            "time_to_threshold_s": _rounded(alert.time_to_threshold),
            "distance_to_threshold_m": _rounded(alert.distance_to_threshold),
            "time_to_conflict_s": _rounded(alert.time_to_conflict),
            "separation_m": _rounded(alert.separation),
            "predicted_separation_m": _rounded(alert.predicted_separation),
            "conflict_position": None if conflict is None else self.position(*conflict),
            "visibility": alert.visibility,
            "parameter_set": alert.parameter_set,
            "sensors": list(alert.sensors),
            "degraded": alert.degraded,
            "aural": alert.aural,
            "simulated": alert.simulated,
            "cat004_type": alert.cat004_type,
            "cat011_type": alert.cat011_type,
        }

    def _alert_target(self, target: AlertTarget) -> Row:
        course = target.course
        return {
            "track": target.track,
            "number": target.number,
            "callsign": target.callsign,
            "address": target.address,
            "class": target.category,
            **self.position(target.east, target.north),
            "speed_mps": _rounded(target.speed, 2),
            "course_deg": None if course is None else round(math.degrees(course), 1) % 360.0,
        }

    def sensor(self, sensor: SensorState) -> Row:
        """The health of one sensor with its counters."""
        return asdict(sensor)

    def runway(self, runway: RunwayState) -> Row:
        """How a runway is used and what is on it."""
        row = asdict(runway)
        row["next_arrival_s"] = _rounded(runway.next_arrival_s)
        return row

    def picture(self, picture: Picture, epoch: str, seq: int) -> Row:
        """The whole picture with its place in the stream."""
        return {
            "epoch": epoch,
            "seq": seq,
            "time": picture.time,
            "mode": self.mode,
            "airport": self.airport.icao,
            "tracks": self.tracks(picture.tracks),
            "alerts": [self.alert(one) for one in picture.alerts],
            "runways": [self.runway(one) for one in picture.runways],
            "sensors": [self.sensor(one) for one in picture.sensors],
            "timings_s": picture.timings,
        }


def _rounded(value: float | None, decimals: int = 1) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), decimals)
