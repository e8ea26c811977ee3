"""CAT240 by the batch: the fields of many datagrams at once, about a hundred nanoseconds each.

The kernel reads the common case (one block, one record, 8-bit cells, no RE or SP) and leaves everything else to
`cat240_decode`, so both give the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.asterix.cat240_decode import LONGEST_DAY, SummaryMessage, VideoMessage, read_datagram
from pipeline.kernels.compiled import allocating


@dataclass(frozen=True, slots=True, eq=False)
class VideoBatch:
    """The fields of n video messages; the cells stay where they were received.

    fields: (n, 10) int64, see the constants of this module. octets: (m, width) uint8: message i has its cells in
    octets[fields[i, ROW], fields[i, OFFSET] : + fields[i, CELLS]].
    """

    fields: NDArray[np.int64]
    octets: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.fields)

    @classmethod
    def of(cls, messages: Iterable[VideoMessage]) -> Self:
        """The batch form of decoded messages."""
        many = list(messages)
        octets = np.zeros((len(many), max((len(one.cells) for one in many), default=0)), np.uint8)
        fields = np.zeros((len(many), FIELDS), np.int64)
        for i, one in enumerate(many):
            octets[i, : len(one.cells)] = one.cells
            time = -1 if one.time_of_day is None else one.time_of_day
            fields[i] = (
                one.message, one.start, one.end, one.first_cell, one.cell_duration_fs, len(one.cells), time,
                one.sac << 8 | one.sic, i, 0,
            )  # fmt: skip
        return cls(fields, octets)

    def joined(self, other: VideoBatch) -> VideoBatch:
        """The messages of this batch and then those of another, with octets of their own."""
        fields = np.concatenate([self.fields, other.fields])
        width = int((fields[:, OFFSET] + fields[:, CELLS]).max(initial=0))
        octets = np.zeros((len(fields), width), np.uint8)
        for i, one in enumerate((*self.fields, *other.fields)):
            source = (self if i < len(self) else other).octets[one[ROW]]
            octets[i, : one[OFFSET] + one[CELLS]] = source[: one[OFFSET] + one[CELLS]]
        fields[:, ROW] = np.arange(len(fields))
        return VideoBatch(fields, octets)


MESSAGE, START, END, FIRST_CELL, DURATION, CELLS, TIME, SOURCE, ROW, OFFSET = range(10)
"""Columns of VideoBatch.fields: identification; azimuth counts; cells before the first; femtoseconds a cell; cells;
time of day in 1/128 s or -1; SAC << 8 | SIC; where the cells lie."""

FIELDS = 10


def decode_batch(
    datagrams: NDArray[np.uint8], lengths: NDArray[np.int32], counters: dict[str, int]
) -> list[tuple[VideoBatch, NDArray[np.int64] | slice]]:
    """The video messages of datagrams (n, width) uint8 of `lengths` (n,) int32 octets, in order.

    Gives batches, each with the index (or slice) of the datagrams that its messages came from. What cannot be read is
    counted under the reason of its DecodeError, summary messages under "summary". The batches look into `datagrams`: it
    must not change while they are in use.
    """
    n = len(lengths)
    fields = np.empty((n, FIELDS), np.int64)
    good = np.empty(n, np.bool_)
    read, trailing = _scan(datagrams, lengths, fields, good)
    if trailing:
        counters["trailing"] = counters.get("trailing", 0) + trailing
    if read == n:
        return [(VideoBatch(fields, datagrams), slice(0, n))] if n else []
    batches: list[tuple[VideoBatch, NDArray[np.int64] | slice]] = []
    edges = np.flatnonzero(np.diff(good)) + 1
    for low, high in zip([0, *edges.tolist()], [*edges.tolist(), n], strict=True):
        if good[low]:
            batches.append((VideoBatch(fields[low:high], datagrams), slice(low, high)))
        else:
            batches.append(_slowly(datagrams, lengths, range(low, high), counters))
    return [one for one in batches if len(one[0])]


def _slowly(
    datagrams: NDArray[np.uint8], lengths: NDArray[np.int32], rows: range, counters: dict[str, int]
) -> tuple[VideoBatch, NDArray[np.int64]]:
    messages: list[VideoMessage] = []
    origin: list[int] = []
    for i in rows:
        found, faults = read_datagram(datagrams[i, : lengths[i]].tobytes())
        for fault in faults:
            counters[fault.reason] = counters.get(fault.reason, 0) + 1
        for one in found:
            if isinstance(one, SummaryMessage):
                counters["summary"] = counters.get("summary", 0) + 1
            else:
                messages.append(one)
                origin.append(i)
    return VideoBatch.of(messages), np.array(origin, np.int64)


@allocating
def _scan(datagrams, lengths, fields, good):  # type: ignore[no-untyped-def]
    count = 0
    trailing = 0
    for i in range(lengths.shape[0]):
        data, length = datagrams[i], lengths[i]
        size = np.int64(data[1]) << 8 | data[2]
        padded = size < length and _is_padding(data, size, length)
        good[i] = _read(data, size if padded else length, i, fields[i])
        count += good[i]
        trailing += good[i] and padded
    return count, trailing


@allocating
def _is_padding(data, at, length):  # type: ignore[no-untyped-def]
    """The octets from `at` on are no block that `read_datagram` would tell of otherwise than as trailing."""
    if length > data.shape[0] or length - at < 3:
        return length <= data.shape[0]
    size = np.int64(data[at + 1]) << 8 | data[at + 2]
    return data[at] != 240 and (size < 3 or size > length - at)


@allocating
def _read(data, length, row, out):  # type: ignore[no-untyped-def]
    """One datagram; False when it is not the common case, or wrong."""
    if length < 32 or length > data.shape[0] or data[0] != 240 or (data[1] << 8 | data[2]) != length:
        return False
    first, second = data[3], data[4]
    # exactly 010 000 020, one of 040 and 041, 048 049, one of 050, 051 and 052, maybe 140
    if (first & 0xF3) != 0xE3 or (first & 0x0C) == 0 or (first & 0x0C) == 0x0C:
        return False
    item = second & 0x70
    if (second & 0x87) != 0x80 or item not in (0x40, 0x20, 0x10):
        return False
    if data[7] != 2 or (data[24] & 0x80) != 0 or data[25] != 4:
        return False
    block = 4 if item == 0x40 else (64 if item == 0x20 else 256)
    room = data[31] * block
    timed = (second & 0x08) != 0
    octets = np.int64(data[26]) << 8 | data[27]
    cells = np.int64(data[28]) << 16 | np.int64(data[29]) << 8 | data[30]
    if length != 32 + room + (3 if timed else 0) or octets > room or cells > octets or cells == 0:
        return False
    duration = _get4(data, 20)
    time = np.int64(-1)
    if timed:
        at = 32 + room
        time = np.int64(data[at]) << 16 | np.int64(data[at + 1]) << 8 | data[at + 2]
    if duration == 0 or time >= LONGEST_DAY:
        return False
    out[0] = _get4(data, 8)
    out[1] = np.int64(data[12]) << 8 | data[13]
    out[2] = np.int64(data[14]) << 8 | data[15]
    out[3] = _get4(data, 16)
    out[4] = duration * 1_000_000 if (first & 0x08) != 0 else duration
    out[5] = cells
    out[6] = time
    out[7] = np.int64(data[5]) << 8 | data[6]
    out[8] = row
    out[9] = 32
    return True


@allocating
def _get4(data, at):  # type: ignore[no-untyped-def]
    high = np.int64(data[at]) << 24 | np.int64(data[at + 1]) << 16
    return high | np.int64(data[at + 2]) << 8 | np.int64(data[at + 3])
