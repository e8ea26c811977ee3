"""Node events and target reports as JSON: what is taken, and what is refused with which words."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.contract import Refused
from app.ingest.node_events import parse_node_events
from app.ingest.target_reports import parse_target_reports
from app.ingest.wire_json import BadMessage
from pipeline.airport.frame import LocalFrame
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, TargetCategory

NODES = (NodeSite("A1", 0, 0, 0), NodeSite("B2", 10, 0, 0))
FRAME = LocalFrame(48.725, 2.36)


def test_one_event_and_many() -> None:
    one = parse_node_events(b'{"time": 1700000000.5, "node": "B2"}', NODES)
    assert (one.time[0], one.node[0], one.kind[0]) == (1700000000.5, 1, NodeEventKind.PASSAGE)
    assert math.isnan(one.speed[0])
    assert one.strength[0] == 1
    many = parse_node_events(
        b'[{"time":"2023-11-14T22:13:20Z","node":"A1","kind":"left","speed_mps":12,"length_m":30.5,"strength":3,'
        b'"simulated":true},{"time":"2023-11-15T00:13:20+02:00","node":"A1","speed_mps":null}]',
        NODES,
    )
    assert many.time.tolist() == [1700000000.0, 1700000000.0]
    assert many.kind.tolist() == [NodeEventKind.LEFT, NodeEventKind.PASSAGE]
    assert many.simulated.tolist() == [True, False]
    assert len(parse_node_events(b"[]", NODES)) == 0


@pytest.mark.parametrize(
    ("body", "reason", "says"),
    [
        (b"{", "bad_json", "not JSON"),
        (b'{"time": NaN, "node": "A1"}', "bad_json", "not JSON"),
        (b'{"time": 1700000000, "node": "A1", "speed_mps": Infinity}', "bad_json", "not JSON"),
        (b'{"time": 1e999, "node": "A1"}', "bad_json", "out of range"),
        (b'{"time": 1700000000, "node": "\xff"}', "bad_json", "not JSON"),
        (b'{"node": "A1"}', "bad_value", "time"),
        (b'{"time": 1700000000}', "bad_value", "node is missing"),
        (b'{"time": true, "node": "A1"}', "bad_value", "time"),
        (b'{"time": ' + b"9" * 400 + b', "node": "A1"}', "bad_value", "time must be"),
        (b'{"time": "2023-11-14T22:13:20", "node": "A1"}', "bad_value", "zone"),
        (b'{"time": "yesterday", "node": "A1"}', "bad_value", "yesterday"),
        (b'{"time": 1700000000, "node": "C3"}', "unknown_node", "C3"),
        (b'{"time": 1700000000, "node": "A1", "speed_mps": -1}', "bad_value", "speed_mps"),
        (b'{"time": 1700000000, "node": "A1", "speed": 1}', "bad_value", "speed"),
        (b'{"time": 1700000000, "node": "A1", "kind": "flew"}', "bad_value", "flew"),
        (b"17", "bad_value", "object"),
        (b"[" * 100_000, "bad_json", "not JSON"),
        (b'[{"time": 1700000000, "node": "A1"}, {"time": "1", "node": "A1"}]', "bad_value", "event 1"),
    ],
)
def test_bad_events_are_refused_with_a_reason(body: bytes, reason: str, says: str) -> None:
    with pytest.raises(BadMessage, match=says) as caught:
        parse_node_events(body, NODES)
    assert caught.value.reason == reason
    assert isinstance(caught.value, Refused)


def test_a_time_that_cannot_be_is_left_to_the_judge_of_clocks() -> None:
    body = b'[{"time": 5, "node": "A1"}, {"time": 1e13, "node": "A1"}, {"time": -3.5, "node": "A1"}]'
    assert parse_node_events(body, NODES).time.tolist() == [5.0, 1e13, -3.5]


def test_more_events_than_the_limit_are_refused() -> None:
    body = json.dumps([{"time": 1700000000, "node": "A1"}] * 6).encode()
    assert len(parse_node_events(body, NODES, 6)) == 6
    with pytest.raises(BadMessage, match="at most 5"):
        parse_node_events(body, NODES, 5)


def test_the_topic_names_the_node() -> None:
    assert parse_node_events(b'{"time": 1700000000}', NODES, node="B2").node.tolist() == [1]
    with pytest.raises(BadMessage) as caught:
        parse_node_events(b'{"time": 1700000000, "node": "A1"}', NODES, node="B2")
    assert caught.value.reason == "wrong_node"


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(["time", "node", "kind", "lat", "lon", "speed_mps", "address", "callsign"]), inner, max_size=5
    ),
    max_leaves=12,
)  # fmt: skip


@given(st.binary(max_size=60) | json_values.map(lambda value: json.dumps(value).encode()))
def test_whatever_comes_in_is_taken_or_refused(body: bytes) -> None:
    for parse in (lambda: parse_node_events(body, NODES), lambda: parse_target_reports(body, FRAME)):
        try:
            table = parse()
        except Refused:
            continue
        assert len(table) >= 0


def test_a_report_in_local_metres() -> None:
    report = parse_target_reports(
        b'{"time":1700000000,"lat":48.725,"lon":2.36,"address":"3C66A1","callsign":"dlh123 ","speed_mps":8,'
        b'"course_deg":-90,"altitude_m":0,"on_ground":false,"category":"aircraft","accuracy_m":3,'
        b'"source":"MLAT_1.north-wes"}',
        FRAME,
    )
    assert abs(report.east[0]) < 1e-6
    assert abs(report.north[0]) < 1e-6
    assert (report.address[0], report.callsign[0], report.category[0]) == ("3c66a1", "DLH123", TargetCategory.AIRCRAFT)
    assert report.course[0] == pytest.approx(math.radians(270))
    assert not report.on_ground[0]
    assert report.source[0] == "MLAT_1.north-wes"
    bare = parse_target_reports(b'[{"time":1700000000,"lat":48.7,"lon":2.4}]', FRAME)
    assert bare.address[0] == bare.source[0] == ""
    assert math.isnan(bare.speed[0])
    assert bare.on_ground[0]
    assert len(parse_target_reports(b"[]", FRAME)) == 0


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("lat", 91, "lat"),
        ("lon", -181, "lon"),
        ("lat", None, "lat"),
        ("address", "xyz", "hexadecimal"),
        ("callsign", "MUCH TOO LONG", "callsign"),
        ("callsign", "<b>", "callsign"),
        ("course_deg", 1e9, "course_deg"),
        ("accuracy_m", 0, "accuracy_m"),
        ("category", "bird", "bird"),
        ("source", "a" * 17, "source must be at most 16"),
        ("source", "adsb 1", "source"),
        ("source", "adsb\n", "source"),
        ("source", "ädsb", "source"),
        ("source", 1, "source"),
    ],
)
def test_bad_reports_are_refused_with_a_reason(field: str, value: object, says: str) -> None:
    row = {"time": 1700000000, "lat": 48.7, "lon": 2.4, field: value}
    with pytest.raises(BadMessage, match=says):
        parse_target_reports(json.dumps(row).encode(), FRAME)
