"""Recording the demonstration's video to a file, with the truth beside it."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np

from app.assembly import radar_site
from app.demo.feed import VideoChannel
from app.demo.pcap import PcapWriter
from app.demo.scene import demo_settings, demo_world
from app.settings import Settings
from pipeline.lab.simulate.rain import shower
from pipeline.lab.simulate.video import SECTORS, VideoSimulator
from pipeline.lab.simulate.world import World

_TRUTH = (
    "id", "east", "north", "altitude", "heading", "speed", "length", "width", "category", "callsign", "address",
    "on_ground", "simulated",
)  # fmt: skip


def record_video(
    settings: Settings,
    path: Path,
    scans: int,
    start: float,
    progress: Callable[[], object] = lambda: None,
    *,
    after: float = 0.0,
) -> Path:
    """Write `scans` turns from `start` (UTC s) on as .npz (scans, t) or .pcap; the path of the truth (.csv) beside it.

    after: s of the demonstration that have passed at `start`.
    Raises ValueError for another kind of file, OSError when it cannot be written.
    """
    if path.suffix not in (".npz", ".pcap"):
        raise ValueError(f"{path}: the file must end in .npz or .pcap")
    settings = demo_settings(settings)
    world = demo_world(settings, start - after)
    site = radar_site(settings.radars[0], world.airport)
    rain = shower(settings.demo.seed, start + 10.0) if settings.demo.rain else ()
    video = VideoSimulator(world.airport, site, settings.demo.seed, start=start, rain=rain)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".npz":
        grid = site.video
        made = np.empty((scans, grid.azimuths, grid.ranges), np.uint8)
        for scan in range(scans):
            made[scan] = video.sweeps(scan, 0, grid.azimuths, world.truth)
            progress()
        np.savez_compressed(
            path,
            scans=made,
            t=start + np.arange(scans) * grid.period_s,
            first_range_m=grid.first_range_m,
            range_step_m=grid.range_step_m,
            beamwidth_deg=np.rad2deg(grid.beamwidth_rad),
            db_per_step=grid.db_per_step,
        )
    else:
        _capture(path, VideoChannel(video, world), scans, settings.demo.udp_port, progress)
    return _write_truth(path.with_suffix(".truth.csv"), world, start, scans, site.video.period_s)


def _capture(path: Path, channel: VideoChannel, scans: int, port: int, progress: Callable[[], object]) -> None:
    grid = channel.video.site.video
    with PcapWriter(path.open("wb"), port) as pcap:
        for number in range(scans * SECTORS):
            datagrams, lengths = channel.sector(number)
            begin = channel.video.start + number / SECTORS * grid.period_s
            times = begin + (np.arange(len(lengths)) + 1) / len(lengths) * grid.period_s / SECTORS
            pcap.write_many(times, datagrams, lengths)
            if (number + 1) % SECTORS == 0:
                progress()


def _write_truth(path: Path, world: World, start: float, scans: int, period: float) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("time", *_TRUTH))
        for scan in range(scans):
            time = start + (scan + 0.5) * period
            truth = world.truth(time)
            columns = [getattr(truth, name).tolist() for name in _TRUTH]
            writer.writerows([f"{time:.3f}", *row] for row in zip(*columns, strict=True))
    return path
