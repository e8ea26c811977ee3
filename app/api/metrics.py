"""GET /metrics: everything that can go wrong, counted, for Prometheus."""

from __future__ import annotations

from collections.abc import Iterator

from fastapi import APIRouter
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.responses import Response

from app.api.context import Context
from app.runtime.refused_video import refusal_in
from app.wire import CLASSES, PHASES
from pipeline.picture import Picture

STATUS = ("ok", "degraded", "silent", "waiting")


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
        yield from self._store()

    def _sensors(self) -> Iterator[Metric]:
        counts = CounterMetricFamily(
            "airside_sensor_events",
            "what a sensor delivered and what was dropped, by reason",
            labels=["sensor", "reason"],
        )
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
        for sensor in self.context.service.sensors():
            for reason, count in sensor.counters.items():
                counts.add_metric([sensor.id, reason], count)
            for name in STATUS:
                status.add_metric([sensor.id, name], float(sensor.status == name))
            why = refusal_in(sensor.detail) if sensor.kind == "radar" else ""
            if why:
                refused.add_metric([sensor.id, why], 1.0)
            if sensor.last is not None:
                last.add_metric([sensor.id], sensor.last)
            if sensor.clock_offset_s is not None:
                offset.add_metric([sensor.id], sensor.clock_offset_s)
        yield from (counts, status, refused, last, offset)

    def _feed(self) -> Iterator[Metric]:
        hub = self.context.hub
        yield GaugeMetricFamily("airside_feed_clients", "connected clients of the live feed", value=len(hub.clients))
        yield CounterMetricFamily("airside_pictures", "pictures and alert changes numbered", value=hub.seq)
        events = CounterMetricFamily("airside_feed_events", "what happened on the live feed", labels=["event"])
        for name in (
            "clients_served",
            "messages_sent",
            "deltas_encoded",
            "merged_deltas",
            "closed_lagging",
            "refused_full",
            "refused_origin",
            "bad_messages",
        ):
            events.add_metric([name], hub.counters[name])
        yield events

    def _store(self) -> Iterator[Metric]:
        if self.context.store is None:
            return
        counts = CounterMetricFamily("airside_store_events", "what the database writer did", labels=["event"])
        for name, value in self.context.store.writer_counters().items():
            counts.add_metric([name], value)
        yield counts
        queued = self.context.store.queued()
        yield GaugeMetricFamily("airside_store_queue", "batches that wait for the database writer", value=queued)


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
