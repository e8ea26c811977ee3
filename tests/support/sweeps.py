"""A few sweeps of a radar, for tests that only need some."""

from __future__ import annotations

import time

import numpy as np

from pipeline.sites import RadarSite
from pipeline.tables import Sweeps


def sweeps_of(site: RadarSite, rows: int | None = None, at: float | None = None) -> Sweeps:
    """The first `rows` sweeps of a turn (else all), of one level. at: UTC s of the end of the turn; else now."""
    video = site.video
    row = np.arange(video.azimuths if rows is None else rows, dtype=np.int32)
    begin = (time.time() if at is None else at) - video.period_s
    return Sweeps(
        0, 0, row, (row + 0.5) * video.azimuth_step_rad, begin + row / video.azimuths * video.period_s,
        np.full((len(row), video.ranges), 40, np.uint8), last=len(row) == video.azimuths,
    )  # fmt: skip


def closed_turn(seed: int, azimuths: int = 128, ranges: int = 96) -> np.ndarray:
    """A turn (azimuths, ranges) uint8 as of a radar: bright near, dark far, going on past north, some noise."""
    chance = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(azimuths)[:, None] / azimuths
    reach = np.arange(ranges)[None] / ranges
    waves = sum(np.cos(k * turn + chance.uniform(0, 6)) for k in (1, 2, 3)) / 3
    level = 200 * (1 - reach) * (0.8 + 0.2 * waves)
    return np.clip(level + chance.uniform(0, 6, level.shape), 0, 255).astype(np.uint8)
