"""Many datagrams with one system call."""

from __future__ import annotations

import ctypes
import errno
import socket
import sys

import numpy as np
from numpy.typing import NDArray

_REFUSED = (errno.ECONNREFUSED, errno.EAGAIN, errno.ENOBUFS)


class DatagramSender:
    """Sends blocks of datagrams to one address; what the system does not take is lost and counted, as on a network."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * 1024 * 1024)
        self._socket.connect((host, port))
        self.sent = 0
        self.lost = 0
        self._many = None
        if sys.platform == "linux" and ctypes.sizeof(ctypes.c_void_p) == 8:
            self._many = getattr(ctypes.CDLL(None, use_errno=True), "sendmmsg", None)

    def send(self, datagrams: NDArray[np.uint8], lengths: NDArray[np.int32]) -> None:
        """Send row i of `datagrams` (n, octets), `lengths[i]` octets of it, in order."""
        if self._many is None:
            for row, length in zip(datagrams, lengths, strict=True):
                self._one(row[:length].tobytes())
            return
        n = len(lengths)
        # struct iovec {base, length}; struct mmsghdr {name, namelen, iov, iovlen, control, controllen, flags, sent}
        vectors = np.empty((n, 2), np.uint64)
        vectors[:, 0] = datagrams.ctypes.data + np.arange(n, dtype=np.uint64) * np.uint64(datagrams.strides[0])
        vectors[:, 1] = lengths
        headers = np.zeros((n, 8), np.uint64)
        headers[:, 2] = vectors.ctypes.data + np.arange(n, dtype=np.uint64) * np.uint64(16)
        headers[:, 3] = 1
        done = 0
        while done < n:
            count = self._many(
                self._socket.fileno(), ctypes.c_void_p(headers.ctypes.data + 64 * done), ctypes.c_uint(n - done), 0
            )
            if count > 0:
                self.sent += count
                done += count
            elif ctypes.get_errno() == errno.EINTR:
                continue
            else:
                # the datagram that the system refuses is lost; the ones behind it may pass
                self.lost += 1
                done += 1

    def _one(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
            self.sent += 1
        except OSError as error:
            if error.errno not in _REFUSED:
                raise
            self.lost += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
