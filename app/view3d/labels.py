"""Which targets get a label, and what it says: at most 40, placed so that they do not cover one another."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from math import hypot, tan

import numpy as np
from numpy.typing import NDArray

from app.view3d.movers import MAST_M, Target

MOST = 40
MOVING_MPS = 1.5
KNOTS = 3600.0 / 1852.0
LETTER_PX = 7.0
LINE_PX = 17.0


@dataclass(frozen=True, eq=False)
class Eye:
    """A viewer's camera. rotation: (3, 3) world from camera (x right, y down, z ahead). fov: vertical, rad."""

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    fov: float
    width: float
    height: float

    def pixel(self, east: float, north: float, up: float) -> tuple[float, float] | None:
        """Where a point appears on the screen; None when it is behind the eye or off the screen."""
        x, y, z = self.rotation.T @ (np.array([east, north, up]) - self.position)
        if z <= 1.0:
            return None
        focal = self.height / 2 / tan(self.fov / 2)
        u, v = self.width / 2 + focal * x / z, self.height / 2 + focal * y / z
        return (u, v) if -40 < u < self.width + 40 and -20 < v < self.height + 20 else None


def label_text(target: Target) -> str:
    """One line: gravity, name, speed; what rests on simulated input says so."""
    name = target.name or f"#{target.number}"
    speed = f" {target.speed * KNOTS:.0f} kt" if target.speed >= MOVING_MPS else ""
    gravity = {"alarm": "ALARM ", "information": "INFO "}.get(target.stage or "", "")
    return f"{gravity}{name}{speed}{' coasting' if target.coasting else ''}{' (sim)' if target.simulated else ''}"


def label_height(target: Target) -> float:
    """Height (m) of a label's foot over the ground; that of an alerted target stands on its mast."""
    return target.height + (MAST_M + 6.0 if target.stage else max(6.0, 0.42 * target.size))


def choose(targets: Iterable[Target], selected: Collection[int], eye: Eye | None) -> list[Target]:
    """At most MOST targets: alerted, selected, on a runway, moving, then the nearest with a name.

    With an eye those off the screen are left out, and so are those whose label would cover one of more weight.
    """
    at = (0.0, 0.0) if eye is None else (float(eye.position[0]), float(eye.position[1]))

    def weight(one: Target) -> tuple[int, float]:
        order = (
            0 if one.stage == "alarm" else 1 if one.stage else 2 if one.id in selected else
            3 if one.on_runway else 4 if one.speed >= MOVING_MPS and one.name else 5 if one.speed >= MOVING_MPS else 6
        )  # fmt: skip
        return order, hypot(one.east - at[0], one.north - at[1])

    ranked = sorted((one for one in targets if one.name or weight(one)[0] < 6), key=weight)
    if eye is None:
        return ranked[:MOST]
    chosen: list[Target] = []
    boxes: list[tuple[float, float, float, float]] = []
    for one in ranked:
        place = eye.pixel(one.east, one.north, label_height(one))
        if place is None:
            continue
        half = len(label_text(one)) * LETTER_PX / 2
        box = (place[0] - half, place[1] - LINE_PX, place[0] + half, place[1])
        must = bool(one.stage) or one.id in selected
        if not must and any(_over(box, other) for other in boxes):
            continue
        chosen.append(one)
        boxes.append(box)
        if len(chosen) == MOST:
            break
    return chosen


def _over(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
