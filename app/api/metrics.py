"""GET /metrics: everything that can go wrong, counted, for Prometheus."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fastapi import APIRouter
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.responses import Response

from app.api.context import Context
from app.api.units import unit_of
from app.runtime.refused_video import refusal_in
from app.wire import CLASSES, PHASES
from pipeline.picture import Picture, SensorState

STATUS = ("ok", "degraded", "silent", "waiting")

FEED: dict[str, tuple[str, dict[str, str]]] = {
    "connections": (
        "connections to the live feed, by what became of them",
        {name: name for name in ("closed_lagging", "refused_full", "refused_origin")} | {"served": "clients_served"},
    ),
    "messages": ("messages of the live feed", {"sent": "messages_sent", "bad": "bad_messages"}),
    "subscriptions_refused": (
        "subscriptions that were refused, by reason",
        {"too_often": "refused_subscriptions", "too_many_filters": "refused_filters"},
    ),
    "deltas": ("deltas of the live feed", {"encoded": "deltas_encoded", "merged": "merged_deltas"}),
}
"""The metrics of the live feed: the unit, what it is about, and of each event its counter."""

TABLES = ("points", "tracks", "alert_changes", "node_events", "sensor_states")
TRANSACTIONS = {"written": "transactions", "retried": "retries", "refused": "refused"}
"""Outcomes of what the database writer tried, and their counters."""


def metrics_router(context: Context) -> APIRouter:
    """The metrics of this service in a registry of their own, read when asked."""
    router = APIRouter()
    registry = CollectorRegistry()
    registry.register(ServiceCollector(context))

    @router.get("/metrics", response_class=Response, tags=["operation"])
    def metrics() -> Response:
        """Prometheus text format."""
        return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)

    return router


class ServiceCollector(Collector):
    """Reads the service, the feed and the store at each scrape; keeps nothing itself."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def describe(self) -> list[Metric]:
        """Nothing in advance: the service may not have begun yet."""
        return []

    def collect(self) -> Iterator[Metric]:
        """All metrics."""
        ready = GaugeMetricFamily("airside_ready", "start-up checks that are passed", labels=["check"])
        for name, passed in self.context.service.readiness().checks.items():
            ready.add_metric([name], float(passed))
        yield ready
        yield from self._sensors()
        picture = self.context.service.picture()
        if picture is not None:
            yield from _of_picture(picture)
        yield from self._feed()
        yield self._refused()
        yield from self._store()

    def _sensors(self) -> Iterator[Metric]:
        status = GaugeMetricFamily(
            "airside_sensor_status", "1 for the state a sensor is in", labels=["sensor", "status"]
        )
        offset = GaugeMetricFamily(
            "airside_sensor_clock_offset_seconds", "a sensor's clock less the time of arrival", labels=["sensor"]
        )
        refused = GaugeMetricFamily(
            "airside_sensor_refused", "1 while a radar's video is refused, and why", labels=["sensor", "reason"]
        )
        last = GaugeMetricFamily("airside_sensor_last_seconds", "Unix time of the newest data", labels=["sensor"])
        sensors = self.context.service.sensors()
        for sensor in sensors:
            for name in STATUS:
                status.add_metric([sensor.id, name], float(sensor.status == name))
            why = refusal_in(sensor.detail) if sensor.kind == "radar" else ""
            if why:
                refused.add_metric([sensor.id, why], 1.0)
            if sensor.last is not None:
                last.add_metric([sensor.id], sensor.last)
            if sensor.clock_offset_s is not None:
                offset.add_metric([sensor.id], sensor.clock_offset_s)
        yield from (*_counts(sensors), status, refused, last, offset)

    def _feed(self) -> Iterator[Metric]:
        hub = self.context.hub
        yield GaugeMetricFamily("airside_feed_clients", "connected clients of the live feed", value=len(hub.clients))
        yield CounterMetricFamily("airside_pictures", "pictures that were numbered", value=hub.counters["pictures"])
        changes = hub.counters["alert_changes"]
        yield CounterMetricFamily("airside_alert_changes", "alert changes that were numbered", value=changes)
        for unit, (about, events) in FEED.items():
            counts = CounterMetricFamily(f"airside_feed_{unit}", about, labels=["event"])
            for event, counter in events.items():
                counts.add_metric([event], hub.counters[counter])
            yield counts

    def _refused(self) -> Metric:
        refused = CounterMetricFamily(
            "airside_web_refused", "requests and connections that were refused or cut", labels=["reason"]
        )
        for reason, count in self.context.refused.items():
            refused.add_metric([reason], count)
        return refused

    def _store(self) -> Iterator[Metric]:
        if self.context.store is None:
            return
        counters = self.context.store.writer_counters()
        rows = CounterMetricFamily(
            "airside_store_rows", "rows that the database writer wrote or dropped", labels=["table", "outcome"]
        )
        for table in TABLES:
            rows.add_metric([table, "written"], counters.get(table, 0))
            rows.add_metric([table, "dropped"], counters.get(f"{table}_dropped", 0))
        yield rows
        transactions = CounterMetricFamily(
            "airside_store_transactions", "transactions of the database writer", labels=["outcome"]
        )
        for outcome, counter in TRANSACTIONS.items():
            transactions.add_metric([outcome], counters.get(counter, 0))
        yield transactions
        failed = counters.get("failed", 0)
        yield CounterMetricFamily("airside_store_pictures_failed", "pictures that could not be recorded", value=failed)
        queued = self.context.store.queued()
        yield GaugeMetricFamily("airside_store_queue", "batches that wait for the database writer", value=queued)


def _counts(sensors: Iterable[SensorState]) -> Iterator[Metric]:
    """What the sensors delivered and what was dropped, a metric for each unit."""
    made: dict[str, Metric] = {}
    for sensor in sensors:
        for reason, count in sensor.counters.items():
            unit = unit_of(sensor.kind, reason)
            if unit not in made:
                about = f"{unit} that a sensor delivered or that were dropped, by reason"
                made[unit] = CounterMetricFamily(f"airside_sensor_{unit}", about, labels=["sensor", "reason"])
            made[unit].add_metric([sensor.id, reason], count)  # type: ignore[attr-defined]
    yield from made.values()


def _of_picture(picture: Picture) -> Iterator[Metric]:
    yield GaugeMetricFamily("airside_picture_time_seconds", "Unix time of the newest picture", value=picture.time)
    tracks = GaugeMetricFamily("airside_tracks", "tracks in the picture", labels=["class", "phase"])
    pairs = list(zip(picture.tracks.category.tolist(), picture.tracks.phase.tolist(), strict=True))
    for i, kind in enumerate(CLASSES):
        for j, phase in enumerate(PHASES):
            tracks.add_metric([kind, phase], pairs.count((i, j)))
    yield tracks
    alerts = GaugeMetricFamily("airside_alerts", "live alerts", labels=["stage"])
    for stage in ("information", "alarm"):
        alerts.add_metric([stage], sum(one.stage == stage for one in picture.alerts))
    yield alerts
    timings = GaugeMetricFamily("airside_stage_seconds", "time each stage took for the newest block", labels=["stage"])
    for name, seconds in picture.timings.items():
        timings.add_metric([name], seconds)
    yield timings
