"""Where to look from."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from app.view3d.ground import Ground

NEAR_M, FAR_M = 2.0, 30_000.0
WIDE = radians(50.0)

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """A camera in local metres; z is up."""

    position: Triple
    look_at: Triple
    fov: float = WIDE


def overview(ground: Ground) -> Pose:
    """The whole field from the south, north ahead."""
    east, north = ground.centre
    return Pose((east, north - 0.62 * ground.span, 0.50 * ground.span), (east, north - 0.06 * ground.span, 0.0))


def tower(ground: Ground) -> Pose:
    """From the cab towards the middle of the field; without a tower from a hill at its edge."""
    east, north = ground.centre
    eye = ground.tower or (east, north - 0.2 * ground.span, 60.0)
    ahead = np.array([east - eye[0], north - eye[1]])
    distance = float(np.hypot(*ahead)) or 1.0
    out = ahead / distance if distance > 50.0 else np.array([0.0, 1.0])
    position = (eye[0] + 12.0 * float(out[0]), eye[1] + 12.0 * float(out[1]), eye[2])
    return Pose(position, (eye[0] + 900.0 * float(out[0]), eye[1] + 900.0 * float(out[1]), 0.0))


def chase(east: float, north: float, height: float, heading: float, size: float) -> Pose:
    """From behind and above a target."""
    back = max(6.0 * size, 90.0)
    return Pose(
        (east - back * float(np.sin(heading)), north - back * float(np.cos(heading)), height + 0.55 * back),
        (east, north, height + 3.0),
    )
