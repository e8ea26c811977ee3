"""What the readers of capture files have in common."""

from __future__ import annotations

from collections import Counter
from typing import BinaryIO, NamedTuple


class CaptureError(ValueError):
    """The file is no capture, or is damaged; the message names the file and the reason."""


class Datagram(NamedTuple):
    """One UDP datagram. time: UTC s of its capture, or NaN. port: destination, or None. The file may tell neither."""

    time: float
    port: int | None
    payload: bytes


class Packet(NamedTuple):
    """One captured packet. time: UTC s, or NaN. link: type of its link layer, see `app.ingest.containers.links`.
    wire: octets that it had on the wire, of which `frame` may hold fewer. fcs: of these, octets of the frame check
    sequence at the end.
    """

    time: float
    link: int
    frame: bytes
    wire: int
    fcs: int


MAX_PACKET = 1 << 18
"""Octets of the longest packet that is looked into, as in libpcap. A UDP datagram with all headers is far shorter."""

MAX_RECORD = 1 << 27
"""Octets of one packet or block that are believed, the most that libpcap writes. What is longer shows damage."""


def take(file: BinaryIO, size: int, counters: Counter[str]) -> bytes | None:
    """`size` octets; None where the file ends before, counted as cut_off."""
    octets = file.read(size)
    if len(octets) == size:
        return octets
    counters["cut_off"] += 1
    return None


def skip(file: BinaryIO, size: int, counters: Counter[str]) -> bool:
    """Pass over `size` octets; False where the file ends before, counted as cut_off."""
    while size:
        octets = take(file, min(size, MAX_PACKET), counters)
        if octets is None:
            return False
        size -= len(octets)
    return True
