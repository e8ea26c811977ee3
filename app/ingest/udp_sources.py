"""Which addresses datagrams are taken from: an allow-list of addresses and networks."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

ADDRESS_OCTETS = 28
"""Of a socket address as the system writes it: struct sockaddr_in6; that of IPv4 is shorter."""

REMEMBERED = 1024
"""Addresses whose answer is kept; senders that make up addresses must not fill the memory."""

_FAMILY = slice(0, 2)
_IPV4, _IPV6 = slice(4, 8), slice(8, 24)
"""Where the family (of this processor's byte order) and the addresses stand."""

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


class Sources:
    """Admits datagrams by the address of their sender. allowed: addresses and networks; empty for all.

    newest_refused: the last address that was not allowed, in words. Raises ValueError for what is neither.
    """

    def __init__(self, allowed: Iterable[str]) -> None:
        self._networks = tuple(ipaddress.ip_network(one) for one in allowed)
        self._refused: dict[bytes, str] = {}
        self.newest_refused = ""

    def __bool__(self) -> bool:
        return bool(self._networks)

    def admitted(self, senders: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Mask (n,) of the senders that are allowed. senders: (n, ADDRESS_OCTETS), socket addresses of the system."""
        keys = np.ascontiguousarray(np.delete(senders, [2, 3], axis=1))  # without the port
        distinct, which = np.unique(keys.view(f"V{keys.shape[1]}").ravel(), return_inverse=True)
        return np.array([self._is_allowed(one.tobytes()) for one in distinct], np.bool_)[which]

    def _is_allowed(self, key: bytes) -> bool:
        refused = self._refused.get(key)
        if refused is None:
            address = _address(key[:2] + b"\0\0" + key[2:])
            allowed = address is not None and any(address in one for one in self._networks)
            refused = "" if allowed else str(address or "an unknown kind of address")
            if len(self._refused) >= REMEMBERED:
                self._refused.clear()
            self._refused[key] = refused
        self.newest_refused = refused or self.newest_refused
        return not refused


def packed(host: str) -> bytes:
    """The socket address of a host (an address in words) as the system writes it, with port 0."""
    host = host.partition("%")[0]  # without the interface of a link-local one
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    octets = bytearray(ADDRESS_OCTETS)
    octets[_FAMILY] = np.uint16(family).tobytes()
    octets[_IPV6 if family == socket.AF_INET6 else _IPV4] = socket.inet_pton(family, host)
    return bytes(octets)


def _address(octets: bytes) -> Address | None:
    family = int(np.frombuffer(octets[_FAMILY], np.uint16)[0])
    if family == socket.AF_INET:
        return ipaddress.IPv4Address(octets[_IPV4])
    if family == socket.AF_INET6:
        address = ipaddress.IPv6Address(octets[_IPV6])
        return address.ipv4_mapped or address
    return None
