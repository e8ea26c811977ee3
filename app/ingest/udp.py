"""The receiver of one radar's CAT240 datagrams: a thread from the socket to blocks of sweeps."""

from __future__ import annotations

import logging
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.ingest import socket_kernel
from app.ingest.udp_sources import ADDRESS_OCTETS, Sources, packed
from app.runtime.host_clock import HostClock
from app.runtime.refused_video import RefusedVideo
from app.settings import RadarSettings
from app.settings_sources import UdpSettings
from pipeline.assemble import Assembler
from pipeline.asterix.cat240_batch import FIELDS, VideoBatch
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

log = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
EVERY_ADDRESS = "0.0.0.0"

BUFFER_BYTES = 32 * 1024 * 1024
"""Asked of the system for datagrams that wait: three seconds of a large radar."""

HOLD_S = 0.004
"""Datagrams are collected for so long before they are worked on."""

TIMEOUT_S = 0.1
"""How long a silent socket is waited for before the thread looks whether it shall end."""

ROW_OCTETS = 65536 + 64
"""Room for one datagram: UDP has 65,535 octets at most. The 64 keep rows from falling on the same lines of the
processor's cache."""

RING_ROWS = 256
"""Datagrams received at once at most; the system gives the memory of a row when it is first used."""

_RXQ_OVFL = 40
_RCVBUFFORCE = 33
_MULTICAST_ALL = 49


class _Receiving(Protocol):
    data: NDArray[np.uint8]
    arrival: NDArray[np.float64]
    dropped: int

    lengths: NDArray[np.int32]
    truncated: NDArray[np.bool_]
    senders: NDArray[np.uint8]

    def receive(self, descriptor: int, hold_s: float) -> int: ...


class VideoReceiver:
    """Receives, decodes and assembles in its own thread; `deliver` is called there with every block and must not wait.

    clock: of the time of arrival. last_heard: `time.monotonic()` of the newest datagram, None before the first.
    refused: what is not taken, and why. Raises ValueError when the radar has no `udp` settings.
    """

    def __init__(
        self,
        site: RadarSite,
        index: int,
        radar_settings: RadarSettings,
        deliver: Callable[[Sweeps], None],
        clock: HostClock | None = None,
    ) -> None:
        if radar_settings.udp is None:
            raise ValueError(f"radar {radar_settings.id} has no udp settings")
        self.site = site
        self.last_heard: float | None = None
        self._udp = radar_settings.udp
        self._deliver = deliver
        self._clock = clock if clock is not None else HostClock()
        self._assembler = Assembler(
            site, index, min(radar_settings.blocks_per_scan, site.video.azimuths), sac=self._udp.sac,
            sic=self._udp.sic, resample=radar_settings.resample,
        )  # fmt: skip
        self.refused = RefusedVideo(site.id)
        self._counts = dict.fromkeys(("datagrams", "octets", "truncated", "socket_overflow", "socket_errors"), 0)
        self._counts |= {"deliver_failed": 0, "refused_source": 0}
        self._sources = Sources(self._udp.sources)
        warm()
        self._socket: socket.socket | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def port(self) -> int:
        """The UDP port; before `start` the one in the settings."""
        return int(self._socket.getsockname()[1]) if self._socket is not None else self._udp.port

    def start(self) -> None:
        """Open the socket and begin. Raises OSError when the port is taken or the group cannot be joined."""
        if self._thread is not None:
            return
        self._socket = open_socket(self._udp)
        self._thread = threading.Thread(
            target=self._run, args=(self._socket,), name=f"video-{self.site.id}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End within a fraction of a second; what waits in the socket is left. May be called twice."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(5.0)
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def counters(self) -> dict[str, int]:
        """What came, and what was not taken by reason."""
        return {**self._counts, **self._assembler.counters}

    def _run(self, opened: socket.socket) -> None:
        ring: _Receiving = (
            socket_kernel.Ring(RING_ROWS, ROW_OCTETS)
            if socket_kernel.AVAILABLE
            else PlainRing(RING_ROWS, ROW_OCTETS, opened)
        )
        while not self._stopping.is_set():
            try:
                got = ring.receive(opened.fileno(), HOLD_S)
            except OSError as error:
                self._counts["socket_errors"] += 1
                log.warning("radar %s: socket: %s", self.site.id, error)
                self._stopping.wait(TIMEOUT_S)
                continue
            if got:
                self._take(ring, got)

    def _take(self, ring: _Receiving, got: int) -> None:
        counts, lengths, good = self._counts, ring.lengths[:got], ~ring.truncated[:got]
        counts["datagrams"] += got
        counts["octets"] += int(lengths.sum())
        counts["socket_overflow"] = ring.dropped
        if self._sources:
            admitted = self._sources.admitted(ring.senders[:got])
            counts["refused_source"] += got - int(admitted.sum())
            counts["truncated"] += int((admitted & ~good).sum())
            good &= admitted
        else:
            admitted = None
            counts["truncated"] += got - int(good.sum())
        if admitted is None or admitted.any():
            self.last_heard = time.monotonic()
        data, arrival = ring.data[:got], self._clock.at(ring.arrival[:got])
        if not good.all():
            data, lengths, arrival = data[good], lengths[good], arrival[good]
        try:
            for block in self._assembler.push_datagrams(data, lengths, arrival):
                self._deliver(block)
        except Exception:
            # one bad block must not end the feed of the radar
            counts["deliver_failed"] += 1
            log.exception("radar %s: datagrams could not be worked on", self.site.id)
        self.refused.note(self.counters(), self._assembler.refusals, self._sources.newest_refused)


@cache
def warm() -> None:
    """Compile the kernels, or load them from the cache, so that the first datagrams need not wait for it."""
    site = RadarSite("warm", 0.0, 0.0, 0.0, VideoFormat(azimuths=16, ranges=16))
    datagrams, lengths = np.zeros((1, 2048), np.uint8), np.zeros(1, np.int32)
    assembler = Assembler(site, 0, 1)
    assembler.push(VideoBatch(np.zeros((0, FIELDS), np.int64), datagrams), np.zeros(0))
    assembler.push_datagrams(datagrams, lengths, np.zeros(1))
    if socket_kernel.AVAILABLE:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
            opened.setblocking(False)
            socket_kernel.Ring(1, 64).receive(opened.fileno(), 0.0)


class PlainRing:
    """The same as socket_kernel.Ring by plain `recv_into`, for systems without recvmmsg."""

    def __init__(self, count: int, width: int, opened: socket.socket) -> None:
        self.data: NDArray[np.uint8] = np.zeros((count, width), np.uint8)
        self.arrival: NDArray[np.float64] = np.zeros(count)
        self.lengths: NDArray[np.int32] = np.zeros(count, np.int32)
        self.truncated: NDArray[np.bool_] = np.zeros(count, np.bool_)
        self.senders: NDArray[np.uint8] = np.zeros((count, ADDRESS_OCTETS), np.uint8)
        self.dropped = 0
        self._spare = bytearray(65536)
        self._socket = opened

    def receive(self, descriptor: int, hold_s: float) -> int:
        """Wait for datagrams, then collect for at most `hold_s` or until full. Raises OSError."""
        width, begun = self.data.shape[1], 0.0
        for row in range(len(self.data)):
            self._socket.settimeout(TIMEOUT_S if row == 0 else hold_s)
            try:
                size, sender = self._socket.recvfrom_into(self._spare)
            except TimeoutError:
                return row
            now = time.monotonic()
            begun = begun if row else now
            kept = min(size, width)
            self.senders[row] = np.frombuffer(packed(sender[0]), np.uint8)
            self.data[row, :kept] = np.frombuffer(self._spare, np.uint8, kept)
            self.lengths[row], self.truncated[row], self.arrival[row] = kept, size > width, now
            if not 0 <= now - begun < hold_s:
                return row + 1
        return len(self.data)


def open_socket(udp: UdpSettings) -> socket.socket:
    """A bound socket with the largest buffer the system grants, joined to the group if there is one. Raises OSError.

    Without an address it hears this machine alone, and what is sent to the group where there is one.
    """
    address = udp.address or (LOOPBACK if udp.group is None else EVERY_ADDRESS)
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    opened = socket.socket(family, socket.SOCK_DGRAM)
    try:
        _enlarge(opened)
        if udp.group is not None:
            # several listeners may share a group; on a plain port a second one would silently take the datagrams away
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((address, udp.port))
        if udp.group is not None:
            _join(opened, udp.group, udp.interface)
        if socket_kernel.AVAILABLE:
            seconds, micros = divmod(round(TIMEOUT_S * 1e6), 1_000_000)
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", seconds, micros))
            opened.setsockopt(socket.SOL_SOCKET, _RXQ_OVFL, 1)
    except OSError as error:
        opened.close()
        where = f"udp {udp.group or address}:{udp.port}"
        raise OSError(error.errno, f"{where}: {error.strerror or error}") from error
    return opened


def _enlarge(opened: socket.socket) -> None:
    if sys.platform == "linux":
        try:
            opened.setsockopt(socket.SOL_SOCKET, _RCVBUFFORCE, BUFFER_BYTES)
            return
        except OSError:
            pass  # only the super-user may pass the system's limit
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    except OSError:
        log.info("the system keeps its own receive buffer")


def _join(opened: socket.socket, group: str, interface: str) -> None:
    if opened.family != socket.AF_INET or ":" in group:
        raise OSError(0, "multicast groups are joined over IPv4 only")
    member = socket.inet_aton(group) + socket.inet_aton(interface)
    opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
    if sys.platform == "linux":
        # only the group joined here, not those that others on this machine have joined
        opened.setsockopt(socket.IPPROTO_IP, _MULTICAST_ALL, 0)
