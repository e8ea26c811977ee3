"""The view itself: with the real viser on a free port of loopback."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.view3d import View3D
from app.view3d.movers import Frame
from app.view3d.proxy import subprotocol
from app.view3d.scene import Scene
from tests.app.view3d.pictures import alert, picture, tracks
from tests.support.running import until
from tests.support.small_airport import small_airport


@pytest.fixture
def view() -> Iterator[View3D]:
    made = View3D(small_airport(), "demo", period_s=0.05)
    made.start()
    assert made.ready.wait(30)
    yield made
    made.stop()
    assert made._thread is not None
    assert not made._thread.is_alive()


def test_it_listens_on_loopback_only_and_gives_the_port_away(view: View3D) -> None:
    assert view.port is not None
    assert _listening(view.port) == {"0100007F"}
    with connect(f"ws://127.0.0.1:{view.port}", subprotocols=[subprotocol()], proxy=None) as client:  # type: ignore[list-item]
        assert len(client.recv(timeout=10)) > 0
    view.stop()
    assert view.port is None
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", view._server.get_port()), timeout=2)


def _asked(port: int | None, host: str, more: str = "") -> bytes:
    """The first line of the answer of viser's own port."""
    with socket.create_connection(("127.0.0.1", port or 0), timeout=10) as client:
        client.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n{more}\r\n".encode())
        return client.recv(4096).split(b"\r\n")[0]


def test_its_own_port_answers_loopback_names_only(view: View3D) -> None:
    upgrade = (
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: {subprotocol()}\r\n"
    )
    for more, good in (("", b"200"), (upgrade, b"101")):
        for own in ("127.0.0.1", f"localhost:{view.port}", "[::1]:1"):
            assert good in _asked(view.port, own, more)
        for foreign in ("evil.example", f"evil.example:{view.port}", "127.0.0.1.evil.example", "", "[", "x@evil"):
            assert b"403" in _asked(view.port, foreign, more), foreign
        assert b"403" in _asked(view.port, "evil.example\r\nHost: localhost", more)
        for origin in ("http://evil.example", "null", f"http://evil.example:{view.port}"):
            assert b"403" in _asked(view.port, f"127.0.0.1:{view.port}", f"Origin: {origin}\r\n{more}"), origin
    with pytest.raises(InvalidStatus):
        connect(f"ws://127.0.0.1:{view.port}", origin="http://evil.example", proxy=None)  # type: ignore[arg-type]


def _listening(port: int) -> set[str]:
    """Local addresses, as the kernel writes them, of the sockets that listen on this port."""
    rows = [row.split() for name in ("tcp", "tcp6") for row in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


def test_nobody_can_ask_for_a_public_tunnel(view: View3D) -> None:
    from viser import _messages

    handlers = view._server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers
    assert _messages.GuiUpdateMessage in handlers, "the name of viser's own table has changed: this test sees nothing"


def test_a_port_that_is_taken_is_no_obstacle() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        view = View3D(small_airport(), port=port)
        view.start()
        assert view.ready.wait(30)
        assert view.port not in (None, port)
        view.stop()


def test_update_returns_while_the_scene_is_stuck_and_the_newest_picture_wins(
    view: View3D, monkeypatch: pytest.MonkeyPatch
) -> None:
    stuck, let_go = threading.Event(), threading.Event()
    seen: list[Frame] = []

    def slow(_scene: Scene, frame: Frame) -> None:
        seen.append(frame)
        stuck.set()
        assert let_go.wait(30)

    monkeypatch.setattr(Scene, "show", slow)
    first = picture(tracks([1]), alert([1]))
    view.update(first)
    assert stuck.wait(10)
    for number in range(2, 200):
        view.update(picture(tracks([number]), alert([number], id=number)))
    assert len(seen) == 1, "all updates came back while the first was still being shown"
    let_go.set()
    until(lambda: len(seen) >= 2, "the newest is shown")
    assert [list(one.targets) for one in seen[:2]] == [[1], [199]]
    assert view.counters()["merged"] == 197
    assert view.counters()["pictures"] == 199


def test_an_alert_does_not_wait_for_the_period(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.view3d.view.IDLE_S", 3600.0)
    view = View3D(small_airport(), period_s=3600.0)
    view.start()
    assert view.ready.wait(30)
    for number in range(1, 4):
        view.update(picture(tracks([number]), alert([number], id=number)))
        until(lambda number=number: view.counters().get("shown", 0) == number, "the alert is shown")  # type: ignore[misc]
    view.stop()


def test_a_fault_in_one_picture_does_not_end_the_view(view: View3D, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Scene.show

    def faulty(_scene: Scene, _frame: Frame) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(Scene, "show", faulty)
    view.update(picture(tracks([1]), alert([1])))
    until(lambda: view.counters().get("failed", 0) >= 1, "the fault is counted")
    monkeypatch.setattr(Scene, "show", real)
    view.update(picture(tracks([1])))
    until(lambda: view.counters().get("shown", 0) >= 1, "the next picture is shown")


def test_the_scene_holds_what_the_picture_says(view: View3D) -> None:
    view.update(picture(tracks([1, 2], category=2), alert([2])))
    until(lambda: view.counters().get("shown", 0) >= 1, "the picture is shown")
    node = view._server.scene.get_handle_by_name("/targets/vehicle")
    assert len(node.batched_positions) == 1024
    assert np.count_nonzero(node.batched_scales[:, 0]) == 2
    ring = view._server.scene.get_handle_by_name("/alerts/alarm")
    assert ring.batched_positions[0, :2].tolist() == [100.0, 0.0]
    assert ring.batched_scales[0, 0] > 0
    until(lambda: "ALARM" in view._status.content, "it is said in the panel")
    assert "DEMO" in view._status.content


def test_a_feed_that_is_lost_is_said(view: View3D) -> None:
    view.update(picture(tracks([1]), alert([1])))
    until(lambda: view.counters().get("shown", 0) >= 1, "the picture is shown")
    view._arrived = time.monotonic() - 60
    until(lambda: "FEED LOST" in view._status.content, "the loss is said")


def test_stopping_what_never_started_is_no_fault() -> None:
    View3D(small_airport()).stop()


def test_importing_the_room_does_not_import_viser() -> None:
    code = "import sys, app.view3d; sys.exit('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
