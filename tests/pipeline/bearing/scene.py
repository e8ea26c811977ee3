"""Views of single targets to test with."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.contracts.bearing import TargetView
from pipeline.lab.simulate.closeup import CLOSEUP_TYPES, Posed, closeup
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

VIDEO = VideoFormat()
SITE = RadarSite("smr", east=0.0, north=0.0, height=0.0, video=VIDEO)


def site(**grid: Any) -> RadarSite:
    return replace(SITE, video=VideoFormat(**grid))


def view(
    heading: float,
    *,
    kind: str = "B734",
    range_m: float = 500.0,
    azimuth: float = 1.0,
    seed: int = 1,
    snr_db: float = 22.0,
    video: VideoFormat = VIDEO,
) -> TargetView:
    """A close-up and the window of its detected cells; the middle of the ground is known, as from the extractor."""
    look = closeup(
        np.random.default_rng(seed), [Posed.at(CLOSEUP_TYPES[kind], range_m, azimuth, heading)], snr_db, video
    )
    return framed(look.amplitude, look.first_row, look.first_cell, look.clutter_level, video)


def framed(amplitude: Any, first_row: int, first_cell: int, level: float, video: VideoFormat) -> TargetView:
    rows, cells = np.nonzero(amplitude > level + 16.0 / video.db_per_step)
    top, near = int(rows.min()), int(cells.min())
    return TargetView(
        amplitude=amplitude,
        azimuth=(first_row + 0.5) * video.azimuth_step_rad % (2 * math.pi),
        range_m=video.first_range_m + first_cell * video.range_step_m,
        plot=(top, int(rows.max()) - top + 1, near, int(cells.max()) - near + 1),
    )


def axis_error(a: float, b: float) -> float:
    """a - b modulo pi, in degrees."""
    return math.degrees((a - b + math.pi / 2) % math.pi - math.pi / 2)
