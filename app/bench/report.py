"""The figures of `airside bench` that need the whole service."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from app.bench.clients import measure_clients
from app.bench.delay import measure_delay
from app.bench.intake import measure_intake
from app.bench.subject import running_demo
from pipeline.lab.measure.picture_quality import QualityRow

SETTLE_S = 30.0
"""The detector learns before it detects, and tracks take a few turns to be confirmed."""

DELAY_MS = 150.0
"""Most that 99 % of updates may take from sweep to client."""

CORES = 2.0
"""Most that the service may take with simulator, 200 clients and 300 targets."""


def service_rows(seconds: float, step: Callable[[str], None]) -> Iterator[QualityRow]:
    """Intake, delay, clients and cost of the running service, each with the bound where one was set.

    step: hears what is being measured. Every figure is of this machine at this moment.
    """
    step("CAT240 intake")
    for rate, most in ((8192.0, 0.0), (16384.0, None)):
        intake = measure_intake(rate, seconds)
        yield QualityRow(
            f"CAT240 at {rate:,.0f} messages/s", float(intake.lost), "lost", most, note=f"of {intake.sent:,}"
        )
    step("delay from sweep to client, 100 targets on radar alone")
    yield from _delay(seconds)
    step("200 clients, 300 targets")
    yield from _clients(seconds)


def _delay(seconds: float) -> Iterator[QualityRow]:
    with running_demo(DEMO__SYNTHETIC_TARGETS="100", DEMO__REPORTS="false") as subject:
        time.sleep(SETTLE_S)
        cpu, begun = subject.cpu_seconds(), time.monotonic()
        delay = measure_delay(subject, seconds)
        cpu = (subject.cpu_seconds() - cpu) / (time.monotonic() - begun)
        dropped = subject.counters()["queue_dropped_blocks"]
        memory = subject.resident_mib()
    yield QualityRow("sweep to WebSocket client, p50", 1e3 * delay.p50_s, "ms", note=f"{delay.tracks} tracks")
    yield QualityRow(
        "sweep to WebSocket client, p99", 1e3 * delay.p99_s, "ms", DELAY_MS, note=f"{delay.updates} updates"
    )
    yield QualityRow("processor with simulator, 100 targets", cpu, "cores", note=f"{dropped} blocks dropped")
    yield QualityRow("memory, 100 targets", memory, "MiB")


def _clients(seconds: float) -> Iterator[QualityRow]:
    with running_demo(DEMO__SYNTHETIC_TARGETS="300", DEMO__REPORTS="true") as subject:
        time.sleep(SETTLE_S)
        load = measure_clients(subject, 200, seconds)
    yield QualityRow(
        "200 clients at 1 Hz, messages a client and second",
        load.messages_per_client_per_second,
        "",
        1.0 - 1.0 / seconds,  # one may fall just outside of what was listened to
        at_least=True,
        note=f"{load.kilobytes_per_client_per_second:.0f} kB/s each",
    )
    yield QualityRow(
        "processor with simulator, 200 clients",
        load.cpu_cores,
        "cores",
        CORES,
        note=f"{load.blocks_dropped} blocks dropped",
    )
