"""The compact record of an airport's traffic that is shipped: clean trajectories at one sample a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.frame import LocalFrame
from pipeline.lab.simulate.paths import Movement
from pipeline.lab.simulate.traffic import Trajectory, motion
from pipeline.reference.types import TYPES, type_of

Floats = NDArray[np.float64]

FORMAT = "airside-traffic-1"


class RecordingError(ValueError):
    """The document is not a traffic record of this format."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Trajectories within a window of `length` seconds; their time is counted from its beginning.

    start: UTC s of the beginning in the record. attribution: whom to name, and the licence.
    """

    icao: str
    start: float
    length: float
    trajectories: tuple[Trajectory, ...]
    attribution: str = ""


def cut(trajectories: Sequence[Trajectory], start: float, length: float) -> list[Trajectory]:
    """What of the trajectories lies in the window, with time counted from its start; shorter than 5 s is left out."""
    kept = []
    for one in trajectories:
        inside = (one.time >= start) & (one.time <= start + length)
        if np.sum(inside) < 6:
            continue
        columns = {
            name: getattr(one, name)[inside]
            for name in ("time", "east", "north", "altitude", "heading", "speed", "on_ground")
        }
        columns["time"] = columns["time"] - start
        kept.append(Trajectory(one.address, one.callsign, **columns))
    return kept


def to_document(recording: Recording, frame: LocalFrame, account: Mapping[str, Any]) -> dict[str, Any]:
    """The record as plain values: decimetres, coded as differences; speeds and headings are made again on reading."""
    return {
        "format": FORMAT,
        "icao": recording.icao,
        "attribution": recording.attribution,
        "origin": [frame.latitude, frame.longitude],
        "start": recording.start,
        "length": recording.length,
        "cleaning": dict(account),
        "aircraft": [
            {
                "address": one.address,
                "callsign": one.callsign,
                "type": type_of(one.callsign, one.address).name,
                "time": float(one.time[0]),
                "east": _differences(one.east),
                "north": _differences(one.north),
                "altitude": _differences(one.altitude),
            }
            for one in recording.trajectories
        ],
    }


def from_document(document: Mapping[str, Any], frame: LocalFrame) -> Recording:
    """The record in the metres of `frame`. Raises RecordingError."""
    if document.get("format") != FORMAT:
        raise RecordingError(f"not a traffic record of the format {FORMAT}")
    try:
        own = LocalFrame(*document["origin"])
        made = [_trajectory(one, own, frame) for one in document["aircraft"]]
        return Recording(
            str(document["icao"]),
            float(document["start"]),
            float(document["length"]),
            tuple(made),
            str(document.get("attribution", "")),
        )
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise RecordingError(f"damaged traffic record: {error!r}") from error


def _differences(values: Floats) -> list[int]:
    whole = np.round(values * 10).astype(np.int64)
    return [int(whole[0]), *np.diff(whole).tolist()]


def _trajectory(one: Mapping[str, Any], own: LocalFrame, frame: LocalFrame) -> Trajectory:
    east, north, altitude = (np.cumsum(np.asarray(one[name], float)) / 10 for name in ("east", "north", "altitude"))
    if not len(east) == len(north) == len(altitude) >= 2:
        raise ValueError(f"columns of {one['address']} differ in length")
    east, north = frame.to_local(*own.to_geodetic(east, north))
    speed, heading = motion(east, north)
    time = np.arange(len(east), dtype=np.float64) + float(one["time"])
    return Trajectory(
        str(one["address"]), str(one["callsign"]), time, east, north, altitude, heading, speed, altitude < 5.0
    )


def recorded_movements(recording: Recording, clearance: float = 45.0) -> list[Movement]:
    """The trajectories as movements of a loop, with aircraft left standing where their record begins or ends at rest.

    A recorded aircraft falls silent at its stand but does not leave: it stands there, without transponder, from the
    beginning of the loop or until its end, as far as nothing else comes within `clearance` metres.
    """
    made = []
    last = int(recording.length)
    afters = [
        _free(recording, number, range(int(one.time[-1]) + 1, last + 1), -1, clearance)
        if one.on_ground[-1] and one.speed[-1] < 1.0
        else 0
        for number, one in enumerate(recording.trajectories)
    ]
    for number, one in enumerate(recording.trajectories):
        before = 0
        if one.on_ground[0] and one.speed[0] < 1.0:
            before = _free(recording, number, range(int(one.time[0]) - 1, -1, -1), 0, clearance)
            before = min([before, *_until_left(recording, number, afters, clearance)])
        pad = (before, afters[number])
        kind = TYPES[type_of(one.callsign, one.address).name]
        made.append(
            Movement(
                kind.name,
                one.callsign,
                one.address,
                float(one.time[0]) - before,
                np.pad(one.east, pad, mode="edge"),
                np.pad(one.north, pad, mode="edge"),
                np.pad(one.altitude, pad, mode="edge"),
                np.pad(one.heading, pad, mode="edge"),
                np.pad(one.speed, pad, constant_values=0.0),
                np.pad(one.on_ground, pad, mode="edge"),
                np.pad(np.ones(len(one.time), bool), pad, constant_values=False),
                simulated=False,
            )
        )
    return made


def _free(recording: Recording, number: int, seconds: range, end: int, clearance: float) -> int:
    """How many of the seconds, in their order, nobody else comes near where this aircraft stands."""
    own = recording.trajectories[number]
    limit = len(seconds)
    for index, other in enumerate(recording.trajectories):
        if index == number:
            continue
        near = np.hypot(other.east - own.east[end], other.north - own.north[end]) < clearance
        near &= other.on_ground
        if other.address == own.address:
            # the same aircraft cannot stand here while it moves there
            near[:] = True
        for second in other.time[near]:
            if seconds.start is not None and int(second) in seconds:
                limit = min(limit, seconds.index(int(second)))
    return limit


def _until_left(recording: Recording, number: int, afters: list[int], clearance: float) -> list[int]:
    """For every other aircraft that is left standing here: the seconds since it is gone."""
    own = recording.trajectories[number]
    return [
        max(int(own.time[0] - other.time[-1] - after) - 1, 0)
        for other, after in zip(recording.trajectories, afters, strict=True)
        if other is not own
        and after
        and other.time[-1] < own.time[0]
        and np.hypot(other.east[-1] - own.east[0], other.north[-1] - own.north[0]) < clearance
    ]
