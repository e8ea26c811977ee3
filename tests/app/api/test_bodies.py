"""Bodies of requests: how long one may take, how much all may hold, and clients that go in the middle of one."""

from __future__ import annotations

import contextlib
import logging
import socket
from collections import Counter
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from starlette.types import Message

from app.api import bodies as bounds
from app.api.bodies import SMALL_BYTES, WHOLE_S, Bodies, Body
from app.api.problems import ApiProblem
from app.settings import LimitsSettings
from tests.support.running import Server, running, until

LARGE = 400_000
HEAD = (
    b"POST /api/v1/targets/reports HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    b"Content-Length: %d\r\n\r\n"
)


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


class Client:
    """Sends a body in parts, each after so many seconds of the clock."""

    def __init__(self, clock: Clock, parts: list[tuple[float, int]]) -> None:
        self.clock, self.parts = clock, parts

    async def receive(self) -> Message:
        seconds, size = self.parts.pop(0)
        self.clock.now += seconds
        return {"type": "http.request", "body": bytes(size), "more_body": bool(self.parts)}


async def nowhere(_message: Message) -> None:
    """Nobody hears the answer."""


def body(bodies: Bodies, clock: Clock, *parts: tuple[float, int]) -> Body:
    return Body(bodies, Client(clock, list(parts)).receive, nowhere)


async def refused(one: Body) -> ApiProblem:
    try:
        while True:
            await one.receive()
    except ApiProblem as error:
        return error


async def test_a_body_that_drips_is_given_up_when_its_time_is_over() -> None:
    clock = Clock()
    bodies = Bodies(10**6, 10**6, Counter(), clock)
    one = body(bodies, clock, *[(9.0, 10)] * 50)
    assert (await refused(one)).status_code == 408
    assert clock.now - 1000.0 <= WHOLE_S + 9.0
    assert bodies.refused == {"body_late": 1}


async def test_all_bodies_together_are_bounded_and_small_ones_are_not_counted() -> None:
    clock = Clock()
    bodies = Bodies(2 * 10**6, 10**6, Counter(), clock)
    first, second = (body(bodies, clock, (0, 500_000 + SMALL_BYTES), (0, 500_000)) for _ in range(2))
    await first.receive()
    await second.receive()
    assert bodies.held == 10**6
    no_room = await refused(first)
    assert no_room.status_code == 503
    assert no_room.headers is not None
    assert int(no_room.headers["Retry-After"]) > 0
    small = body(bodies, clock, (0, SMALL_BYTES - 1), (0, 1))
    assert len((await small.receive())["body"]) == SMALL_BYTES - 1
    await small.receive()
    first.end()
    first.end()
    await second.receive()
    assert bodies.held == 10**6
    second.end()
    assert bodies.held == 0


async def test_one_body_is_bounded_whatever_its_head_said() -> None:
    clock = Clock()
    bodies = Bodies(1000, 10**6, Counter(), clock)
    assert (await refused(body(bodies, clock, (0, 600), (0, 401)))).status_code == 413
    assert bodies.refuses("1001")
    assert not bodies.refuses("1000")


@contextlib.contextmanager
def posting(server: Server, announced: int, sent: int) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as client:
        client.sendall(HEAD % announced + b" " * sent)
        yield client


@pytest.fixture
def server() -> Iterator[Server]:
    with running(limits=LimitsSettings(bodies_bytes=2 * LARGE)) as made:
        yield made


def held(server: Server) -> int:
    """Bytes that count against the total."""
    stack: Any = server.app.middleware_stack
    while not hasattr(stack, "bodies"):
        stack = stack.app
    return int(stack.bodies.held)


def test_a_body_that_does_not_go_on_is_answered_and_closed(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "STALL_S", 0.3)
    with posting(server, LARGE, 1000) as client:
        got = b""
        while more := client.recv(65536):
            got += more
    assert got.startswith(b"HTTP/1.1 408 ")
    assert b"application/problem+json" in got
    assert server.refused["body_late"] == 1


def test_when_bodies_fill_the_room_large_ones_wait_and_small_ones_pass(server: Server) -> None:
    url, headers = f"{server.url}/api/v1/targets/reports", {"content-type": "application/json"}
    with posting(server, 2 * LARGE, LARGE), posting(server, 2 * LARGE, LARGE):
        until(lambda: held(server) == 2 * (LARGE - SMALL_BYTES), "both are held")
        large = httpx.post(url, content=b" " * LARGE, headers=headers)
        assert (large.status_code, large.headers["retry-after"]) == (503, str(bounds.RETRY_S))
        small = httpx.post(url, content=b" " * 1000 + b"{}", headers=headers)
        assert small.status_code == 422, "it is read, and understood to be no report"
    until(lambda: held(server) == 0, "what is held is let go with the clients")
    assert httpx.post(url, content=b" " * LARGE, headers=headers).status_code == 422


@pytest.mark.parametrize("path", [b"targets/reports", b"nodes/events", b"radars/smr-1/sweeps", b"alerts/1/acknowledge"])
def test_an_upload_that_is_broken_off_is_quiet(server: Server, caplog: pytest.LogCaptureFixture, path: bytes) -> None:
    kind = b"application/octet-stream" if b"sweeps" in path else b"application/json"
    head = HEAD.replace(b"targets/reports", path).replace(b"application/json", kind)
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        client.sendall(head % LARGE + b" " * 300_000)
        until(lambda: held(server) > 0, "a part of it is held")
    until(lambda: held(server) == 0, "it is let go")
    until(lambda: len(server.connections) == 0, "the connection is gone")
    assert [one.getMessage() for one in caplog.records if one.levelno >= logging.WARNING] == []
