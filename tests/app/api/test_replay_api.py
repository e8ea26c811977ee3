"""GET and PUT /api/v1/replay."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import httpx
import jsonschema_rs
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode

from tests.app.api.test_openapi import CHECKS
from tests.support.fake_replay import BEGIN, LENGTH_S, FakeReplay
from tests.support.live_client import live
from tests.support.running import Server, first_picture, running, until

PATH = "/api/v1/replay"
JSON = {"content-type": "application/json"}


@pytest.fixture(scope="module")
def stands() -> list[float]:
    """The clock of the replay, turned by hand."""
    return [0.0]


@pytest.fixture(scope="module")
def replaying(stands: list[float]) -> Iterator[Server]:
    with running(replay=FakeReplay(clock=lambda: stands[0])) as made:
        first_picture(made)
        yield made


@pytest.fixture
def client(replaying: Server) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=replaying.url, timeout=20.0) as made:
        made.put(PATH, json={"playing": False, "speed": 1, "time": BEGIN})
        yield made


def put(client: httpx.Client, order: Any, status: int = 200) -> Any:
    answer = client.put(PATH, json=order)
    assert answer.status_code == status, answer.text
    return answer.json()


def test_the_state_is_told_whole(client: httpx.Client) -> None:
    assert client.get(PATH).json() == {
        "mode": "replay",
        "source": "orly-2026-11-27.mcap",
        "begin": BEGIN,
        "end": BEGIN + LENGTH_S,
        "time": BEGIN,
        "playing": False,
        "speed": 1.0,
        "gaps": [BEGIN + 400.0, BEGIN + 1310.0],
    }


def test_answers_are_as_the_document_says(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    for verb in ("get", "put"):
        schema = document["paths"][PATH][verb]["responses"]["200"]["content"]["application/json"]["schema"]
        whole = {**schema, "components": document["components"]}
        answer = client.get(PATH).json() if verb == "get" else put(client, {"playing": True})
        jsonschema_rs.Draft202012Validator(whole).validate(answer)
    order = document["paths"][PATH]["put"]["requestBody"]["content"]["application/json"]["schema"]
    assert order == {"$ref": "#/components/schemas/ReplayOrder"}
    assert set(document["components"]["schemas"]["ReplayOrder"]["properties"]) == {"playing", "speed", "time"}


def test_it_plays_at_the_pace_that_is_asked_for_and_pauses(client: httpx.Client, stands: list[float]) -> None:
    assert put(client, {"playing": True, "speed": 4})["playing"] is True
    stands[0] += 10.0
    assert client.get(PATH).json()["time"] == BEGIN + 40.0
    assert put(client, {"playing": False})["speed"] == 4.0
    stands[0] += 10.0
    assert client.get(PATH).json()["time"] == BEGIN + 40.0


@pytest.mark.parametrize(
    "wanted",
    [BEGIN + 90.5, int(BEGIN) + 90, "2026-11-27T11:21:30Z", "2026-11-27T12:21:30+01:00", "2026-11-27T11:21:30"],
)
def test_the_time_is_set_in_seconds_or_iso_8601(client: httpx.Client, wanted: Any) -> None:
    told = put(client, {"time": wanted})["time"]
    assert told == (float(wanted) if not isinstance(wanted, str) else BEGIN + 90.0)
    assert datetime.fromtimestamp(told, UTC).hour == 11


@pytest.mark.parametrize(
    "body",
    [
        b"", b"null", b"[]", b"{}", b"not json", b"\xff\xfe", b"[" * 20_000, b'{"time": ' + b"9" * 5000 + b"}",
        b'{"playing": null}', b'{"playing": 1}', b'{"playing": "yes"}', b'{"playing": true, "more": 1}',
        b'{"speed": NaN}', b'{"speed": Infinity}', b'{"speed": 1e999}', b'{"speed": "2"}', b'{"speed": true}',
        b'{"speed": 0}', b'{"speed": -1}', b'{"speed": 0.05}', b'{"speed": 65}', b'{"speed": ' + b"9" * 400 + b"}",
        b'{"time": NaN}', b'{"time": -Infinity}', b'{"time": 1e300}', b'{"time": true}', b'{"time": []}',
        b'{"time": "soon"}', b'{"time": "NaN"}', b'{"time": ""}', b'{"time": "1e999"}',
        b'{"time": "0001-01-01T00:00+23:00"}',
        b'{"time": 0}', b'{"time": "2099-01-01T00:00:00Z"}', b'{"playing": true, "time": 1}',
    ],
)  # fmt: skip
def test_orders_that_cannot_be_taken_change_nothing(client: httpx.Client, body: bytes) -> None:
    before = client.get(PATH).json()
    answer = client.put(PATH, content=body, headers=JSON)
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["detail"]
    assert client.get(PATH).json() == before


def test_another_content_type_and_another_origin_are_refused(client: httpx.Client) -> None:
    assert client.put(PATH, content=b'{"playing": true}', headers={"content-type": "text/plain"}).status_code == 415
    foreign = {**JSON, "origin": "https://evil.example"}
    assert client.put(PATH, content=b'{"playing": true}', headers=foreign).status_code == 403


def test_a_service_that_shows_what_happens_now_has_no_replay(http: httpx.Client) -> None:
    for answer in (http.get(PATH), http.put(PATH, json={"playing": True})):
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"
        assert "no recording" in answer.json()["detail"]


async def test_a_seek_back_sends_every_client_the_picture_anew(replaying: Server, client: httpx.Client) -> None:
    put(client, {"time": BEGIN + 600})
    replaying.service.step()
    until(lambda: replaying.hub.picture is not None and replaying.hub.picture.time == BEGIN + 600, "it is shown")
    async with live(replaying.live) as feed:
        await feed.subscribe()
        old = await feed.until("snapshot", "tracks")
        put(client, {"time": BEGIN + 30})
        replaying.service.step()
        fresh = await feed.until("snapshot", "tracks")
    assert (old["time"], fresh["time"]) == (BEGIN + 600, BEGIN + 30)
    assert fresh["epoch"] != old["epoch"]
    assert fresh["mode"] == "replay"


@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE], ids=["right", "wrong"])
def test_the_replay_keeps_to_its_document(replaying: Server, mode: GenerationMode) -> None:
    schema = schemathesis.openapi.from_url(f"{replaying.url}/openapi.json").include(path=PATH)
    operations: list[Any] = [one.ok() for one in schema.get_all_operations()]
    assert len(operations) == 2
    for operation in operations:
        if mode is GenerationMode.NEGATIVE and not operation.body:
            continue

        @settings(
            max_examples=40,
            derandomize=True,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy(generation_mode=mode))
        def run(case: Any) -> None:
            case.call_and_validate(checks=CHECKS, timeout=20)

        run()
