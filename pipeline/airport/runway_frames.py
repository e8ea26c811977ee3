"""Runways and holding positions as arrays: every track is seen along and across every runway at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.picture import Visibility

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class RunwayFrames:
    """One frame a runway: along counts from the start of the centreline towards its end, across to the right of that.

    origin: (R, 2) m. unit: (R, 2) direction of along. length, half_width: (R,) m. threshold: (R, 2) along of the
    thresholds of ends[0] and ends[1]. areas: per runway the protection area by visibility, prepared.
    """

    ids: tuple[str, ...]
    designators: tuple[tuple[str, str], ...]
    origin: Array
    unit: Array
    length: Array
    half_width: Array
    threshold: Array
    areas: tuple[dict[str, shapely.Polygon], ...]

    @classmethod
    def build(cls, airport: Airport) -> RunwayFrames:
        """The frames of all runways, in the order of `airport.runways`."""
        count = len(airport.runways)
        origin, unit, threshold = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
        length, half = np.zeros(count), np.zeros(count)
        for i, runway in enumerate(airport.runways):
            line = np.asarray(runway.centreline.coords)[:, :2]
            span = line[-1] - line[0]
            length[i] = np.hypot(*span)
            origin[i], unit[i], half[i] = line[0], span / max(length[i], 1e-9), runway.width / 2
            for k, end in enumerate(runway.ends):
                threshold[i, k] = (np.array([end.threshold.x, end.threshold.y]) - origin[i]) @ unit[i]
            for area in runway.protection.values():
                shapely.prepare(area)
        return cls(
            ids=tuple(one.id for one in airport.runways),
            designators=tuple((r.ends[0].designator, r.ends[1].designator) for r in airport.runways),
            origin=origin,
            unit=unit,
            length=length,
            half_width=half,
            threshold=threshold,
            areas=tuple(dict(one.protection) for one in airport.runways),
        )

    def project(self, position: Array) -> tuple[Array, Array]:
        """(along, across), each (R, N) m, of (N, 2) positions."""
        offset = position[None, :, :] - self.origin[:, None, :]
        return self.resolve(offset)

    def resolve(self, vector: Array) -> tuple[Array, Array]:
        """(along, across), each (R, N), of (N, 2) or (R, N, 2) vectors; across is positive to the right."""
        vector = np.broadcast_to(vector, (len(self.ids), *vector.shape[-2:]))
        along = np.einsum("rnk,rk->rn", vector, self.unit)
        right = np.stack([self.unit[:, 1], -self.unit[:, 0]], axis=1)
        return along, np.einsum("rnk,rk->rn", vector, right)

    def depth(self, runway: int, visibility: Visibility, position: Array) -> Array:
        """How far inside the protection area each of (N, 2) positions is, m; -1 outside."""
        areas = self.areas[runway]
        area = areas.get(visibility) or areas.get("normal")
        depth = np.full(len(position), -1.0)
        if area is None or area.is_empty or not len(position):
            return depth
        inside = np.asarray(shapely.contains_xy(area, position[:, 0], position[:, 1]))
        if inside.any():
            depth[inside] = shapely.distance(shapely.points(position[inside]), area.boundary)
        return depth


@dataclass(frozen=True, eq=False)
class HoldFrames:
    """One frame a holding position. position, unit: (H, 2), unit towards the runway. half: (H,) half of the bar, m.

    runway: (H,) index of the runway it guards. Holding positions of runways that the airport has not are left out.
    """

    ids: tuple[str, ...]
    names: tuple[str, ...]
    position: Array
    unit: Array
    half: Array
    runway: Array

    @classmethod
    def build(cls, airport: Airport) -> HoldFrames:
        """The frames of all holding positions that guard a runway of this airport."""
        index: dict[str, int] = {}
        for i, runway in enumerate(airport.runways):
            index |= {runway.id: i, runway.ends[0].designator: i, runway.ends[1].designator: i}
        holds = [one for one in airport.holding_positions if one.runway in index]
        return cls(
            ids=tuple(one.id for one in holds),
            names=tuple(one.name or one.id for one in holds),
            position=np.array([[h.position.x, h.position.y] for h in holds]).reshape(-1, 2),
            unit=np.array([[np.sin(h.heading), np.cos(h.heading)] for h in holds]).reshape(-1, 2),
            half=np.array([max(h.line.length / 2, 10.0) for h in holds]),
            runway=np.array([index[h.runway] for h in holds], dtype=np.int64),
        )

    def project(self, position: Array) -> tuple[Array, Array]:
        """(beyond, lateral), each (H, N) m: how far past the bar towards the runway, how far from its middle."""
        offset = position[None, :, :] - self.position[:, None, :]
        beyond = np.einsum("hnk,hk->hn", offset, self.unit)
        lateral = offset[..., 0] * self.unit[:, None, 1] - offset[..., 1] * self.unit[:, None, 0]
        return beyond, lateral
