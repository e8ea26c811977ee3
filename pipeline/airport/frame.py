"""The local frame: metres east and north of the airport's reference point."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import Proj


@dataclass(frozen=True)
class LocalFrame:
    """Azimuthal equidistant projection (WGS 84) about the reference point; true to millimetres over an airport.

    latitude, longitude: of the reference point, in degrees (an edge of the system: degrees end here).
    """

    latitude: float
    longitude: float
    _projection: Proj = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        projection = Proj(proj="aeqd", lat_0=self.latitude, lon_0=self.longitude, datum="WGS84", units="m")
        object.__setattr__(self, "_projection", projection)

    def to_local(self, latitude: Any, longitude: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(east, north) in metres of points given in degrees."""
        east, north = self._projection(np.asarray(longitude, float), np.asarray(latitude, float))
        return np.asarray(east), np.asarray(north)

    def to_geodetic(self, east: Any, north: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(latitude, longitude) in degrees of points given in metres."""
        longitude, latitude = self._projection(np.asarray(east, float), np.asarray(north, float), inverse=True)
        return np.asarray(latitude), np.asarray(longitude)
