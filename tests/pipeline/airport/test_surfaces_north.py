"""A radar that is mounted askew sees the same ground: sweeps reach the core in true azimuth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.airports import load_airport
from pipeline.airport.surfaces import surface_of_radar
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat


def test_the_north_offset_is_not_added_twice() -> None:
    airport, _ = load_airport("LFPO")
    site = RadarSite("r", 0.0, 0.0, 20.0, VideoFormat(azimuths=360, ranges=128, range_step_m=24.0))
    askew = replace(site, north_offset=0.7)
    np.testing.assert_array_equal(surface_of_radar(airport, site), surface_of_radar(airport, askew))
