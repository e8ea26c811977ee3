"""Below a path that a proxy gives: with nginx in front, the feed, the 3D view, the documents and the display."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import ValidationError
from starlette.datastructures import Headers
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from app.api.subpath import below, path_below, root_of
from app.live.messages import SUBPROTOCOL
from app.settings import Settings
from app.view3d import View3D, router
from app.view3d.proxy import subprotocol
from tests.support.fake_service import FakeService
from tests.support.running import Server, first_picture, running, until

ROOT = "/airside"

CONFIGURATION = """
worker_processes 1; daemon off; master_process off; pid {folder}/nginx.pid; error_log {folder}/errors;
events {{ worker_connections 256; }}
http {{
  access_log off; client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy; fastcgi_temp_path {folder}/fcgi;
  uwsgi_temp_path {folder}/uwsgi; scgi_temp_path {folder}/scgi;
  map $http_upgrade $connection_upgrade {{ default upgrade; '' close; }}
  server {{
    listen 127.0.0.1:{port};
    location /airside/ {{
      proxy_pass http://127.0.0.1:{upstream}{kept};
      proxy_http_version 1.1;
      proxy_set_header Upgrade $http_upgrade;
      proxy_set_header Connection $connection_upgrade;
      proxy_set_header Host $http_host;
      {prefix}
    }}
  }}
}}
"""


@pytest.mark.parametrize(
    ("setting", "header", "root"),
    [
        ("", "", ""), ("", "/airside", "/airside"), ("", "/airside/", "/airside"), ("", "/a/b-c_d.e~f", "/a/b-c_d.e~f"),
        ("/airside", "", "/airside"), ("/airside", "/other", "/airside"), ("", "/airside, /other", "/airside"),
        ("", "/", ""), ("", "//evil.example", ""), ("", "https://evil.example", ""), ("", "/a b", ""),
        ("", "airside", ""),
        ("", "/<script>", ""), ("", "/a" * 101, ""), ("", "/a/../b c", ""), ("", "/a\\b", ""),
    ],
)  # fmt: skip
def test_only_a_plain_path_is_taken_from_a_proxy(setting: str, header: str, root: str) -> None:
    assert root_of(Headers({"x-forwarded-prefix": header}), setting) == root


@pytest.mark.parametrize(
    ("root", "path", "whole", "inside"),
    [
        ("", "/api/v1/live", "/api/v1/live", "/api/v1/live"), ("/airside", "/3d", "/airside/3d", "/3d"),
        ("/airside", "/airside/3d", "/airside/3d", "/3d"), ("/airside", "/", "/airside/", "/"),
        ("/airside", "/airside", "/airside", ""), ("/airside", "/airsides", "/airside/airsides", "/airsides"),
    ],
)  # fmt: skip
def test_the_root_may_have_been_taken_off_the_path_or_not(root: str, path: str, whole: str, inside: str) -> None:
    scope = below({"type": "http", "path": path}, root)
    assert (scope["path"], scope["root_path"], path_below(scope)) == (whole, root, inside)


@pytest.mark.parametrize("given", ["airside", "//host", "/a b", "/a//b", "/api", "/data/x", "/3d", "http://host/a"])
def test_a_root_path_that_cannot_work_is_refused(given: str) -> None:
    with pytest.raises(ValidationError, match="root_path"):
        Settings(root_path=given)


def test_a_root_path_may_end_with_a_slash() -> None:
    assert Settings(root_path="/tower/airside/").root_path == "/tower/airside"


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


@contextlib.contextmanager
def nginx(folder: Path, upstream: int, *, kept: bool, prefix: bool) -> Iterator[str]:
    """nginx before a port; the address of the sub-path. kept: the root stays on the path; prefix: it tells the root."""
    program = shutil.which("nginx") or "/usr/sbin/nginx"
    if not Path(program).exists():
        if os.environ.get("AIRSIDE_REQUIRE_SERVICES") == "1":
            pytest.fail("nginx is not installed")
        pytest.skip("nginx is not installed: the sub-path was not tried behind it")
    port = free_port()
    told = f"proxy_set_header X-Forwarded-Prefix {ROOT};" if prefix else ""
    text = CONFIGURATION.format(folder=folder, port=port, upstream=upstream, kept="" if kept else "/", prefix=told)
    (folder / "nginx.conf").write_text(text)
    process = subprocess.Popen(
        [program, "-p", str(folder), "-c", str(folder / "nginx.conf")], stderr=subprocess.DEVNULL
    )

    def listens() -> bool:
        assert process.poll() is None, (folder / "errors").read_text()
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return True
        return False

    try:
        until(listens, "nginx listens")
        yield f"http://127.0.0.1:{port}{ROOT}"
    finally:
        process.terminate()
        process.wait(10)


WAYS = {
    "the proxy tells it": {"kept": False, "prefix": True, "root_path": ""},
    "the settings tell it": {"kept": False, "prefix": False, "root_path": ROOT},
    "it stays on the path": {"kept": True, "prefix": False, "root_path": ROOT},
}


@pytest.fixture(scope="module", params=WAYS.values(), ids=WAYS)
def served(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, str]]:
    """A service with its 3D view, and its address below nginx."""
    way: dict[str, Any] = dict(request.param)
    views: list[View3D] = []

    def view3d(service: FakeService) -> Any:
        views.append(View3D(service.airport, "demo", period_s=0.2))
        return router(views[0], service.settings)

    with running(root_path=way.pop("root_path"), view3d=view3d) as server:
        views[0].start()
        assert views[0].ready.wait(30)
        first_picture(server)
        with nginx(tmp_path_factory.mktemp("nginx"), server.port, **way) as url:
            yield server, url
        views[0].stop()


def test_every_link_of_every_page_leads_to_something(served: tuple[Server, str]) -> None:
    """Begin at the root without its slash and follow what the pages and scripts name."""
    root = served[1]
    waiting, seen = {root, f"{root}/docs", f"{root}/3d"}, set()
    with httpx.Client(follow_redirects=True, timeout=20) as client:
        while waiting:
            asked = waiting.pop()
            answer = client.get(asked)
            assert answer.status_code == 200, asked
            assert str(answer.url).startswith(f"{root}/"), f"{asked} leads out to {answer.url}"
            seen |= {asked, str(answer.url)}
            links = re.findall(r'(?:href|src)="([^"#]+)"', answer.text) if "/3d/" not in str(answer.url) else ["../"]
            links += re.findall(r"from '(\.[^']+)'", answer.text)
            waiting |= {str(answer.url.join(one)) for one in links if not one.startswith("data:")} - seen
    for page in ("/", "/docs/", "/3d/", "/docs/docs.js", "/js/main.js", "/metrics", "/openapi.json", "/asyncapi.json"):
        assert root + page in seen


def test_the_documents_tell_the_address(served: tuple[Server, str]) -> None:
    root = served[1]
    assert [one["url"] for one in httpx.get(f"{root}/openapi.json").json()["servers"]] == [ROOT]
    assert httpx.get(f"{root}/asyncapi.json").json()["servers"]["here"]["pathname"] == ROOT


def test_reading_writing_and_refusing_go_on_as_without_it(served: tuple[Server, str]) -> None:
    root = served[1]
    assert len(httpx.get(f"{root}/api/v1/tracks").json()["tracks"]) == 12
    assert httpx.get(f"{root}/data/aircraft.json").headers["access-control-allow-origin"] == "*"
    assert httpx.get(f"{root}/api/v1/nothing").headers["cache-control"] == "no-store"
    assert "unsafe-eval" not in httpx.get(f"{root}/").headers["content-security-policy"]
    assert httpx.get(f"{root}/chunks/chunks.json").json()["chunks"]
    body = {"open": True}
    for origin, status in (("https://evil.example", 403), (root.removesuffix(ROOT), 200)):
        answer = httpx.put(f"{root}/api/v1/runways/06-24/state", json=body, headers={"origin": origin})
        assert answer.status_code == status


def test_the_live_feed_comes_through(served: tuple[Server, str]) -> None:
    server, root = served
    with connect(f"{root.replace('http', 'ws')}/api/v1/live", subprotocols=[Subprotocol(SUBPROTOCOL)]) as feed:
        feed.send('{"type": "hello"}')
        feed.send('{"type": "subscribe", "id": 1}')
        server.service.step()
        kinds = [json.loads(feed.recv(10))["type"] for _ in range(3)]
    assert kinds[:2] == ["welcome", "result"]


def test_the_3d_view_comes_through(served: tuple[Server, str]) -> None:
    root = served[1]
    page = httpx.get(f"{root}/3d", follow_redirects=True)
    assert str(page.url) == f"{root}/3d/"
    assert '<a href="../"' in page.text
    wanted = Subprotocol(subprotocol())
    with connect(f"{root.replace('http', 'ws')}/3d", subprotocols=[wanted], max_size=None) as viser:
        assert viser.recv(10)


@pytest.mark.browser
def test_the_display_shows_the_picture_and_asks_for_nothing_outside(served: tuple[Server, str]) -> None:
    server, root = served
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no Chromium on this machine: the display was not tried below a sub-path")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    asked: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.on("request", lambda one: asked.append(one.url))
        page.on("websocket", lambda one: asked.append(one.url.replace("ws:", "http:")))
        page.goto(root)

        def shown() -> bool:
            server.service.step()
            page.wait_for_timeout(50)
            return "12" in page.inner_text("#count")

        until(shown, "the display shows twelve targets")
        page.click("text=API")
        page.get_by_text("/api/v1/targets/reports", exact=True).wait_for()
        page.get_by_text("/api/v1/runways", exact=True).click()
        page.locator("details[open] button", has_text="try it").click()
        page.wait_for_selector("pre:has-text('200 application/json')")
        page.click("text=display")
        page.click("text=3D")
        until(lambda: page.wait_for_timeout(50) or f"{root}/3d" in asked, "the 3D page opens its connection")
        browser.close()
    assert f"{root}/api/v1/live" in asked
    assert [one for one in asked if not one.startswith((f"{root}/", "data:", "blob:")) and one != root] == []
