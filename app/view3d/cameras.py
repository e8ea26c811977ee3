"""Where to look from."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import numpy as np

from app.view3d.ground import Ground

NEAR_M, FAR_M = 2.0, 40_000.0
WIDE = radians(50.0)
TOWER = radians(58.0)
STEEP = radians(52.0)
ASPECT = 1.6
"""Width to height of the screens for which the overview is made."""

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """A camera in local metres; z is up."""

    position: Triple
    look_at: Triple
    fov: float = WIDE


def overview(ground: Ground) -> Pose:
    """All runways from the south, north ahead, as near as they still fit on the screen."""
    east, north = ground.centre
    back, up = np.cos(STEEP), np.sin(STEEP)
    relative = ground.corners - np.array(ground.centre) if len(ground.corners) else np.array([[ground.span / 2, 0.0]])
    across, ahead = relative[:, 0], relative[:, 1] * back
    high = relative[:, 1] * up
    # At a distance d a point appears at across / (d + ahead) and high / (d + ahead) of the focal length.
    fit = tan(WIDE / 2) * 0.94
    distance = float(max(np.max(np.abs(across) / (fit * ASPECT) - ahead), np.max(np.abs(high) / fit - ahead), 400.0))
    return Pose((east, north - distance * float(back), distance * float(up)), (east, north, 0.0))


def tower(ground: Ground) -> Pose:
    """From above the cab towards the nearest runway; without a tower from a hill at the edge of the field."""
    eye = ground.tower or (ground.centre[0], ground.centre[1] - 0.2 * ground.span, 60.0)
    aim = np.array([ground.watched[0] - eye[0], ground.watched[1] - eye[1]])
    distance = float(np.hypot(aim[0], aim[1]))
    out = aim / distance if distance > 50.0 else np.array([0.0, 1.0])
    position = (eye[0] + 12.0 * float(out[0]), eye[1] + 12.0 * float(out[1]), eye[2])
    reach = max(distance, 300.0)
    return Pose(position, (eye[0] + reach * float(out[0]), eye[1] + reach * float(out[1]), 0.0), TOWER)


def chase(east: float, north: float, height: float, heading: float, size: float) -> Pose:
    """From behind and above a target."""
    back = max(5.0 * size, 90.0)
    return Pose(
        (east - back * float(np.sin(heading)), north - back * float(np.cos(heading)), height + 0.5 * back),
        (east, north, height + 3.0),
    )
