"""How much CAT240 the receiver takes without loss, from a sender at a steady rate on loopback."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import numpy as np

from app.demo.sender import DatagramSender
from app.ingest.udp import VideoReceiver
from app.settings import RadarSettings
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

BURST = 128
LIGHT = 299_792_458.0


@dataclass(frozen=True, slots=True)
class Intake:
    """Messages sent in a second, and of those sent how many became sweeps and how many were lost anywhere."""

    rate: float
    sent: int
    taken: int

    @property
    def lost(self) -> int:
        """What did not arrive."""
        return self.sent - self.taken


def measure_intake(rate: float, seconds: float) -> Intake:
    """Send `rate` messages of 1024 cells a second for `seconds`; the radar turns as fast as that asks for."""
    video = VideoFormat(period_s=4096 / rate)
    site = RadarSite("bench", 0.0, 0.0, 22.0, video)
    settings = RadarSettings(
        id="bench", latitude=0.0, longitude=0.0, period_s=video.period_s, udp=UdpSettings(address="127.0.0.1", port=0)
    )
    sweeps = [0]

    def deliver(block: Sweeps) -> None:
        sweeps[0] += len(block)

    receiver = VideoReceiver(site, 0, settings, deliver)
    receiver.start()
    sender = DatagramSender("127.0.0.1", receiver.port)
    ended = threading.Event()
    bursts = int(rate * seconds / BURST)
    begun = time.monotonic()
    try:
        for number in range(bursts):
            wait = begun + number * BURST / rate - time.monotonic()
            if wait > 0:
                ended.wait(wait)
            sender.send(*_burst(video, number))
        took = time.monotonic() - begun
        until = time.monotonic() + 2.0
        while receiver.counters()["taken"] < bursts * BURST and time.monotonic() < until:
            ended.wait(0.05)
        return Intake(bursts * BURST / took, bursts * BURST, receiver.counters()["taken"])
    finally:
        sender.close()
        receiver.stop()


def _burst(video: VideoFormat, number: int) -> tuple[np.ndarray, np.ndarray]:
    rows = np.arange(number * BURST, (number + 1) * BURST) % video.azimuths
    begin = rows.astype(np.float64) * video.azimuth_step_rad
    return encode_sweeps(
        np.zeros((BURST, video.ranges), np.uint8),
        begin,
        np.add(begin, video.azimuth_step_rad, dtype=np.float64),
        np.full(BURST, time.time() % 86400.0),
        number * BURST,
        sac=0,
        sic=1,
        cell_duration_s=2 * video.range_step_m / LIGHT,
    )
