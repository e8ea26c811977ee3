"""Node events and target reports as JSON: what is taken, and what is refused with which words."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.contract import Refused
from app.ingest.node_events import parse_node_events
from app.ingest.target_reports import parse_target_reports
from app.ingest.wire_json import BadMessage, Parsed
from pipeline.airport.frame import LocalFrame
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, TargetCategory, TargetReports

NODES = (NodeSite("A1", 0, 0, 0), NodeSite("B2", 10, 0, 0))
FRAME = LocalFrame(48.725, 2.36)


def test_one_event_and_many() -> None:
    one = parse_node_events(b'{"time": 1700000000.5, "node": "B2"}', NODES).rows
    assert (one.time[0], one.node[0], one.kind[0]) == (1700000000.5, 1, NodeEventKind.PASSAGE)
    assert math.isnan(one.speed[0])
    assert one.strength[0] == 1
    many = parse_node_events(
        b'[{"time":"2023-11-14T22:13:20Z","node":"A1","kind":"left","speed_mps":12,"length_m":30.5,"strength":3,'
        b'"simulated":true},{"time":"2023-11-15T00:13:20+02:00","node":"A1","speed_mps":null}]',
        NODES,
    ).rows
    assert many.time.tolist() == [1700000000.0, 1700000000.0]
    assert many.kind.tolist() == [NodeEventKind.LEFT, NodeEventKind.PASSAGE]
    assert many.simulated.tolist() == [True, False]
    assert len(parse_node_events(b"[]", NODES).rows) == 0


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
        (b'{"time": 1700000000, "node": "A1", "kind": "flew"}', "bad_value", "flew"),
        (b"17", "bad_value", "object"),
        (b"[" * 100_000, "bad_json", "not JSON"),
        (b'[{"time": 1700000000}, {"time": "1", "node": "A1"}]', "bad_value", "event 0"),
    ],
)
def test_bad_events_are_refused_with_a_reason(body: bytes, reason: str, says: str) -> None:
    with pytest.raises(BadMessage, match=says) as caught:
        parse_node_events(body, NODES)
    assert caught.value.reason == reason
    assert isinstance(caught.value, Refused)


def test_a_time_that_cannot_be_is_left_to_the_judge_of_clocks() -> None:
    body = b'[{"time": 5, "node": "A1"}, {"time": 1e13, "node": "A1"}, {"time": -3.5, "node": "A1"}]'
    assert parse_node_events(body, NODES).rows.time.tolist() == [5.0, 1e13, -3.5]


def test_more_events_than_the_limit_are_refused() -> None:
    body = json.dumps([{"time": 1700000000, "node": "A1"}] * 6).encode()
    assert len(parse_node_events(body, NODES, 6).rows) == 6
    with pytest.raises(BadMessage, match="at most 5"):
        parse_node_events(body, NODES, 5)


def test_the_topic_names_the_node() -> None:
    assert parse_node_events(b'{"time": 1700000000}', NODES, node="B2").rows.node.tolist() == [1]
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
            parsed = parse()
        except Refused:
            continue
        assert len(parsed.rows) == len(parsed.places)
        assert not {one.row for one in parsed.bad} & set(parsed.places)


def test_a_report_in_local_metres() -> None:
    report = parse_target_reports(
        b'{"time":1700000000,"lat":48.725,"lon":2.36,"address":"3C66A1","callsign":"dlh123 ","speed_mps":8,'
        b'"course_deg":-90,"altitude_m":0,"on_ground":false,"category":"aircraft","accuracy_m":3,'
        b'"source":"MLAT_1.north-wes"}',
        FRAME,
    ).rows
    assert abs(report.east[0]) < 1e-6
    assert abs(report.north[0]) < 1e-6
    assert (report.address[0], report.callsign[0], report.category[0]) == ("3c66a1", "DLH123", TargetCategory.AIRCRAFT)
    assert report.course[0] == pytest.approx(math.radians(270))
    assert not report.on_ground[0]
    assert report.ground_known[0]
    assert report.source[0] == "MLAT_1.north-wes"
    bare = parse_target_reports(b'[{"time":1700000000,"lat":48.7,"lon":2.4}]', FRAME).rows
    assert bare.address[0] == bare.source[0] == ""
    assert math.isnan(bare.speed[0])
    assert bare.on_ground[0]
    assert not bare.ground_known[0]
    assert len(parse_target_reports(b"[]", FRAME).rows) == 0


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


def report(**more: object) -> dict[str, object]:
    return {"time": 1700000000, "lat": 48.7, "lon": 2.4, **more}


def parsed(*rows: object) -> Parsed[TargetReports]:
    return parse_target_reports(json.dumps(rows).encode(), FRAME)


def test_the_good_reports_of_a_batch_are_taken_and_each_bad_one_is_told() -> None:
    made = parsed(
        report(address="000001"), report(address="xyz"), report(address="000002", lat=91), {"lat": 48.7, "lon": 2.4},
        17, report(address="000003", rssi=-20.1, flags=["a"]), report(time="1 o'clock"),
    )  # fmt: skip
    assert made.rows.address.tolist() == ["000001", "000003"]
    assert made.places == (0, 5)
    assert [(one.row, one.reason) for one in made.bad] == [(row, "bad_value") for row in (1, 2, 3, 4, 6)]
    for one, says in zip(made.bad, ("address", "lat", "time", "object", "1 o'clock"), strict=True):
        assert one.message.startswith(f"report {one.row}: ")
        assert says in one.message
    assert made.ignored == ("rssi", "flags")


def test_the_good_events_of_a_batch_are_taken_and_each_bad_one_is_told() -> None:
    body = (
        b'[{"time": 1, "node": "A1", "speed": 3}, {"time": 2, "node": "C3"}, {"node": "A1"}, {"time": 4, "node": "B2"}]'
    )
    made = parse_node_events(body, NODES)
    assert made.rows.node.tolist() == [0, 1]
    assert made.places == (0, 3)
    assert [(one.row, one.reason) for one in made.bad] == [(1, "unknown_node"), (2, "bad_value")]
    assert made.ignored == ("speed",)


def test_where_no_row_is_good_each_is_told_in_the_error() -> None:
    with pytest.raises(BadMessage, match="report 0: lat") as caught:
        parsed(report(lat=91), report(callsign="<b>"))
    assert [(one.row, one.reason) for one in caught.value.rows] == [(0, "bad_value"), (1, "bad_value")]
    with pytest.raises(BadMessage) as caught:
        parse_target_reports(b"[{", FRAME)
    assert caught.value.rows == ()


@pytest.mark.parametrize(
    ("given", "taken"),
    [
        ("4B1815", "4b1815"), ("~2A1b3c", "~2a1b3c"), (" 4b1815 ", "4b1815"), ("000000", ""), ("ffffff", ""),
        ("FFFFFF", ""), ("~000000", ""), ("", ""), (None, ""),
    ],
)  # fmt: skip
def test_addresses(given: str | None, taken: str) -> None:
    assert parsed(report(address=given)).rows.address.tolist() == [taken]


@pytest.mark.parametrize("given", ["~", "~~2a1b3c", "2a1b3c~", "~2a1b3", "~2a1b3cd", "0x4b18", "4b181\u0665"])
def test_wrong_addresses(given: str) -> None:
    with pytest.raises(BadMessage, match="hexadecimal"):
        parsed(report(address=given))


@pytest.mark.parametrize(
    ("given", "taken"),
    [
        ("@@@@@@@@", ""), ("        ", ""), ("________", ""), ("\0\0\0\0\0\0\0\0", ""), ("DLH9@@@@", "DLH9"),
        ("dlh9    ", "DLH9"), ("FOLLOW_1", "FOLLOW_1"), (None, ""),
    ],
)  # fmt: skip
def test_callsigns(given: str | None, taken: str) -> None:
    assert parsed(report(callsign=given)).rows.callsign.tolist() == [taken]


@pytest.mark.parametrize("given", [True, False, None])
def test_whether_it_is_on_the_ground_may_be_unknown(given: bool | None) -> None:
    rows = parsed(report(on_ground=given, altitude_m=3000)).rows
    assert rows.ground_known.tolist() == [given is not None]
    assert rows.on_ground[0] == (given is not False)


def test_a_byte_order_mark_is_no_fault() -> None:
    assert len(parse_target_reports(b"\xef\xbb\xbf" + json.dumps(report()).encode(), FRAME).rows) == 1
