"""IP fragments put together, though some are lost and identifications come again.

A fragment names its datagram by addresses and identification alone, which is too little: a sender may count to 256
only, or not at all, and the pieces that are left of one datagram must never be completed with those of another. So a
datagram is given up when so many others of its sender have begun, or so much time has passed, that a further piece can
only be of another; when another piece stands where one is; and where identifications come again at once, pieces must
come in their order, so that a first piece begins a datagram.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from dataclasses import dataclass, field

MAX_OPEN = 64
"""Datagrams that may be open at once."""

MAX_SENDERS = 256
"""Pairs of addresses that are remembered."""

MAX_BETWEEN = 64
"""Others of the same sender that may begin before a datagram is whole, as `ipfrag_max_dist` of Linux."""

MAX_AGE_S = 1.0
"""Seconds from the first to the last piece of a datagram: a sender of 4,096 datagrams a second comes to the same of
65,536 identifications after 16 s, and the pieces of one leave it within milliseconds."""

MAX_LENGTH = 65535
"""Octets of a datagram."""


@dataclass
class _Open:
    """A datagram that is not whole. number: among those of its sender. end: its octets, -1 until they are known."""

    number: int
    time: float
    pieces: dict[int, bytes] = field(default_factory=dict)
    end: int = -1


@dataclass
class _Sender:
    """begun: datagrams so far. recent: identification -> number of the last MAX_BETWEEN. done: the same -> the pieces,
    by hash, of those that were whole. again: the last to begin had an identification that was among these.
    """

    begun: int = 0
    recent: OrderedDict[bytes, int] = field(default_factory=OrderedDict)
    done: dict[bytes, set[tuple[int, int]]] = field(default_factory=dict)
    again: bool = False


class Fragments:
    """Datagrams whose fragments are not all here.

    Counts fragments; fragments_lost (datagrams that were given up); fragments_double (captured twice); damaged.
    """

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self._open: OrderedDict[tuple[bytes, bytes], _Open] = OrderedDict()
        self._senders: OrderedDict[bytes, _Sender] = OrderedDict()

    def add(
        self, addresses: bytes, identification: bytes, offset: int, more: bool, data: bytes, time: float
    ) -> bytes | None:
        """The whole datagram when this was its last missing piece. offset: octets before the piece. time: s, or NaN."""
        self._counters["fragments"] += 1
        if offset + len(data) > MAX_LENGTH or (not data and more):
            self._counters["damaged"] += 1
            return None
        sender = self._sender(addresses)
        key = addresses, identification
        one = self._open.get(key)
        if one is not None and one.pieces.get(offset) == data:
            self._counters["fragments_double"] += 1
            return None
        if one is not None and _of_another(one, sender, offset, time, data, more):
            self._give_up(key)
            one = None
        if one is None:
            if (offset, hash(data)) in sender.done.get(identification, ()):
                self._counters["fragments_double"] += 1
                return None
            one = self._begin(key, sender, time)
        one.pieces[offset] = data
        if not more:
            one.end = offset + len(data)
        return self._whole(key, one, sender)

    def finish(self) -> None:
        """Count what is still open as lost."""
        self._counters["fragments_lost"] += len(self._open)
        self._open.clear()

    def _sender(self, addresses: bytes) -> _Sender:
        sender = self._senders.setdefault(addresses, _Sender())
        self._senders.move_to_end(addresses)
        if len(self._senders) > MAX_SENDERS:
            self._senders.popitem(last=False)
        return sender

    def _begin(self, key: tuple[bytes, bytes], sender: _Sender, time: float) -> _Open:
        identification = key[1]
        sender.begun += 1
        sender.again = identification in sender.recent
        sender.done.pop(identification, None)
        sender.recent[identification] = sender.begun
        sender.recent.move_to_end(identification)
        if len(sender.recent) > MAX_BETWEEN:
            old, _ = sender.recent.popitem(last=False)
            sender.done.pop(old, None)
        one = self._open[key] = _Open(sender.begun, time)
        if len(self._open) > MAX_OPEN:
            self._give_up(next(iter(self._open)))
        return one

    def _whole(self, key: tuple[bytes, bytes], one: _Open, sender: _Sender) -> bytes | None:
        if one.end < 0:
            return None
        whole, at = [], 0
        while at < one.end and one.pieces.get(at):
            whole.append(one.pieces[at])
            at += len(one.pieces[at])
        if at != one.end:
            return None
        del self._open[key]
        sender.done[key[1]] = {(offset, hash(piece)) for offset, piece in one.pieces.items()}
        return b"".join(whole)

    def _give_up(self, key: tuple[bytes, bytes]) -> None:
        del self._open[key]
        self._counters["fragments_lost"] += 1


def _of_another(one: _Open, sender: _Sender, offset: int, time: float, data: bytes, more: bool) -> bool:
    """A piece cannot belong to the datagram `one` that is open under its identification."""
    end = offset + len(data)
    if sender.begun - one.number > MAX_BETWEEN or abs(time - one.time) > MAX_AGE_S:
        return True
    if any(offset < at + len(piece) and at < end for at, piece in one.pieces.items()):
        return True
    if one.end >= 0 and (not more or end > one.end):
        return True
    return sender.again and offset < max(one.pieces)
