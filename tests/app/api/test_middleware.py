"""What holds for every request: HEAD beside GET, and who may read across origins."""

from __future__ import annotations

import json
import socket
import time
from typing import Any

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.api.middleware import allowed_hosts
from app.settings import Settings
from tests.support.running import Server

FOREIGN = {"origin": "https://map.example"}


def get_paths(document: dict[str, Any]) -> list[str]:
    values = {"{id}": "1", "{number}": "0", "{name}": "current.json"}
    paths = [path for path, calls in document["paths"].items() if "get" in calls]
    for name, value in values.items():
        paths = [path.replace(name, value) for path in paths]
    return [*paths, "/", "/docs", "/docs/", "/docs/docs.js", "/openapi.json", "/nothing.html", "/api/v1/nothing"]


def test_head_is_answered_wherever_get_is(http: httpx.Client) -> None:
    paths = get_paths(http.get("/openapi.json").json())
    assert len(paths) > 20
    for path in paths:
        got, head = http.get(path), http.head(path)
        assert head.status_code == got.status_code, path
        assert head.content == b"", path
        assert head.headers["content-type"] == got.headers["content-type"] if got.content else True, path
        assert "content-length" in head.headers, path


def test_head_tells_the_length_of_what_stands_still(http: httpx.Client) -> None:
    for path in ("/", "/docs/docs.js", "/api/v1/airport.geojson"):
        assert http.head(path).headers["content-length"] == str(len(http.get(path).content))


def test_where_get_is_not_head_is_not_either(http: httpx.Client) -> None:
    answer = http.head("/api/v1/nodes/events")
    assert (answer.status_code, answer.headers["allow"]) == (405, "POST")


def test_head_stands_among_the_methods_that_are_allowed(http: httpx.Client) -> None:
    assert http.delete("/api/v1/picture").headers["allow"] == "GET, HEAD"


@pytest.mark.parametrize(
    "path", ["/data/aircraft.json", "/data/receiver.json", "/data/history_9999.json", "/data/none"]
)
def test_pages_of_any_origin_may_read_what_is_made_for_them(http: httpx.Client, path: str) -> None:
    assert http.get(path, headers=FOREIGN).headers["access-control-allow-origin"] == "*"
    assert http.head(path, headers=FOREIGN).headers["access-control-allow-origin"] == "*"
    asked = http.options(path, headers={**FOREIGN, "access-control-request-method": "GET"})
    assert asked.status_code == 204
    assert asked.headers["access-control-allow-origin"] == "*"
    assert asked.headers["access-control-allow-methods"] == "GET, HEAD, OPTIONS"
    assert asked.headers["access-control-allow-headers"] == "*"
    assert "access-control-allow-credentials" not in asked.headers


@pytest.mark.parametrize(
    "path", ["/", "/api/v1/picture", "/api/v1/targets/reports", "/chunks/chunks.json", "/metrics", "/datas", "/docs/"]
)
def test_nothing_else_may_be_read_across_origins(http: httpx.Client, path: str) -> None:
    for answer in (
        http.get(path, headers=FOREIGN),
        http.options(path, headers={**FOREIGN, "access-control-request-method": "POST"}),
    ):
        assert not [name for name in answer.headers if name.startswith("access-control")]


def test_nothing_can_be_written_where_everyone_may_read(http: httpx.Client, server: Server) -> None:
    for method in ("POST", "PUT", "DELETE"):
        assert http.request(method, "/data/aircraft.json").status_code == 405
    paths = httpx.get(f"{server.url}/openapi.json").json()["paths"]
    assert [path for path, calls in paths.items() if path.startswith("/data") and set(calls) != {"get"}] == []


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "localhost.evil.example", "127.0.0.1.evil.example", ""]
)
def test_nothing_is_answered_under_a_foreign_name(http: httpx.Client, server: Server, host: str) -> None:
    own = {"host": host, "origin": f"http://{host}"}
    for path in ("/", "/api/v1/picture", "/data/aircraft.json", "/3d/", "/health/live", "/metrics", "/nothing"):
        assert http.get(path, headers=own).status_code == 400, path
    assert http.options("/data/aircraft.json", headers=own).status_code == 400
    assert http.put("/api/v1/runways/09-27/state", headers=own, json={"open": False}).status_code == 400
    for path in ("/api/v1/live", "/3d/"):
        opened = socket.create_connection(("127.0.0.1", server.port), timeout=10)
        with pytest.raises(InvalidStatus) as refused:
            connect(f"ws://{host or 'x'}{path}", sock=opened, proxy=None)
        opened.close()
        assert refused.value.response.status_code == 400


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:1", "127.0.0.1", "[::1]:8000"])
def test_loopback_names_are_answered(http: httpx.Client, host: str) -> None:
    assert http.get("/api/v1/picture", headers={"host": host}).status_code == 200


def test_the_address_listened_on_and_listed_names_are_allowed() -> None:
    assert {"10.1.2.3", "tower.example"} < set(
        allowed_hosts(Settings(host="10.1.2.3", allowed_hosts=("tower.example",)))
    )
    for wrong in ("http://tower.example", "tower.example:8000", "*tower", ""):
        with pytest.raises(ValueError, match="without scheme and port"):
            Settings(allowed_hosts=(wrong,))


@pytest.mark.parametrize("sign", ["%00", "%0d", "%0a", "%1b", "%7f"])
def test_control_characters_in_an_address_are_refused(http: httpx.Client, sign: str) -> None:
    for path in (
        f"/api/v1/radars/a{sign}/parts", f"/api/v1/radars/smr-1/video.png{sign}", f"/chunks/a{sign}.json",
        f"/{sign}", f"/api/v1/history/tracks?callsign=A{sign}", f"/api/v1/tracks/1/history?from=1{sign}",
    ):  # fmt: skip
        assert http.get(path).status_code == 400, path
    for path in (f"/api/v1/runways/09{sign}27/state", f"/api/v1/radars/a{sign}/parts"):
        assert http.put(path, json={"open": False}).status_code == 400, path


@pytest.mark.parametrize("sign", ["\0", "\r", "\n", "\x1b", "\x7f", "\ud800"])
def test_control_characters_in_names_are_refused(http: httpx.Client, sign: str) -> None:
    def sent(method: str, path: str, value: Any) -> int:
        content = json.dumps(value)
        return http.request(method, path, content=content, headers={"content-type": "application/json"}).status_code

    report = {"time": time.time(), "lat": 48.72, "lon": 2.38}
    for row in ({"callsign": f"A{sign}B"}, {"address": f"4ca{sign}12"}, {"source": f"a{sign}"}):
        assert sent("POST", "/api/v1/targets/reports", {**report, **row}) in (400, 422), row
    assert sent("POST", "/api/v1/nodes/events", {"time": time.time(), "node": f"N{sign}1"}) in (400, 422)
    assert sent("POST", "/api/v1/alerts/1/acknowledge", {"by": f"TWR{sign}1"}) in (400, 422)
    assert sent("PUT", "/api/v1/runways/09-27/state", {"in_use": f"0{sign}9"}) in (400, 422)
    assert sent("PUT", "/api/v1/radars/smr-1/parts", {"detect": {"name": f"ca{sign}"}}) in (400, 422)
    assert sent("PUT", "/api/v1/radars/smr-1/parts", {"detect": f"ca{sign}"}) in (400, 422)
    assert sent("PUT", "/api/v1/radars/smr-1/parts", {f"det{sign}ect": "ca"}) in (400, 422)
