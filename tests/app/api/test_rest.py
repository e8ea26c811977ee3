from __future__ import annotations

import io
import json
import re
import socket
import time
from typing import Any

import httpx
import jsonschema_rs
import numpy as np
import pytest
from PIL import Image

from app.api.scan_picture import index_table
from app.ingest.octets import encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat
from tests.support.running import Server, until
from tests.support.sweeps import sweeps_of

READS = [
    ("/health/live", 200),
    ("/health/ready", 200),
    ("/api/v1/picture", 200),
    ("/api/v1/tracks", 200),
    ("/api/v1/tracks?class=vehicle", 200),
    ("/api/v1/tracks/1", 200),
    ("/api/v1/tracks/4000", 404),
    ("/api/v1/tracks/0", 422),
    ("/api/v1/tracks/x", 422),
    ("/api/v1/tracks/4000/history", 404),
    ("/api/v1/tracks/1/history?from=nonsense", 422),
    ("/api/v1/tracks/1/history?limit=0", 422),
    ("/api/v1/tracks/1/history?limit=10001", 422),
    ("/api/v1/tracks.geojson", 200),
    ("/api/v1/history/tracks", 200),
    ("/api/v1/alerts", 200),
    ("/api/v1/alerts?state=live", 200),
    ("/api/v1/alerts?state=wrong", 422),
    ("/api/v1/alerts?from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00%2B01:00", 200),
    ("/api/v1/alerts?from=1760000001&to=1760000000", 422),
    ("/api/v1/alerts?from=2026-01-02T00:00:00Z&to=2026-01-02T00:30:00%2B01:00", 422),
    ("/api/v1/alerts?from=1760000000&to=1760000000", 200),
    ("/api/v1/history/tracks?from=1760000001&to=1760000000", 422),
    ("/api/v1/tracks/1/history?from=1760000001&to=1760000000", 422),
    ("/api/v1/alerts/999", 404),
    ("/api/v1/airport.geojson", 200),
    ("/api/v1/sensors", 200),
    ("/api/v1/runways", 200),
    ("/api/v1/radars/nobody/video.png", 404),
    ("/api/v1/radars/smr-2/video.png", 409),
    ("/api/v1/radars/smr-1/video.png?size=5000", 422),
    ("/asyncapi.json", 200),
    ("/metrics", 200),
    ("/data/aircraft.json", 200),
    ("/data/receiver.json", 200),
    ("/data/history_0.json", 200),
    ("/data/history_9999.json", 404),
    ("/data/history_x.json", 422),
    ("/chunks/chunks.json", 200),
    ("/chunks/current.json", 200),
    ("/chunks/nothing.json", 404),
    ("/api/v1/nothing", 404),
    ("/nothing.html", 404),
    ("/..%2f..%2fpyproject.toml", 404),
]


def declared(document: dict[str, Any], path: str, status: int, verb: str = "get") -> tuple[str, dict[str, Any]] | None:
    """The content type and schema that the OpenAPI document gives for an answer."""
    for template, calls in document["paths"].items():
        pattern = re.sub(r"\\{[^}]*\\}", "[^/]+", re.escape(template))
        if re.fullmatch(pattern, path.split("?", maxsplit=1)[0]) and verb in calls:
            answer = calls[verb]["responses"].get(str(status))
            assert answer is not None, f"{verb} {template} does not declare {status}"
            content = answer.get("content", {})
            if not content:
                return None
            kind, body = next(iter(content.items()))
            return kind, body.get("schema", {})
    return None


@pytest.fixture(scope="module")
def document(http: httpx.Client) -> dict[str, Any]:
    made = http.get("/openapi.json").json()
    assert made["openapi"].startswith("3.1")
    return made


@pytest.mark.parametrize(("path", "status"), READS)
def test_answers_are_as_the_document_says(http: httpx.Client, document: dict[str, Any], path: str, status: int) -> None:
    answer = http.get(path)
    assert answer.status_code == status, answer.text[:300]
    if status >= 400:
        assert answer.headers["content-type"] == "application/problem+json"
        body = answer.json()
        assert body["status"] == status
        assert body["title"]
        assert body["detail"]
    told = declared(document, path, status)
    if told is None:
        return
    kind, schema = told
    assert answer.headers["content-type"].split(";")[0] == kind
    if kind.endswith("json"):
        whole = {**schema, "components": document["components"]}
        jsonschema_rs.Draft202012Validator(whole).validate(answer.json())


def test_every_answer_carries_the_security_headers(http: httpx.Client) -> None:
    for path in ("/", "/api/v1/picture", "/nothing", "/metrics", "/docs/"):
        headers = http.get(path).headers
        assert "script-src 'self';" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"


def test_the_picture_is_whole_and_says_its_mode(http: httpx.Client, server: Server) -> None:
    body = http.get("/api/v1/picture").json()
    assert (body["mode"], body["airport"], body["epoch"]) == ("demo", "LFPO", server.hub.epoch)
    assert len(body["tracks"]) == 12
    assert {one["id"] for one in body["sensors"]} == {"smr-1", "smr-2", "nodes"}
    assert all(one["simulated"] for one in body["tracks"])


def test_classes_filter_the_tracks(http: httpx.Client) -> None:
    rows = http.get("/api/v1/tracks", params={"class": ["vehicle", "unknown"]}).json()["tracks"]
    assert {one["class"] for one in rows} == {"vehicle", "unknown"}


def test_geojson_puts_longitude_first(http: httpx.Client) -> None:
    point = http.get("/api/v1/tracks.geojson").json()["features"][0]["geometry"]["coordinates"]
    assert 2.3 < point[0] < 2.5
    assert 48.6 < point[1] < 48.8


def test_an_alert_lives_and_is_acknowledged(http: httpx.Client, server: Server) -> None:
    alert = server.service.raise_alert()
    server.service.step()
    path = f"/api/v1/alerts/{alert.id}"
    assert http.get("/api/v1/alerts?state=live").json()["alerts"][0]["id"] == alert.id
    made = http.post(f"{path}/acknowledge", json={"by": "TWR-1"})
    assert made.json()["alert"]["acknowledged_by"] == "TWR-1"
    server.service.step()
    server.service.clear_alert(alert.id)
    server.service.step()
    until(lambda: len(http.get(path).json()["changes"]) == 3, "all changes are stored")
    life = http.get(path).json()
    assert [one["operation"] for one in life["changes"]] == ["raise", "acknowledge", "clear"]
    assert life["alert"]["state"] == "cleared"
    assert http.post(f"{path}/acknowledge", json={"by": "TWR-1"}).status_code == 409
    cleared = http.get("/api/v1/alerts", params={"state": "cleared", "from": alert.raised_at - 1}).json()["alerts"]
    assert alert.id in [one["id"] for one in cleared]
    assert http.get("/api/v1/alerts", params={"to": alert.raised_at - 1}).json()["alerts"] == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"by": ""}', 422),
        (b'{"by": 5}', 422),
        (b'{"by": NaN}', 422),
        (b"{}", 422),
        (b'{"by": "x", "more": 1}', 422),
        (b"not json", 422),
        (b'{"by": "TWR"}', 404),
    ],
)
def test_bad_acknowledgements(http: httpx.Client, body: bytes, status: int) -> None:
    answer = http.post("/api/v1/alerts/77777/acknowledge", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"


def test_runways_are_opened_closed_and_turned(http: httpx.Client) -> None:
    path = "/api/v1/runways/06-24/state"
    made = http.put(path, json={"open": True, "in_use": "24", "visibility": "low"}).json()["runway"]
    assert (made["open"], made["in_use"], made["visibility"]) == (True, "24", "low")
    made = http.put(path, json={"open": False}).json()["runway"]
    assert (made["open"], made["in_use"], made["visibility"]) == (False, None, "low")
    assert http.put(path, json={"in_use": "24"}).status_code == 409
    made = http.put("/api/v1/runways/06%2F24/state", json={"open": True, "in_use": ""}).json()["runway"]
    assert (made["open"], made["in_use"], made["visibility"]) == (True, None, "low")
    assert http.put("/api/v1/runways/06/24/state", json={"visibility": "normal"}).status_code == 200
    assert http.put(path, json={"in_use": "13"}).status_code == 409
    assert http.put("/api/v1/runways/13-31/state", json={}).status_code == 404
    assert http.put(path, json={"visibility": "fog"}).status_code == 422


def test_node_events_and_reports_come_in(http: httpx.Client, server: Server) -> None:
    now = time.time()
    many = [{"time": now, "node": "node-1"}, {"time": now + 1, "node": "node-1", "kind": "left", "speed_mps": 4.0}]
    assert http.post("/api/v1/nodes/events", json=many).json() == {"taken": 2}
    assert server.service.node_events[-1].speed[1] == 4.0
    report = {"time": now, "lat": 48.7233, "lon": 2.3794, "address": "39ABCD", "source": "adsb"}
    assert http.post("/api/v1/targets/reports", json=report).json() == {"taken": 1}
    assert server.service.target_reports[-1].source[0] == "adsb"
    assert server.service.target_reports[-1].address[0] == "39abcd"


@pytest.mark.parametrize(
    "body",
    [
        b'{"time": NaN, "node": "node-1"}',
        b'{"time": 1e999, "node": "node-1"}',
        b'{"time": 1760000000, "node": "nobody"}',
        b'[{"time": 1760000000, "node": "node-1", "speed_mps": -Infinity}]',
        b"[" * 20_000,
        b"\xff\xfe",
        b"",
        b"[" + b",".join([b'{"time": 1760000000, "node": "node-1"}'] * 1001) + b"]",
    ],
)
def test_bad_node_events_are_refused_whole(http: httpx.Client, server: Server, body: bytes) -> None:
    before = len(server.service.node_events)
    answer = http.post("/api/v1/nodes/events", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert len(server.service.node_events) == before


def test_sweeps_come_in_as_octets(http: httpx.Client, server: Server) -> None:
    octets = {"content-type": "application/octet-stream"}
    path = "/api/v1/radars/smr-1/sweeps"
    site = server.service.radars[0]
    body = encode_sweeps(sweeps_of(site, rows=8), site)
    assert http.post(path, content=body, headers=octets).json() == {"taken": 8}
    assert http.post(path, content=b"something else", headers=octets).status_code == 422
    assert http.post("/api/v1/radars/nobody/sweeps", content=b"ASWP", headers=octets).status_code == 404
    assert http.post(path, content=b"ASWP", headers={"content-type": "text/plain"}).status_code == 415


def test_bodies_over_the_limit_are_refused_while_they_stream(http: httpx.Client, server: Server) -> None:
    octets = {"content-type": "application/octet-stream"}
    limit = server.service.settings.limits.body_bytes
    head = f"POST /api/v1/radars/smr-1/sweeps HTTP/1.1\r\nHost: localhost\r\nContent-Length: {limit + 1}\r\n\r\n"
    # by its length alone: a client that goes on writing may find the connection closed before it has read the answer
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as raw:
        raw.sendall(head.encode())
        assert raw.recv(4096).startswith(b"HTTP/1.1 413 ")
    sent = 0

    def endless() -> Any:
        nonlocal sent
        while sent < 4 * limit:
            sent += 65536
            yield b"A" * 65536

    try:
        answer = http.post("/api/v1/radars/smr-1/sweeps", content=endless(), headers=octets)
        assert answer.status_code == 413
        assert answer.headers["content-type"] == "application/problem+json"
    except httpx.TransportError:
        pass  # the server closed while the client still wrote: refused as well
    assert sent < 4 * limit
    assert http.get("/health/live").status_code == 200


def test_foreign_pages_may_not_write(http: httpx.Client) -> None:
    answer = http.post("/api/v1/alerts/1/acknowledge", json={"by": "x"}, headers={"origin": "https://evil.example"})
    assert answer.status_code == 403
    own = http.post(
        "/api/v1/alerts/77777/acknowledge", json={"by": "x"}, headers={"origin": str(http.base_url).rstrip("/")}
    )
    assert own.status_code == 404


@pytest.mark.parametrize("path", ["/api/v1/picture", "/api/v1/nodes/events", "/", "/metrics"])
def test_wrong_methods_are_told_the_right_ones(http: httpx.Client, path: str) -> None:
    answer = http.request("DELETE", path)
    assert answer.status_code == 405
    assert answer.headers["allow"]
    assert answer.headers["content-type"] == "application/problem+json"


def test_pages_have_etags(http: httpx.Client) -> None:
    first = http.get("/docs/docs.js")
    assert first.status_code == 200
    again = http.get("/docs/docs.js", headers={"if-none-match": first.headers["etag"]})
    assert again.status_code == 304


def test_the_documentation_needs_nobody_else(http: httpx.Client) -> None:
    page = http.get("/docs", follow_redirects=True)
    assert page.status_code == 200
    for text in (page.text, http.get("/docs/docs.js").text, http.get("/docs/docs.css").text):
        assert "//" not in re.sub(r"^\s*//.*$", "", text, flags=re.M).replace("://127", "")
        assert "http" not in re.findall(r'(?:src|href)="([^"]*)', text)


def test_the_radar_picture_has_its_place_and_its_tag(http: httpx.Client, server: Server) -> None:
    answer = http.get("/api/v1/radars/smr-1/video.png", params={"size": 256, "palette": "amber"})
    assert answer.headers["content-type"] == "image/png"
    image = Image.open(io.BytesIO(answer.content))
    assert image.size == (256, 256)
    opaque = np.asarray(image.convert("RGBA"))[..., 3] > 0
    assert not opaque[0, 0]
    assert 0 < opaque.mean() < 0.2
    half = float(answer.headers["x-airside-east-m"])
    assert half == (512 - 0.5) * 6.0
    frame = server.service.airport.frame
    east, _ = frame.to_local(frame.latitude, float(answer.headers["x-airside-east"]))
    assert abs(float(east) - half) < 1.0
    tagged = {"if-none-match": answer.headers["etag"]}
    again = http.get("/api/v1/radars/smr-1/video.png", params={"size": 256, "palette": "amber"}, headers=tagged)
    assert (again.status_code, again.content) == (304, b"")


def test_scan_conversion_finds_the_nearest_cell() -> None:
    """Against the slow way: every pixel's centre in polar coordinates, one by one."""
    site = RadarSite("r", 0.0, 0.0, 10.0, VideoFormat(azimuths=64, ranges=40, first_range_m=5.0, range_step_m=4.0))
    size = 50
    table = index_table(site, size, 1)
    half = 5.0 + 39.5 * 4.0
    for i in range(size):
        for j in range(size):
            east = (j + 0.5) * 2 * half / size - half
            north = half - (i + 0.5) * 2 * half / size
            cell = round((np.hypot(east, north) - 5.0) / 4.0)
            centres = (np.arange(64) + 0.5) * 2 * np.pi / 64
            apart = np.abs(np.angle(np.exp(1j * (centres - np.arctan2(east, north)))))
            if 0 <= cell < 40:
                row, column = divmod(int(table[i, j]), 40)
                assert column == cell
                assert apart[row] <= apart.min() + 1e-9
            else:
                assert table[i, j] == 64 * 40


def test_not_ready_is_said(http: httpx.Client, server: Server) -> None:
    server.service.ready = False
    try:
        answer = http.get("/health/ready")
        assert answer.status_code == 503
        assert answer.json()["checks"]["picture"] is False
        assert http.get("/health/live").status_code == 200
    finally:
        server.service.ready = True


def test_the_asyncapi_document_holds_together(http: httpx.Client) -> None:
    document = http.get("/asyncapi.json").json()
    assert document["asyncapi"] == "3.0.0"
    text = json.dumps(document)
    for reference in set(re.findall(r'"\$ref": "#/([^"]+)"', text)):
        target = document
        for step in reference.split("/"):
            target = target[step]
    for operation in document["operations"].values():
        assert operation["action"] in ("send", "receive")
        channel = operation["channel"]["$ref"]
        assert all(one["$ref"].startswith(f"{channel}/messages/") for one in operation["messages"])
    for schema in document["components"]["schemas"].values():
        jsonschema_rs.meta.validate({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema})
