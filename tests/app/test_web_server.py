"""The real web server under clients that hold what they do not use."""

from __future__ import annotations

import contextlib
import json
import logging
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from websockets.sync.client import ClientConnection, connect

from app import connections as bounds
from app.settings import LimitsSettings
from app.web_server import MOST_FRAGMENTS
from tests.support.running import Server, running, until

HALF_A_HEAD = b"POST /api/v1/targets/reports HTTP/1.1\r\nHost: localhost\r\nX-a: "
GET_LIVE = b"GET /health/live HTTP/1.1\r\nHost: localhost\r\n\r\n"
HELLO = b'{"type":"hello"}'
UPGRADE = (
    b"GET /api/v1/live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
CHUNKED = b"Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n"


@pytest.fixture
def server() -> Iterator[Server]:
    with running() as made:
        yield made


@contextlib.contextmanager
def raw(port: int, *said: bytes) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as opened:
        for one in said:
            opened.sendall(one)
        yield opened


@contextlib.contextmanager
def upgraded(port: int, *said: bytes) -> Iterator[socket.socket]:
    """A WebSocket to the feed, with no library that would keep to the rules."""
    with raw(port, UPGRADE) as opened:
        assert opened.recv(65536).startswith(b"HTTP/1.1 101 ")
        for one in said:
            opened.sendall(one)
        yield opened


def to_the_end(opened: socket.socket) -> bytes:
    """All that comes until the server closes the connection."""
    got = b""
    with contextlib.suppress(ConnectionResetError):
        while more := opened.recv(65536):
            got += more
    return got


def frame(kind: int, payload: bytes, last: bool = True, length: int | None = None) -> bytes:
    size = len(payload) if length is None else length
    head = bytes([kind | (0x80 if last else 0)])
    if size < 126:
        return head + bytes([0x80 | size]) + bytes(4) + payload
    return head + b"\xff" + size.to_bytes(8, "big") + bytes(4) + payload


def feed(server: Server) -> ClientConnection:
    """A client of the feed that has been greeted."""
    opened = connect(server.live, proxy=None)
    opened.send(HELLO.decode())
    assert json.loads(opened.recv(timeout=10))["type"]
    return opened


def answers(live: ClientConnection) -> None:
    """The client of the feed is still served."""
    live.send('{"type":"ping","id":7}')
    while json.loads(live.recv(timeout=10)).get("id") != 7:
        pass


def close_code(got: bytes) -> int:
    """Of the last frame, which is a close frame."""
    at = got.rindex(b"\x88")
    return int.from_bytes(got[at + 2 : at + 4], "big")


def hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on a head has to come quickly."""
    monkeypatch.setattr(bounds, "HEAD_S", 0.3)
    monkeypatch.setattr(bounds, "SWEEP_S", 0.1)


def test_heads_that_do_not_end_are_closed_and_live_clients_are_not(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    with feed(server) as live, raw(server.port) as silent, raw(server.port, HALF_A_HEAD) as half:
        with raw(server.port, GET_LIVE) as second:
            assert second.recv(65536).startswith(b"HTTP/1.1 200 ")
            second.sendall(HALF_A_HEAD)
            hurry(monkeypatch)
            assert to_the_end(silent) == b""
            assert to_the_end(half).startswith(b"HTTP/1.1 408 ")
            assert b"HTTP/1.1 408 " in to_the_end(second)
        assert server.refused["head_late"] == 3
        answers(live)


def test_the_rest_of_a_body_that_nobody_waits_for_may_not_drip(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    with raw(server.port, b"GET /nothing HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n") as drip:
        assert drip.recv(65536).startswith(b"HTTP/1.1 404 ")
        hurry(monkeypatch)

        def cut() -> bool:
            try:
                drip.sendall(b"x")
            except OSError:
                return True
            return False

        until(cut, "the connection is cut")


def test_places_that_are_taken_by_the_silent_are_given_to_those_who_ask(caplog: pytest.LogCaptureFixture) -> None:
    with running(limits=LimitsSettings(connections=16)) as server, contextlib.ExitStack() as opened:
        live = opened.enter_context(feed(server))
        silent = [opened.enter_context(raw(server.port, *said)) for said in [(), (HALF_A_HEAD,)] * 60]
        for _ in range(5):
            assert httpx.get(f"{server.url}/health/live").status_code == 200
        assert len(server.connections) <= 16
        assert server.refused["connections_pushed_out"] >= len(silent) - 16
        answers(live)
    assert len([one for one in caplog.records if one.levelno >= logging.WARNING]) == 1


def test_when_all_places_serve_someone_the_newest_is_closed() -> None:
    with running(limits=LimitsSettings(connections=16)) as server, contextlib.ExitStack() as opened:
        for _ in range(16):
            opened.enter_context(feed(server))
        with raw(server.port, GET_LIVE) as late:
            assert to_the_end(late) == b""
        assert server.refused["connections_full"] == 1


@pytest.mark.parametrize(
    "head",
    [CHUNKED + b"Content-Length: 6\r\n", b"Content-Length: 6\r\n" + CHUNKED,
     CHUNKED + b"content-length: 0\r\n", CHUNKED + b"Content-Length : 6\r\n", b"Content-Length: 6\r\n" +
     b"Content-Length: 7\r\n", b"X-a: b\x00c\r\n", b"X-a: b\rc\r\n", b"X-a\x01: b\r\n"],
)  # fmt: skip
def test_two_lengths_and_control_characters_in_a_head_are_refused(server: Server, head: bytes) -> None:
    said = b"POST /api/v1/targets/reports HTTP/1.1\r\nHost: localhost\r\n" + head + b"\r\n0\r\n\r\n"
    with raw(server.port, said, GET_LIVE) as client:
        got = to_the_end(client)
    assert got.startswith(b"HTTP/1.1 400 ")
    assert got.count(b"HTTP/1.1 ") == 1, "what follows is no further request"


def test_a_frame_that_announces_too_much_is_refused_before_it_comes(server: Server) -> None:
    for announced in (65537, 64 * 1024 * 1024, 2**62):
        with upgraded(server.port, frame(1, HELLO), frame(1, b"", length=announced)) as client:
            assert close_code(to_the_end(client)) == 1009
    assert server.refused["message_too_big"] == 3


@pytest.mark.parametrize(
    "frames",
    [[frame(1, b"a" * 40_000, False), frame(0, b"a" * 40_000, False)],
     [frame(1, b"", False)] + [frame(0, b"", False)] * MOST_FRAGMENTS,
     [frame(1, b"a" * 65_000, False)] + [frame(0, b"a" * 100, False)] * 10],
)  # fmt: skip
def test_a_message_in_many_frames_is_bounded_as_a_whole(server: Server, frames: list[bytes]) -> None:
    with upgraded(server.port, frame(1, HELLO), b"".join(frames)) as client:
        assert close_code(to_the_end(client)) == 1009
    assert server.refused["message_too_big"] == 1


def test_a_message_of_the_allowed_size_and_one_in_a_few_frames_are_understood(server: Server) -> None:
    parts = [frame(1, HELLO[:3], False), frame(0, b"", False), frame(0, HELLO[3:])]
    with upgraded(server.port, b"".join(parts), frame(1, b'{"type":"ping","id":"' + b"i" * 60_000 + b'"}')) as client:
        client.settimeout(10)
        got = b""
        while b"i" * 60_000 not in got:
            more = client.recv(65536)
            assert more, "closed"
            got += more
    assert not server.refused


def test_pongs_for_a_client_that_does_not_read_do_not_pile_up(server: Server) -> None:
    with upgraded(server.port, frame(1, HELLO)) as client:
        pings = b"".join(frame(9, bytes(120)) for _ in range(5000))
        for _ in range(20):
            client.sendall(pings)
        largest = max(one.get_write_buffer_size() for one in server.connections._open)
        assert largest < 1_000_000, "12 MB of pongs were asked for"
        client.sendall(frame(9, b"the last"))
        got = b""
        while b"the last" not in got:
            got = got[-100:] + client.recv(1 << 20)


def test_it_ends_at_once_whatever_clients_hold(caplog: pytest.LogCaptureFixture) -> None:
    with contextlib.ExitStack() as opened, running() as server:
        body = b"Host: localhost\r\nContent-Type: application/json\r\nContent-Length: 5000000\r\n\r\n"
        for _ in range(20):
            opened.enter_context(raw(server.port))
            opened.enter_context(raw(server.port, HALF_A_HEAD))
            opened.enter_context(raw(server.port, b"POST /api/v1/targets/reports HTTP/1.1\r\n" + body + b" " * 9000))
        opened.enter_context(feed(server))
        until(lambda: len(server.connections) == 61, "all are connected")
    assert [one.getMessage() for one in caplog.records if one.levelno >= logging.WARNING] == []


class Process:
    """The web server in a process of its own, which may open few files."""

    def __init__(self, folder: Path, files: int) -> None:
        self.output = folder / "output.txt"
        with self.output.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.support.serving_process", str(folder), str(files)],
                stdout=output, stderr=subprocess.STDOUT,
            )  # fmt: skip
        until(lambda: "ready" in self.output.read_text(), "the service is ready", 120)
        self.port = int(self.output.read_text().split("http://127.0.0.1:")[1].split()[0])

    def get(self) -> int:
        return httpx.get(f"http://127.0.0.1:{self.port}/health/live", timeout=10).status_code


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Process]:
    made = Process(tmp_path, 256)
    try:
        yield made
    finally:
        made.process.kill()
        made.process.wait(30)


def test_more_silent_clients_than_descriptors_leave_it_answering(process: Process) -> None:
    with contextlib.ExitStack() as opened:
        with connect(f"ws://127.0.0.1:{process.port}/api/v1/live", proxy=None) as live:
            live.send(HELLO.decode())
            assert live.recv(timeout=10)
            for said in [()] * 200 + [(HALF_A_HEAD,)] * 400:
                with contextlib.suppress(ConnectionError):
                    opened.enter_context(raw(process.port, *said))
            for _ in range(3):
                assert process.get() == 200
            answers(live)
        process.process.send_signal(signal.SIGTERM)
        assert process.process.wait(30) == 0
    said = process.output.read_text()
    assert "Too many open files" not in said
    assert "Traceback" not in said
    assert len(said) < 5000
