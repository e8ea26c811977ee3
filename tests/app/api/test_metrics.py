"""Metrics: everything that can go wrong, counted, one unit a metric."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from app.api.units import OCCURRENCES, unit_of
from app.contract import Service
from pipeline.assemble.state import COUNTERS
from tests.support.running import Server, until
from tests.support.service_rigs import RealRig


def samples(http: httpx.Client) -> dict[tuple[object, ...], float]:
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(http.get("/metrics").text)
        for sample in family.samples
    }


def test_metrics_count_by_reason(http: httpx.Client, server: Server) -> None:
    server.service.raise_alert()
    server.service.step()
    until(lambda: server.hub.counters["alert_changes"] == 1, "the alert is numbered")
    found = samples(http)
    assert found["airside_sensor_messages_total", ("reason", "lost"), ("sensor", "smr-1")] == 3
    assert found["airside_sensor_sweeps_total", ("reason", "sweeps"), ("sensor", "smr-1")] == 4096
    assert found["airside_sensor_status", ("sensor", "smr-2"), ("status", "silent")] == 1
    assert sum(value for key, value in found.items() if key[0] == "airside_tracks") == 12
    assert found["airside_stage_seconds", ("stage", "detect")] == 0.0011
    assert ("airside_store_rows_total", ("outcome", "dropped"), ("table", "points")) in found
    assert ("airside_store_transactions_total", ("outcome", "retried")) in found
    assert found["airside_feed_clients",] == 0
    assert found["airside_feed_messages_total", ("event", "bad")] == 0
    assert (found["airside_pictures_total",], found["airside_alert_changes_total",]) == (2, 1)


def test_no_family_is_told_twice(http: httpx.Client) -> None:
    families = [one.name for one in text_string_to_metric_families(http.get("/metrics").text)]
    assert len(set(families)) == len(families)


def test_what_a_sensor_counts_stands_under_its_unit(http: httpx.Client, server: Server) -> None:
    found = {
        (labels["sensor"], labels["reason"]): name.removeprefix("airside_sensor_").removesuffix("_total")
        for (name, *pairs) in samples(http)
        if "reason" in (labels := dict(pairs))  # type: ignore[call-overload]
    }
    expected = {(one.id, name): unit_of(one.kind, name) for one in server.service.sensors() for name in one.counters}
    assert found == expected


@pytest.mark.parametrize(
    ("kind", "name", "unit"),
    [
        ("radar", "octets", "bytes"), ("radar", "datagrams", "datagrams"), ("radar", "truncated", "datagrams"),
        ("radar", "refused_source", "datagrams"),
        ("radar", "lost", "messages"), ("radar", "missing_sweeps", "sweeps"), ("radar", "cells_detected", "cells"),
        ("radar", "plots_below_min_cells", "plots"), ("radar", "block_failures", "blocks"),
        ("radar", "wrong_cell_count", "messages"), ("radar", "clock_step", OCCURRENCES),
        ("node", "taken", "events"), ("node", "refused_ahead", "events"), ("node", "clock_steps", OCCURRENCES),
        ("report", "taken", "reports"), ("report", "refused_bad_value", "reports"),
        ("tracker", "plot_on_building", "plots"), ("tracker", "report_late", "reports"), ("tracker", "ended", "tracks"),
        ("tracker", "node_started", "events"), ("tracker", "mqtt_bad_json", "events"),
        ("tracker", "failures", OCCURRENCES),
        ("tracker", "mqtt_messages", "messages"), ("tracker", "mqtt_connects", OCCURRENCES),
        ("tracker", "target_reports", "reports"), ("store", "points_dropped", "rows"), ("store", "bytes", "bytes"),
        ("other", "something_new", OCCURRENCES),
    ],
)  # fmt: skip
def test_units(kind: str, name: str, unit: str) -> None:
    assert unit_of(kind, name) == unit


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    rig = RealRig(tmp_path_factory.mktemp("real"))
    yield rig.service
    rig.real.stop()


def test_a_radar_has_few_counters_that_only_say_that_something_happened(real: Service) -> None:
    """A new counter of a radar with a unit of its own is to be told in `app.api.units`."""
    names = {name for one in real.sensors() if one.kind == "radar" for name in one.counters} | set(COUNTERS)
    assert len(names) > 20
    happens = {name for name in names if unit_of("radar", name) == OCCURRENCES}
    assert happens <= {"clock_step", "restart", "parts_changed", "time_rebased", "socket_errors"}
