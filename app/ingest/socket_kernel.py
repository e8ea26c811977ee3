"""Receiving datagrams by the hundred without the interpreter's lock: `recvmmsg` of 64-bit Linux, called from numba.

The thread that waits here does not hold the lock while it waits and receives, so a busy interpreter does not make it
lose datagrams, and it does not disturb the interpreter 8,000 times a second.
"""

from __future__ import annotations

import ctypes
import errno
import sys
from typing import Any

import numba
import numpy as np
from numba.core import typing as numba_typing
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

AVAILABLE = sys.platform == "linux" and ctypes.sizeof(ctypes.c_void_p) == 8
"""This system has recvmmsg with the layout used here."""

MSG_TRUNC = 0x20
_WAIT_FOR_ONE = 0x10000
_MONOTONIC = 1
_CONTROL = 64
_ADDRESS = 28
"""Octets of the longest socket address that is received, struct sockaddr_in6."""

_OVERFLOW = 40
"""SO_RXQ_OVFL: level SOL_SOCKET (1), the count of datagrams that the socket has dropped."""

HEADER = np.dtype(
    [
        ("name", "<u8"), ("namelen", "<u4"), ("_0", "<u4"), ("iov", "<u8"), ("iovlen", "<u8"), ("control", "<u8"),
        ("controllen", "<u8"), ("flags", "<i4"), ("_1", "<u4"), ("length", "<u4"), ("_2", "<u4"),
    ]
)  # fmt: skip
"""struct mmsghdr of 64-bit Linux."""

# numba's own annotations do not know what these are inside a kernel
_types: Any = numba.types
_signature: Any = getattr(numba_typing, "signature")  # noqa: B009
_carray: Any = getattr(numba, "carray")  # noqa: B009
_recvmmsg: Any = _types.ExternalFunction(
    "recvmmsg", _signature(_types.intc, _types.intc, _types.uintp, _types.uint32, _types.intc, _types.uintp)
)
_clock_gettime: Any = _types.ExternalFunction("clock_gettime", _signature(_types.intc, _types.intc, _types.uintp))
_errno_location: Any = _types.ExternalFunction("__errno_location", _signature(_types.CPointer(_types.intc)))

_AGAIN, _INTERRUPTED = errno.EAGAIN, errno.EINTR


class Ring:
    """Room for `count` datagrams of at most `width` octets.

    data: (count, width) uint8. lengths: (count,) int32, at most the width. arrival: (count,) float64 s of
    `time.monotonic`. truncated: (count,) bool, the datagram was longer. After `receive` the first so many rows are
    filled. senders: (count, 28) uint8, the address of each sender, as the system writes it. dropped: datagrams that the
    socket had no room for since it was opened, modulo 2**32.
    """

    def __init__(self, count: int, width: int) -> None:
        self.data: NDArray[np.uint8] = np.zeros((count, width), np.uint8)
        self.arrival: NDArray[np.float64] = np.zeros(count)
        self.dropped = 0
        self.lengths: NDArray[np.int32] = np.zeros(count, np.int32)
        self.truncated: NDArray[np.bool_] = np.zeros(count, np.bool_)
        self.senders: NDArray[np.uint8] = np.zeros((count, _ADDRESS), np.uint8)
        self._control = np.zeros((count, _CONTROL), np.uint8)
        self._clock = np.zeros(2, np.int64)
        self._vectors = np.zeros((count, 2), np.uint64)
        self._vectors[:, 0] = self.data.ctypes.data + np.arange(count, dtype=np.uint64) * np.uint64(width)
        self._vectors[:, 1] = width
        self._headers = np.zeros(count, HEADER)
        steps = np.arange(count, dtype=np.uint64)
        self._headers["iov"] = self._vectors.ctypes.data + steps * np.uint64(16)
        self._headers["iovlen"] = 1
        self._headers["name"] = self.senders.ctypes.data + steps * np.uint64(_ADDRESS)
        self._address, self._clock_address = self._headers.ctypes.data, self._clock.ctypes.data
        self._out = (self.lengths, self.truncated, self.arrival)
        self._headers["control"] = self._control.ctypes.data + steps * np.uint64(_CONTROL)

    def receive(self, descriptor: int, hold_s: float) -> int:
        """Wait for datagrams (as long as the socket's own timeout), then collect for at most `hold_s` or until full.

        Gives how many came, 0 after a timeout. Raises OSError.
        """
        got = int(
            _receive(descriptor, self._headers, self._address, hold_s, self._clock, self._clock_address, self._out)
        )
        if got < 0:
            raise OSError(-got, "recvmmsg")
        if got:
            self._note_overflow(got - 1)
        return got

    def _note_overflow(self, row: int) -> None:
        if int(self._headers["controllen"][row]) >= 20:
            level, kind = self._control[row, 8:16].view(np.int32)
            if level == 1 and kind == _OVERFLOW:
                self.dropped = int(self._control[row, 16:20].view(np.uint32)[0])


@allocating
def _receive(descriptor, headers, address, hold_s, clock, clock_address, out):  # type: ignore[no-untyped-def]
    lengths, truncated, arrival = out
    room = headers.shape[0]
    for i in range(room):
        headers[i].namelen = _ADDRESS
        headers[i].controllen = _CONTROL
        headers[i].flags = 0
    count = 0
    first = 0.0
    while count < room:
        got = _recvmmsg(descriptor, address + count * 64, room - count, _WAIT_FOR_ONE, 0)
        if got < 0:
            error = _carray(_errno_location(), 1)[0]
            if error == _INTERRUPTED:
                continue
            if error == _AGAIN or count > 0:
                break
            return -error
        _clock_gettime(_MONOTONIC, clock_address)
        now = clock[0] + clock[1] * 1e-9
        for i in range(count, count + got):
            arrival[i] = now
            lengths[i] = headers[i].length
            truncated[i] = (headers[i].flags & MSG_TRUNC) != 0
        if count == 0:
            first = now
        count += got
        if now - first >= hold_s or now < first:
            break
    return count
