"""Sending a recording as CAT240, at its own pace or faster."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from app.ingest.recording import Recording
from pipeline.asterix.cat240 import encode_sweeps
from pipeline.tables import Sweeps, VideoFormat

LIGHT_M_PER_S = 299_792_458.0
BURST = 32
"""Datagrams sent at once."""


class Replayer:
    """Sends the sweeps of a recording to one UDP address.

    The first sweep is sent as of now; the times of day go on as in the recording, so that `speed` times the pace gives
    `speed` times the clock, and speeds of targets stay true.

    interface: address of the interface by which a multicast group is sent to; 0.0.0.0 leaves it to the system.
    Raises OSError where the socket does, or when `interface` is no address.
    """

    def __init__(
        self,
        recording: Recording,
        address: tuple[str, int],
        speed: float = 1.0,
        *,
        sac: int = 0,
        sic: int = 1,
        interface: str = "0.0.0.0",
    ) -> None:
        self._recording, self._speed = recording, speed
        self._source = (sac, sic)
        family, _, _, _, found = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        if family == socket.AF_INET:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(interface))
        self._socket.connect(found)
        self._message = 0
        self._newest = 0.0
        self._begun = (0.0, 0.0)
        self.sent = 0
        self.refused = 0

    def run(self, progress: Callable[[Sweeps], None], loop: bool = False) -> None:
        """Send everything, and for ever with `loop`; `progress` hears of each block after it is sent."""
        video = self._recording.site.video
        begin = time.time()
        self._begun = (time.monotonic(), begin)
        with self._socket:
            while True:
                offset: float | None = None
                for block in self._recording.blocks():
                    if offset is None:
                        offset = begin - float(block.time[0])
                    self._send(block, offset)
                    progress(block)
                if not loop or offset is None:
                    return
                begin = self._newest + video.period_s / video.azimuths

    def _send(self, block: Sweeps, offset: float) -> None:
        datagrams, lengths = datagrams_of(block, self._recording.site.video, offset, self._message, *self._source)
        parts = len(lengths) // len(block)
        for low in range(0, len(block), BURST):
            high = min(low + BURST, len(block))
            self._wait(float(block.time[high - 1]) + offset)
            for i in range(low * parts, high * parts):
                self._put(datagrams[i, : lengths[i]].tobytes())
        self._message += len(lengths)
        self._newest = float(block.time[-1]) + offset

    def _put(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
        except ConnectionRefusedError:
            # the system tells of the datagram before, and has not sent this one
            self.refused += 1
            with suppress(ConnectionRefusedError):
                self._socket.send(datagram)
        self.sent += 1

    def _wait(self, moment: float) -> None:
        steady, origin = self._begun
        pause = steady + (moment - origin) / self._speed - time.monotonic()
        if pause > 0:
            time.sleep(pause)


def datagrams_of(
    block: Sweeps, video: VideoFormat, offset: float, message: int, sac: int = 0, sic: int = 1
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """The CAT240 datagrams of a block of sweeps; `offset` seconds are added to their times."""
    step = 2 * math.pi / video.azimuths
    start = np.asarray(block.row * step, np.float64)
    return encode_sweeps(
        block.amplitude,
        start,
        np.asarray(start + step, np.float64),
        (block.time + offset) % 86400,
        message,
        sac=sac,
        sic=sic,
        cell_duration_s=2 * video.range_step_m / LIGHT_M_PER_S,
        start_cell=round(video.first_range_m / video.range_step_m),
    )
