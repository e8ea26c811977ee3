"""Where the sensors stand."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.tables import VideoFormat


@dataclass(frozen=True)
class RadarSite:
    """A radar: local metres, antenna height above the ground, the grid of its video.

    north_offset: rad added to the radar's own azimuth to get true azimuth; the assembler does it, sweeps are true.
    simulated: its video is made by a simulator.
    """

    id: str
    east: float
    north: float
    height: float
    video: VideoFormat
    north_offset: float = 0.0
    simulated: bool = False


@dataclass(frozen=True)
class NodeSite:
    """A geomagnetic node in the pavement. heading: rad of the lane it lies in. hold: the holding position it guards.

    accuracy: standard deviation, in metres, of where a thing is when the node feels it.
    """

    id: str
    east: float
    north: float
    heading: float
    hold: str | None = None
    runway: str | None = None
    accuracy: float = 2.0
    simulated: bool = False
