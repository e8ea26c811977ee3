"""The ways in over HTTP: a batch with bad rows, what is answered, what is counted."""

from __future__ import annotations

import time
from typing import Any

import httpx
import pytest

from tests.support.running import Server

REPORTS, EVENTS = "/api/v1/targets/reports", "/api/v1/nodes/events"


def report(number: int, **more: Any) -> dict[str, Any]:
    return {"time": time.time(), "lat": 48.7233, "lon": 2.3794, "address": f"4b18{number:02x}", **more}


@pytest.mark.parametrize(
    ("bad", "reason", "says"),
    [
        ({"address": "4b18zz"}, "bad_value", "hexadecimal"),
        ({"lat": 95.0}, "bad_value", "lat"),
        ({"callsign": "<b>x</b>"}, "bad_value", "callsign"),
        ({"time": "today"}, "bad_value", "ISO 8601"),
        ({"hours_ahead": 1.0}, "ahead", "local time?"),
        ({"time": 4711.0}, "behind", "own start"),
    ],
)
def test_one_bad_report_does_not_lose_the_others(
    http: httpx.Client, server: Server, bad: dict[str, Any], reason: str, says: str
) -> None:
    words = {"time": time.time() + 3600.0 * bad["hours_ahead"]} if "hours_ahead" in bad else bad
    rows = [report(i) for i in range(9)]
    rows.insert(4, report(99, **words))
    answer = http.post(REPORTS, json=rows)
    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert (body["taken"], body[f"refused_{reason}"]) == (9, 1)
    assert [(one["index"], one["reason"]) for one in body["errors"]] == [(4, reason)]
    assert says in body["errors"][0]["message"]
    assert len(server.service.target_reports[-1]) == 9


@pytest.mark.parametrize(
    ("good", "address", "callsign"),
    [
        ({"address": "~2a1b3c"}, "~2a1b3c", ""),
        ({"address": "000000"}, "", ""),
        ({"address": "FFFFFF", "callsign": "FOLLOW 1"}, "", "FOLLOW 1"),
        ({"callsign": "@@@@@@@@"}, "4b1807", ""),
        ({"rssi": -20.1, "squawk": "1000"}, "4b1807", ""),
    ],
)
def test_what_real_feeds_send_is_taken(
    http: httpx.Client, server: Server, good: dict[str, Any], address: str, callsign: str
) -> None:
    body = http.post(REPORTS, json=[report(7, **good)]).json()
    assert body["taken"] == 1
    assert "errors" not in body
    assert body.get("ignored", []) == [name for name in good if name not in ("address", "callsign")]
    taken = server.service.target_reports[-1]
    assert (taken.address[0], taken.callsign[0]) == (address, callsign)


def test_both_kinds_of_refusal_are_told_in_the_order_of_the_batch(http: httpx.Client) -> None:
    now = time.time()
    rows = [report(0, lat=95), report(1, time=now + 3600), report(2), report(3, lon=999), report(4, time=now - 3600)]
    body = http.post(REPORTS, json=rows).json()
    assert body["taken"] == 1
    told = [(one["index"], one["reason"]) for one in body["errors"]]
    assert told == [(0, "bad_value"), (1, "ahead"), (3, "bad_value"), (4, "behind")]


@pytest.mark.parametrize("late", [False, True])
def test_when_no_report_can_be_taken_each_is_told_in_the_problem(http: httpx.Client, late: bool) -> None:
    rows = [report(0, address="?"), report(1, **({"time": time.time() + 3600} if late else {"lat": "north"}))]
    answer = http.post(REPORTS, json=rows)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    told = [(one["index"], one["reason"]) for one in answer.json()["errors"]]
    assert told == [(0, "bad_value"), (1, "ahead" if late else "bad_value")]


def test_events_are_taken_in_the_same_way(http: httpx.Client, server: Server) -> None:
    now = time.time()
    rows = [
        {"time": now, "node": "nobody"}, {"time": now, "node": "node-1", "battery": 3.3}, {"time": now},
        {"time": now + 3600, "node": "node-1"},
    ]  # fmt: skip
    body = http.post(EVENTS, json=rows).json()
    told = [(one["index"], one["reason"]) for one in body["errors"]]
    assert told == [(0, "unknown_node"), (2, "bad_value"), (3, "ahead")]
    assert (body["taken"], body["refused_unknown_node"], body["refused_bad_value"]) == (1, 1, 1)
    assert body["ignored"] == ["battery"]
    assert len(server.service.node_events[-1]) == 1


def test_rows_that_cannot_be_read_are_counted_where_the_health_of_the_feed_is_told(http: httpx.Client) -> None:
    def counted() -> int:
        rows = http.get("/api/v1/sensors").json()["sensors"]
        return sum(one["counters"].get("refused_bad_value", 0) for one in rows if one["id"] == "reports")

    before = counted()
    http.post(REPORTS, json=[report(0), report(1, lat=95)])
    http.post(REPORTS, json=[report(1, lat=95)])
    assert counted() == before + 2
