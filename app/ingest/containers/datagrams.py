"""UDP datagrams out of a file of any of these formats, recognised by its octets: its name decides nothing.

pcap, pcapng and bare ASTERIX blocks, each also compressed with gzip, bzip2 or xz.
"""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from app.ingest.containers import blocks, pcap, pcapng
from app.ingest.containers.internet import Internet
from app.ingest.containers.links import is_read, name_of, network
from app.ingest.containers.packets import CaptureError, Datagram, Packet

_COMPRESSED: dict[bytes, Any] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
_NOT_UNPACKED = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4", b"7z\xbc\xaf": "7-Zip", b"Rar!": "RAR"}


@dataclass
class Met:
    """What a file was found to hold. links: packets of each link type. ports: datagrams of each UDP port."""

    links: Counter[int] = field(default_factory=Counter)
    ports: Counter[int] = field(default_factory=Counter)

    def __str__(self) -> str:
        """The link types and ports, for people."""
        links = ", ".join(f"{name_of(link)}: {count}" for link, count in self.links.most_common(8))
        ports = ", ".join(f"{port}: {count}" for port, count in self.ports.most_common(8))
        parts = (("packets of link type ", links), ("datagrams of port ", ports))
        return "; ".join(words + counts for words, counts in parts if counts)


def datagrams(path: Path, counters: Counter[str], met: Met | None = None) -> Iterator[Datagram]:
    """The UDP datagrams of a file, in its order.

    Counted in `counters`: packets; unknown_link_N (of a link type that is not read); not_udp; what `Internet`,
    `Fragments` and the reader of the format count, such as cut_off (the file ends inside a packet, as when the capture
    was killed). Raises CaptureError, or OSError when the file cannot be read.
    """
    met = met or Met()
    try:
        head = _beginning(path)
        with _unpacked(path) as file:
            if pcap.is_pcap(head[:4]):
                yield from _of_packets(pcap.packets(file, path, counters), counters, met)
            elif head[:4] == pcapng.SECTION:
                yield from _of_packets(pcapng.packets(file, path, counters), counters, met)
            elif blocks.is_blocks(head):
                yield from blocks.datagrams(file, counters)
            else:
                raise CaptureError(
                    f"{path}: neither .npz, pcap, pcapng nor ASTERIX blocks with radar video ({_says(head[:4])})"
                )
    except EOFError:
        counters["cut_off"] += 1  # compressed, and ends before its end
    except (OSError, zlib.error, lzma.LZMAError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        raise CaptureError(f"{path}: damaged: cannot be unpacked ({error})") from error


def _says(head: bytes) -> str:
    return f"it begins with the octets {head.hex(' ')}" if head else "it is empty"


def _of_packets(packets: Iterator[Packet], counters: Counter[str], met: Met) -> Iterator[Datagram]:
    internet = Internet(counters)
    try:
        for packet in packets:
            counters["packets"] += 1
            met.links[packet.link] += 1
            if not is_read(packet.link):
                counters[f"unknown_link_{packet.link}"] += 1
                continue
            found = network(packet.link, packet.frame)
            if found is None:
                counters["not_udp"] += 1
                continue
            made = internet.datagram(*found, packet)
            if made is not None:
                met.ports[made.port or 0] += 1
                yield made
    finally:
        internet.finish()


@contextmanager
def _unpacked(path: Path) -> Iterator[BinaryIO]:
    with path.open("rb") as file:
        head = file.read(8)
        file.seek(0)
        for magic, name in _NOT_UNPACKED.items():
            if head.startswith(magic):
                raise CaptureError(f"{path}: is compressed with {name}: unpack it first, or use gzip, bzip2 or xz")
        opened = next((one for magic, one in _COMPRESSED.items() if head.startswith(magic)), None)
        if opened is None:
            yield file
            return
        with opened(file, "rb") as inside:
            yield inside


def _beginning(path: Path) -> bytes:
    """As many octets as recognise any format, or all that there are."""
    head = bytearray()
    with _unpacked(path) as file, suppress(EOFError):
        while len(head) < blocks.LOOKED_AT and (more := file.read(1 << 12)):
            head += more
    return bytes(head)
