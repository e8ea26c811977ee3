"""The door at /3d: a real server in front of an upstream that the test controls."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import json
import logging
import math
import socket
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec
import pytest
from fastapi import FastAPI
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.api.bodies import Bodies
from app.api.middleware import Guard
from app.settings import Settings
from app.view3d import proxy
from app.view3d.proxy import router, subprotocol
from app.web_server import web_server
from tests.app.view3d.page_says import camera, click, message, update


class FakeView:
    host = "127.0.0.1"

    def __init__(self) -> None:
        self.port: int | None = None
        self.counts: Counter[str] = Counter()

    def count(self, what: str) -> None:
        self.counts[what] += 1


class Door:
    """The address of the door and what lies behind it."""

    def __init__(self, view: FakeView, port: int) -> None:
        self.view, self.port = view, port
        self.heard: asyncio.Queue[Any] = asyncio.Queue()

    def open(self, **given: Any) -> Any:
        given = {"subprotocols": [subprotocol()], "max_size": None, "proxy": None, "compression": None, **given}
        return connect(f"ws://127.0.0.1:{self.port}/3d", **given)

    async def get(self, path: str = "/3d/", **headers: str) -> tuple[int, Any, bytes]:
        return await asyncio.to_thread(self._get, path, headers)

    def _get(self, path: str, headers: dict[str, str]) -> tuple[int, Any, bytes]:
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.headers, error.read()


Handler = Callable[[ServerConnection], Any]


@contextlib.asynccontextmanager
async def door(handler: Handler | None = None, **settings: Any) -> AsyncIterator[Door]:
    view = FakeView()
    chosen = Settings(**{"mode": "demo", **settings})
    app = FastAPI(redirect_slashes=False)
    refused: Counter[str] = Counter()
    app.add_middleware(Guard, bodies=Bodies(65536, 65536, refused), allowed_origins=chosen.allowed_origins)
    app.include_router(router(view, chosen))
    listening = socket.create_server(("127.0.0.1", 0))
    server = web_server(app, chosen, refused, graceful_s=2)
    task = asyncio.create_task(server._serve([listening]))
    while not server.started:  # noqa: ASYNC110 - uvicorn offers no event
        await asyncio.sleep(0.01)
    made = Door(view, listening.getsockname()[1])

    async def default(connection: ServerConnection) -> None:
        await connection.send(b"hello")
        async for heard in connection:
            made.heard.put_nowait((connection.subprotocol, heard))
            await connection.send(b"echo " + (heard if isinstance(heard, bytes) else heard.encode()))

    async with serve(
        handler or default,
        "127.0.0.1",
        0,
        subprotocols=[subprotocol()],
        max_size=None,
        compression=None,  # type: ignore[list-item]
    ) as upstream:
        view.port = upstream.sockets[0].getsockname()[1]
        try:
            yield made
        finally:
            server.should_exit = True
            await asyncio.wait_for(task, 15)


async def closed(client: ClientConnection) -> tuple[int | None, str]:
    async with asyncio.timeout(10):
        with contextlib.suppress(ConnectionClosed):
            while True:
                await client.recv()
    return client.close_code, client.close_reason or ""


async def test_the_page_is_visers_with_our_name_and_the_word_demo() -> None:
    async with door() as at:
        status, headers, body = await at.get()
        assert status == 200
        assert headers["content-type"].startswith("text/html")
        text = body.decode()
        assert '<div id="root"></div>' in text
        assert "<title>Airside 3D DEMO</title>" in text
        assert "DEMO: recorded traffic" in text
        policy = headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "http" not in policy, "nothing is loaded from elsewhere"
        assert "'unsafe-inline'" not in policy.split("script-src")[1].split(";")[0]
        assert headers["x-content-type-options"] == "nosniff"


async def test_the_page_is_packed_and_asked_for_once() -> None:
    async with door(mode="live") as at:
        _, headers, packed = await at.get(**{"Accept-Encoding": "gzip"})
        assert headers["content-encoding"] == "gzip"
        _, _, plain = await at.get()
        assert gzip.decompress(packed) == plain
        assert b"DEMO: " not in plain
        status, _, body = await at.get(**{"If-None-Match": headers["etag"]})
        assert (status, body) == (304, b"")


async def test_the_address_without_its_slash_leads_to_the_page_and_others_to_nothing() -> None:
    async with door() as at:
        status, _, body = await at.get("/3d")
        assert status == 200
        assert b"root" in body
        assert (await at.get("/3d/../settings.toml"))[0] == 404
        assert (await at.get("/3d/assets/x.js"))[0] == 404


async def test_frames_pass_both_ways_under_visers_subprotocol() -> None:
    async with door() as at, at.open() as client:
        assert client.subprotocol == subprotocol()
        assert await client.recv() == b"hello"
        sent = update(value="Tower")
        await client.send(sent)
        assert await client.recv() == b"echo " + sent
        assert await at.heard.get() == (subprotocol(), sent)


async def test_a_frame_of_fifty_megabytes_passes() -> None:
    big = bytes(50 * 1024 * 1024)

    async def handler(connection: ServerConnection) -> None:
        await connection.send(big)
        await connection.wait_closed()

    async with door(handler) as at, at.open() as client:
        assert await client.recv() == big


async def test_a_page_of_another_origin_is_refused() -> None:
    async with door(allowed_origins=("https://desk.example",)) as at:
        for foreign in ("https://evil.example", f"http://127.0.0.1:{at.port + 1}", "null"):
            with pytest.raises(InvalidStatus) as refused:
                await at.open(origin=foreign)
            assert refused.value.response.status_code == 403
        assert at.view.counts["refused_origin"] == 3
        for own in (f"http://127.0.0.1:{at.port}", "https://desk.example"):
            async with at.open(origin=own) as client:
                assert await client.recv() == b"hello"


@pytest.mark.parametrize("offered", [None, ["viser-v0.0.1"], ["chat"]])
async def test_another_subprotocol_is_refused(offered: Any) -> None:
    async with door() as at:
        with pytest.raises(InvalidStatus):
            await at.open(subprotocols=offered)


async def test_without_viser_the_door_says_try_again_and_logs_no_fault(caplog: pytest.LogCaptureFixture) -> None:
    async with door() as at:
        with socket.socket() as unused:
            unused.bind(("127.0.0.1", 0))
            for port in (None, unused.getsockname()[1]):
                at.view.port = port
                for _ in range(3):
                    async with at.open() as client:
                        assert (await closed(client))[0] == 1013
        assert at.view.counts["upstream_refused"] == 3
    assert [one for one in caplog.records if one.levelno >= logging.WARNING] == []


async def test_when_viser_goes_the_page_is_told_to_try_again() -> None:
    async def handler(connection: ServerConnection) -> None:
        await connection.send(b"hello")
        await connection.close(1001)

    async with door(handler) as at, at.open() as client:
        assert (await closed(client))[0] == 1013


async def test_when_the_page_goes_viser_is_told() -> None:
    gone = asyncio.Event()

    async def handler(connection: ServerConnection) -> None:
        await connection.wait_closed()
        gone.set()

    async with door(handler) as at:
        async with at.open():
            pass
        await asyncio.wait_for(gone.wait(), 10)


@pytest.mark.parametrize(
    "kind", ["ShareUrlRequest", "ShareUrlDisconnect", "FileTransferStartUpload", "GetRenderResponseMessage", "Unheard"]
)
async def test_what_the_page_need_not_say_does_not_pass(kind: str) -> None:
    async with door() as at, at.open() as client:
        await client.send(message(kind))
        wanted = camera()
        await client.send(wanted)
        assert (await at.heard.get())[1] == wanted
        assert at.view.counts["unwanted_messages"] == 1


@pytest.mark.parametrize(
    ("data", "code"),
    [(b"", 1007), (b"\xc1\xff\x00", 1007), (msgspec.msgpack.encode([1, 2]), 1007),
     (msgspec.msgpack.encode({"type": 5}), 1007), (message("ViewerCameraMessage"), 1007),
     (camera(wxyz="x"), 1007), (camera(extra=1), 1007), (click(ray_origin=[1]), 1007), (update() + b"x", 1007),
     (camera()[:-3], 1007), (b"\x91" * 50_000, 1007), (bytes(70_000), 1009),
     (json.dumps({"type": "ViewerCameraMessage"}), 1003)],
)  # fmt: skip
async def test_what_is_no_message_closes_the_connection(data: Any, code: int) -> None:
    async with door() as at, at.open() as client:
        await client.send(data)
        assert (await closed(client))[0] == code
        assert at.heard.empty()


async def test_numbers_that_are_none_and_buttons_that_do_not_exist_are_dropped_and_counted() -> None:
    made_up = [
        camera(fov=math.nan), camera(position=[math.inf, 0, 0]), click(instance_index=10**12), click(instance_index=-1),
        update(visible=False), update(value=None), update(value="x" * 1000), update(value="Tower", __class__="x"),
    ]  # fmt: skip
    async with door() as at, at.open() as client:
        for one in made_up:
            await client.send(one)
        for wanted in (camera(), click(), click(instance_index=None), update(value="Follow")):
            await client.send(wanted)
            assert (await at.heard.get())[1] == wanted
        assert at.view.counts["unwanted_messages"] == len(made_up)


async def test_viewers_beyond_the_limit_are_sent_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proxy, "VIEWERS", 2)
    async with door() as at, at.open() as one, at.open() as two:
        assert [await one.recv(), await two.recv()] == [b"hello", b"hello"]
        async with at.open() as third:
            assert (await closed(third))[0] == 1013
        await one.close()
        async with asyncio.timeout(10):
            while True:
                async with at.open() as again:
                    with contextlib.suppress(ConnectionClosed):
                        assert await again.recv() == b"hello"
                        break


async def test_a_page_that_does_not_read_holds_viser_back_and_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proxy, "STALL_S", 0.5)
    monkeypatch.setattr(proxy, "CLOSE_S", 0.3)
    frame, sent, ended = bytes(1024 * 1024), 0, asyncio.Event()

    async def handler(connection: ServerConnection) -> None:
        nonlocal sent
        with contextlib.suppress(ConnectionClosed):
            while True:
                await connection.send(frame)
                sent += 1
        ended.set()

    async with door(handler) as at:
        client = await at.open(max_queue=1)
        await asyncio.wait_for(ended.wait(), 15)
        assert sent < 100, "what is not read is not collected anywhere"
        client.transport.abort()
