"""Small capture files, octet by octet."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path

import numpy as np

from app.ingest.containers.datagrams import Met, datagrams
from app.ingest.containers.packets import Datagram
from pipeline.asterix.cat240 import encode_sweeps

ETHERNET = bytes(12) + b"\x08\x00"
ADDRESSES = bytes(range(8))
T0 = 1_700_000_000.0
NATIVE = "<"


def udp(payload: bytes, *, port: int = 8600, checksum: int = 0) -> bytes:
    return struct.pack(">HHHH", 4000, port, 8 + len(payload), checksum) + payload


def ipv4(
    payload: bytes, *, port: int = 8600, proto: int = 17, cut: int = 0, checksum: int = 0, ident: int = 7
) -> list[bytes]:
    """IPv4 packets of one UDP datagram, in fragments of `cut` octets when it is longer."""
    data = udp(payload, port=port, checksum=checksum)
    size = cut or len(data)
    packets = []
    for at in range(0, len(data), size):
        piece = data[at : at + size]
        field = at // 8 | (0x2000 if at + size < len(data) else 0)
        head = struct.pack(">BBHHHBBH8s", 0x45, 0, 20 + len(piece), ident, field, 9, proto, 0, ADDRESSES)
        packets.append(head + piece)
    return packets


def ipv6(payload: bytes) -> bytes:
    data = udp(payload)
    hop = b"\x11\x00" + bytes(6)
    return struct.pack(">IHBB32s", 6 << 28, len(data) + 8, 0, 64, bytes(32)) + hop + data


def pcap(frames: list[tuple[float, bytes]], link: int = 1, order: str = NATIVE, nano: bool = False) -> bytes:
    magic = 0xA1B23C4D if nano else 0xA1B2C3D4
    out = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    for time, frame in frames:
        fraction = round(time % 1 * (1e9 if nano else 1e6))
        out += struct.pack(order + "IIII", int(time), fraction, len(frame), len(frame)) + frame
    return out


def block(kind: int, body: bytes, order: str = NATIVE) -> bytes:
    """A block of pcapng."""
    body += bytes(-len(body) % 4)
    size = 12 + len(body)
    return struct.pack(order + "II", kind, size) + body + struct.pack(order + "I", size)


def section(order: str = NATIVE) -> bytes:
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(
    link: int = 1, order: str = NATIVE, *, kept: int = 0, options: tuple[tuple[int, bytes], ...] = ()
) -> bytes:
    body = struct.pack(order + "HHI", link, 0, kept)
    for code, value in options:
        body += struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) % 4)
    return block(1, body + bytes(4 if options else 0), order)


def enhanced(time: float, frame: bytes, order: str = NATIVE, *, number: int = 0, unit: float = 1e-6) -> bytes:
    ticks = round(time / unit)
    head = struct.pack(order + "IIIII", number, ticks >> 32, ticks & 0xFFFFFFFF, len(frame), len(frame))
    return block(6, head + frame, order)


def pcapng(frames: list[tuple[float, bytes]], link: int = 1, order: str = NATIVE) -> bytes:
    out = section(order) + interface(link, order, options=((9, b"\x09"),))
    for time, frame in frames:
        out += enhanced(time, frame, order, unit=1e-9)
    return out


def read(path: Path, octets: bytes) -> tuple[list[Datagram], Counter[str], Met]:
    """What is read of a file of these octets, what was counted, and what was met."""
    path.write_bytes(octets)
    counters, met = Counter[str](), Met()
    return list(datagrams(path, counters, met)), Counter({k: v for k, v in counters.items() if v}), met


def video(turns: int, azimuths: int = 64, ranges: int = 40, *, time_of_day: float | None = 36_000.0) -> list[bytes]:
    """CAT240 datagrams of turns of a second; the first cell of each counts them."""
    n = turns * azimuths
    start = np.arange(n) * (2 * np.pi / azimuths)
    cells = np.zeros((n, ranges), np.uint8)
    cells[:, 0] = np.arange(n) % 256
    times = np.full(n, np.nan) if time_of_day is None else (time_of_day + np.arange(n) / azimuths) % 86400
    made, lengths = encode_sweeps(
        cells, start, start + 2 * np.pi / azimuths, times, 1, sac=0, sic=1, cell_duration_s=2e-8, start_cell=0
    )
    return [row[:size].tobytes() for row, size in zip(made, lengths, strict=True)]
