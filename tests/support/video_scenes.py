"""Radar video and detections to test with, and ways to cut them into blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import HealthCheck
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.sites import RadarSite
from pipeline.tables import Detections, Sweeps, VideoFormat

SMALL = VideoFormat(azimuths=96, ranges=150, range_step_m=6.0, beamwidth_rad=0.13)

CUTS = st.lists(st.integers(1, 95), max_size=12)
"""Places at which a scan of SMALL is cut into blocks, in any order."""

INHERITED = [HealthCheck.differing_executors]
"""One test run by several subclasses is what a contract is for."""


def site(video: VideoFormat = SMALL, height: float = 0.0) -> RadarSite:
    return RadarSite("test", east=100.0, north=-50.0, height=height, video=video)


def rayleigh(
    rng: np.random.Generator, shape: tuple[int, ...], mean_db: float, db_per_step: float = 0.3125
) -> NDArray[np.uint8]:
    """Log amplitude of Rayleigh clutter whose mean power is mean_db above 0 dB."""
    power = mean_db + 10 * np.log10(rng.exponential(size=shape))
    return np.clip(np.rint(power / db_per_step), 0, 255).astype(np.uint8)


def strip(amplitude: NDArray[np.uint8], video: VideoFormat, keep: NDArray[np.bool_] | None = None) -> list[Sweeps]:
    """(scans, azimuths, ranges) as one block a scan; keep: (scans, azimuths) rows that were received."""
    blocks = []
    for scan, frame in enumerate(amplitude):
        row = np.arange(video.azimuths, dtype=np.int32)
        if keep is not None:
            row = row[keep[scan]]
        time = 1000.0 + video.period_s * (scan + row / video.azimuths)
        blocks.append(Sweeps(0, scan, row, (row + 0.5) * video.azimuth_step_rad, time, frame[row], last=True))
    return blocks


def cut(block: Sweeps, at: Sequence[int]) -> Iterator[Sweeps]:
    """The block in pieces that begin at the given rows of it."""
    edges = sorted({0, *(min(a, len(block)) for a in at), len(block)})
    for a, b in pairwise(edges):
        yield Sweeps(
            block.radar,
            block.scan,
            block.row[a:b],
            block.azimuth[a:b],
            block.time[a:b],
            block.amplitude[a:b],
            last=block.last and b == len(block),
        )


def packed(cells: NDArray[np.bool_]) -> Detections:
    """Detections of (n, ranges) booleans."""
    words = (cells.shape[1] + 63) // 64
    padded = np.zeros((len(cells), 64 * words), bool)
    padded[:, : cells.shape[1]] = cells
    return Detections(np.packbits(padded, axis=1, bitorder="little").view(np.uint64))


def false_alarm_share(limits: NDArray[np.uint8], mean_db: NDArray[np.float64], db_per_step: float = 0.3125) -> float:
    """Exact chance, mean over the cells, that rounded Rayleigh amplitudes of these mean powers exceed these limits."""
    edge_db = (limits.astype(float) + 0.5) * db_per_step
    return float(np.where(limits == 255, 0.0, np.exp(-(10 ** ((edge_db - mean_db) / 10)))).mean())


def busy_video(video: VideoFormat, scans: int, seed: int = 5) -> Any:
    """Clutter of two levels with small bright targets that move, one of them across north."""
    rng = np.random.default_rng(seed)
    frames = rayleigh(rng, (scans, video.azimuths, video.ranges), 25.0)
    frames[:, :, video.ranges // 2 :] = rayleigh(rng, (scans, video.azimuths, video.ranges - video.ranges // 2), 32.0)
    for scan in range(scans):
        for azimuth, cell in ((0, 40), (30 + scan, 70), (60, 20 + 2 * scan), (90 - scan, 110)):
            rows = np.arange(azimuth - 2, azimuth + 3) % video.azimuths
            frames[scan, rows, cell % (video.ranges - 4) : cell % (video.ranges - 4) + 4] = 220
    return frames
