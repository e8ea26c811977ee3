"""Places for connections: how many there are, who loses one, who is cut."""

from __future__ import annotations

import logging
import resource
from collections import Counter
from typing import Any

import pytest

from app.connections import DESCRIPTORS_KEPT, FEWEST, HEAD_S, UNREAD_S, Connections, most_connections


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


class Transport:
    """As much of a transport as is looked at."""

    def __init__(self, protocol: Any = None) -> None:
        self.protocol = protocol
        self.unsent = 0
        self.aborted = self.closing = False

    def abort(self) -> None:
        self.aborted = True

    def is_closing(self) -> bool:
        return self.closing

    def get_write_buffer_size(self) -> int:
        return self.unsent

    def get_protocol(self) -> Any:
        return self.protocol


class Client:
    """A connection whose client owes a request."""

    def __init__(self) -> None:
        self.transport: Any = Transport()
        self.late = False

    def too_late(self) -> None:
        self.late = True


class Bounded:
    bounds_itself = True


@pytest.fixture
def clock() -> Clock:
    return Clock()


def connections(clock: Clock, most: int = 3) -> Connections:
    return Connections(most, Counter(), clock)


def entered(many: Connections, count: int) -> list[Client]:
    clients = [Client() for _ in range(count)]
    for one in clients:
        assert many.enter(one.transport)
        many.waits(one)
    return clients


@pytest.mark.parametrize(
    ("files", "most"),
    [(20000, 1024), (1024, 1024 - DESCRIPTORS_KEPT), (256, 256 - DESCRIPTORS_KEPT), (64, FEWEST),
     (resource.RLIM_INFINITY, 1024)],
)  # fmt: skip
def test_there_are_fewer_places_than_the_process_may_open_files(
    monkeypatch: pytest.MonkeyPatch, files: int, most: int
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda what: (files, files))
    assert most_connections(1024) == most


def test_when_all_places_are_taken_the_longest_without_a_request_has_to_go(
    clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    many = connections(clock)
    first, second, third = entered(many, 3)
    many.asked(first)
    assert many.enter(Client().transport)
    assert [one.transport.aborted for one in (first, second, third)] == [False, True, False]
    assert len(many) == 3
    assert many.enter(Client().transport)
    assert not many.enter(Client().transport), "all that are left have asked for something"
    assert many.refused == {"connections_pushed_out": 2, "connections_full": 1}
    assert len([one for one in caplog.records if one.levelno == logging.WARNING]) == 1, "said once, not each time"


def test_a_place_is_free_again_when_its_connection_is_gone(clock: Clock) -> None:
    many = connections(clock)
    clients = entered(many, 3)
    for one in clients:
        many.asked(one)
    many.leave(clients[0].transport)
    assert many.enter(Client().transport)
    assert not many.refused


def test_who_owes_a_request_too_long_is_closed_and_who_asked_is_not(clock: Clock) -> None:
    many = connections(clock)
    late, asked, answered = entered(many, 3)
    many.asked(asked)
    clock.now += HEAD_S / 2
    many.asked(answered)
    many.waits(answered)
    many.waits(late)
    clock.now += HEAD_S / 2
    many.sweep()
    assert [one.late for one in (late, asked, answered)] == [True, False, False]
    clock.now += HEAD_S
    many.sweep()
    assert [one.late for one in (late, asked, answered)] == [True, False, True]
    assert many.refused == {"head_late": 2}


def held(many: Connections, transport: Transport, clock: Clock, taken: bool = False) -> bool:
    """Whether the connection lives when its client takes nothing for longer than it may."""
    transport.unsent = 50_000
    for _ in range(int(UNREAD_S) + 2):
        many.sweep()
        clock.now += 1.0
        if taken:
            many.taken(transport)  # type: ignore[arg-type]
    many.sweep()
    return not transport.aborted


def test_who_takes_nothing_is_cut_and_who_takes_something_is_not(clock: Clock) -> None:
    many = connections(clock, 9)
    still, reader, feed, closed = Transport(), Transport(), Transport(Bounded()), Transport(Bounded())
    for one in (still, reader, feed, closed):
        assert many.enter(one)  # type: ignore[arg-type]
    closed.closing = True
    assert not held(many, still, clock)
    assert held(many, reader, clock, taken=True)
    assert held(many, feed, clock), "the feed has a bound of its own"
    assert not held(many, closed, clock), "but not when it is closed"
    slow = Transport()
    assert many.enter(slow)  # type: ignore[arg-type]
    for left in range(60, 0, -1):
        slow.unsent = left
        clock.now += 1.0
        many.sweep()
    assert not slow.aborted
