"""Writing datagrams as a capture file that any network tool reads."""

from __future__ import annotations

import struct
from types import TracebackType
from typing import BinaryIO, Self

import numpy as np
from numpy.typing import NDArray

_ETHERNET = bytes.fromhex("020000000002 020000000001 0800")


class PcapWriter:
    """A capture of UDP datagrams from 127.0.0.1 to `port` of 127.0.0.1 (Ethernet, microseconds, little endian)."""

    def __init__(self, file: BinaryIO, port: int = 8600) -> None:
        self._file, self._port = file, port
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))

    def write(self, time: float, datagram: bytes) -> None:
        """Add one datagram, received at `time` (UTC s)."""
        udp = struct.pack(">HHHH", 50000, self._port, 8 + len(datagram), 0) + datagram
        head = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0x4000, 64, 17, 0, b"\x7f\0\0\1", b"\x7f\0\0\1")
        total = sum(struct.unpack(">10H", head))
        total = (total & 0xFFFF) + (total >> 16)
        head = head[:10] + struct.pack(">H", ~(total + (total >> 16)) & 0xFFFF) + head[12:]
        frame = _ETHERNET + head + udp
        micros = round(time * 1e6)
        self._file.write(struct.pack("<IIII", micros // 10**6, micros % 10**6, len(frame), len(frame)) + frame)

    def write_many(self, times: NDArray[np.float64], datagrams: NDArray[np.uint8], lengths: NDArray[np.int32]) -> None:
        """Add row i of `datagrams`, `lengths[i]` octets of it, received at `times[i]`."""
        for time, row, length in zip(times, datagrams, lengths, strict=True):
            self.write(float(time), row[:length].tobytes())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
