"""Packets of a pcap file: both byte orders, micro- and nanoseconds, and the form with longer record headers that
patched versions of libpcap wrote.

Source: draft-ietf-opsawg-pcap; the longer headers as in the Wireshark wiki, "Development/LibpcapFileFormat".
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from app.ingest.containers.packets import MAX_PACKET, MAX_RECORD, CaptureError, Packet, skip, take

_FORMS = {0xA1B2C3D4: (1e-6, 16), 0xA1B23C4D: (1e-9, 16), 0xA1B2CD34: (1e-6, 24)}
"""Magic number -> seconds of a count of the fraction, octets of a record header."""

_FCS_STATED = 0x04000000
"""Bit of the link-type field: its upper 4 bits count the frame check sequence in units of 16 bits."""


def is_pcap(magic: bytes) -> bool:
    """The first 4 octets of a file are those of a pcap file."""
    return _form(magic) is not None


def _form(magic: bytes) -> tuple[str, float, int] | None:
    for order in "<>":
        (value,) = struct.unpack(order + "I", magic) if len(magic) == 4 else (0,)
        if value in _FORMS:
            return order, *_FORMS[value]
    return None


def packets(file: BinaryIO, path: Path, counters: Counter[str]) -> Iterator[Packet]:
    """The packets of a file that is at its beginning.

    Counts oversized (too long for what is looked for) and cut_off. Raises CaptureError where it is damaged.
    """
    header = file.read(24)
    form = _form(header[:4])
    if form is None or len(header) < 24:
        raise CaptureError(f"{path}: ends inside its header")
    order, unit, size = form
    (field,) = struct.unpack(order + "I", header[20:])
    link = field & 0xFFFF
    fcs = (field >> 28) * 2 if field & _FCS_STATED else 0
    record = struct.Struct(f"{order}IIII{size - 16}x")
    at = len(header)
    while head := file.read(size):
        if len(head) < size:
            counters["cut_off"] += 1
            return
        seconds, fraction, kept, wire = record.unpack(head)
        if kept > MAX_RECORD:
            raise CaptureError(f"{path}: damaged: a packet of {kept} octets at {at}")
        at += size + kept
        if kept > MAX_PACKET:
            counters["oversized"] += 1
            if not skip(file, kept, counters):
                return
            continue
        frame = take(file, kept, counters)
        if frame is None:
            return
        yield Packet(seconds + fraction * unit, link, frame, wire, fcs)
