"""A radar small enough to turn hundreds of times a second, with something on its video."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.chain import RadarChain
from pipeline.detect.hybrid import Hybrid
from pipeline.extract.manhattan import Manhattan
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

AZIMUTHS, RANGES, BLOCKS = 96, 128, 8
T0 = 1.7e9
VIDEO = VideoFormat(azimuths=AZIMUTHS, ranges=RANGES, range_step_m=3.0, period_s=1.0)


def small_site(**values: Any) -> RadarSite:
    return RadarSite(**{"id": "smr-1", "east": 0.0, "north": 0.0, "height": 20.0, "video": VIDEO, **values})


def small_chain(detector: Any = None, extractor: Any = None, bearing: Any = None, **values: Any) -> RadarChain:
    """A chain whose kernels are compiled before anybody waits for its thread."""
    made = RadarChain(small_site(**values), 0, detector or Hybrid(), extractor or Manhattan(), bearing=bearing)
    made.warm()
    return made


def turn(scan: int, storm: bool = False) -> Iterator[Sweeps]:
    """The blocks of one turn: three targets on Rayleigh clutter, or nothing but noise of full scale."""
    rng = np.random.default_rng(scan)
    amplitude = np.clip(20 * np.log10(rng.rayleigh(10.0, (AZIMUTHS, RANGES))) / 0.3125, 0, 255).astype(np.uint8)
    for row, cell in ((10, 30), (40, 80), (70, 60)):
        amplitude[row : row + 4, cell : cell + 4] = 180
    if storm:
        amplitude = rng.integers(0, 256, amplitude.shape, dtype=np.uint8)
    for rows in np.split(np.arange(AZIMUTHS, dtype=np.int32), BLOCKS):
        azimuth = (rows + 0.5) * VIDEO.azimuth_step_rad
        yield Sweeps(
            0, scan, rows, azimuth, T0 + scan + rows / AZIMUTHS, amplitude[rows], last=rows[-1] + 1 == AZIMUTHS
        )
