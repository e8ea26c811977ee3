"""Radar video and detections for the bench of the front end: 4096 x 1024 x 8 bit a turn, calm and flooded."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import SurfaceKind
from pipeline.contracts.detect import Detector
from pipeline.tables import Detections, Sweeps, VideoFormat

VIDEO = VideoFormat()
FRAMES = 3


@dataclass(frozen=True, eq=False)
class Workload:
    """Turns of video and what a detector found in the last of them. runs: of detected cells."""

    frames: NDArray[np.uint8]
    found: Detections
    runs: int


def workload(detector: Detector, targets: int = 160, growth_db: float | None = None, seed: int = 1) -> Workload:
    """Rayleigh clutter with rectangles of aircraft and vehicle size, and the detections of the last turn."""
    rng = np.random.default_rng(seed)
    frames = np.empty((FRAMES, VIDEO.azimuths, VIDEO.ranges), np.uint8)
    for frame in frames:
        power = 10 * np.log10(rng.standard_exponential(frame.shape, dtype=np.float32)) / VIDEO.db_per_step
        np.clip(np.rint(80 + power), 0, 255, out=power)
        frame[:] = power
        for _ in range(targets):
            _paint(frame, rng)
    state = detector.start(VIDEO, growth_db=growth_db)
    found = [detector(turn_of(frames, turn), state) for turn in range(FRAMES)][-1]
    return Workload(frames, found, count_runs(found))


def _paint(frame: NDArray[np.uint8], rng: np.random.Generator) -> None:
    length, width = (38.0, 30.0) if rng.random() < 0.5 else (5.0, 2.0)
    distance, azimuth = rng.uniform(150, 2900), rng.uniform(0, 2 * np.pi)
    rows = max(1, round((length / distance + VIDEO.beamwidth_rad) / VIDEO.azimuth_step_rad))
    cells = max(1, round(width / VIDEO.range_step_m))
    first, start = int(azimuth / VIDEO.azimuth_step_rad), int(distance / VIDEO.range_step_m)
    at = (np.arange(first, first + rows) % VIDEO.azimuths)[:, None], np.arange(start, start + cells)[None]
    frame[at] = np.clip(rng.normal(175, 18, (rows, cells)), 0, 255)


def speckle(runs: int, growth: float = 0.04) -> tuple[Detections, int]:
    """Detections of single cells all over the turn that make about so many runs, and how many they make. growth: part
    of all cells that are over the lower threshold."""
    share = 0.5 - np.sqrt(0.25 - runs / (VIDEO.azimuths * VIDEO.ranges))
    level = np.random.default_rng(2).random((VIDEO.azimuths, VIDEO.ranges), dtype=np.float32)
    packed = [
        np.packbits(level < part, axis=1, bitorder="little").view(np.uint64) for part in (share, max(share, growth))
    ]
    found = Detections(packed[0], growth=packed[1])
    return found, count_runs(found)


def flooded(frames: NDArray[np.uint8], runs: int) -> NDArray[np.uint8]:
    """The same turns with strong single cells all over them, about so many runs."""
    share = 0.5 - np.sqrt(0.25 - runs / (VIDEO.azimuths * VIDEO.ranges))
    hit = np.random.default_rng(4).random(frames.shape, dtype=np.float32) < share
    return np.where(hit, np.uint8(200), frames)


def count_runs(found: Detections) -> int:
    """How many runs of detected cells there are."""
    cells = np.pad(found.cells(VIDEO.ranges), ((0, 0), (1, 0)))
    return int((cells[:, 1:] & ~cells[:, :-1]).sum())


def surface() -> NDArray[np.uint8]:
    """Runways and taxiways like an airport's: strips of pavement through grass."""
    row = (np.arange(VIDEO.azimuths) + 0.5) * VIDEO.azimuth_step_rad
    distance = np.arange(VIDEO.ranges) * VIDEO.range_step_m
    east, north = np.sin(row)[:, None] * distance, np.cos(row)[:, None] * distance
    paved = (np.abs(north + 0.3 * east) % 600 < 50) | (np.abs(east - 0.3 * north) % 900 < 40)
    return np.where(paved, SurfaceKind.TAXIWAY, SurfaceKind.GRASS).astype(np.uint8)


def turn_of(frames: NDArray[np.uint8], turn: int) -> Sweeps:
    """One turn as a block."""
    row = np.arange(VIDEO.azimuths, dtype=np.int32)
    azimuth = ((row + 0.5) * VIDEO.azimuth_step_rad).astype(np.float64)
    return Sweeps(0, turn, row, azimuth, azimuth / (2 * np.pi) + turn, frames[turn % FRAMES], last=True)


def fresh_turn(frames: NDArray[np.uint8], turn: int) -> Sweeps:
    """The same, turned by another angle every time: what learns each cell would learn a speckle that comes again."""
    made = turn_of(frames, turn)
    return replace(made, amplitude=np.roll(made.amplitude, 997 * turn % VIDEO.azimuths, axis=0))


def cut(turn: Sweeps, blocks: int) -> list[Sweeps]:
    """The turn in so many blocks."""
    edges = np.linspace(0, len(turn), blocks + 1).astype(int)
    return [
        replace(turn, row=turn.row[a:b], azimuth=turn.azimuth[a:b], time=turn.time[a:b], amplitude=turn.amplitude[a:b])
        for a, b in itertools.pairwise(edges)
    ]
