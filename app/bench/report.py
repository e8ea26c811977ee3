"""The tables of `airside bench` that need the whole service."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.table import Table

from app.bench.clients import measure_clients
from app.bench.delay import measure_delay
from app.bench.intake import measure_intake
from app.bench.subject import running_demo

SETTLE_S = 30.0
"""The detector learns before it detects, and tracks take a few turns to be confirmed."""


def service_table(seconds: float, step: Callable[[str], None]) -> Table:
    """Intake, delay, clients and cost of the running service, each beside what was asked for.

    step: hears what is being measured. Every figure is of this machine at this moment.
    """
    table = Table(title="The running service", title_justify="left")
    for name, side in (("what", "left"), ("asked", "right"), ("measured", "right"), ("", "left")):
        table.add_column(name, justify="right" if side == "right" else "left")
    step("CAT240 intake")
    for rate in (8192.0, 16384.0):
        intake = measure_intake(rate, seconds)
        asked = "0 lost" if rate == 8192.0 else ""
        table.add_row(f"CAT240 at {rate:,.0f} messages/s", asked, f"{intake.lost} lost", f"of {intake.sent:,}")
    step("delay from sweep to client, 100 targets on radar alone")
    with running_demo(DEMO__SYNTHETIC_TARGETS="100", DEMO__REPORTS="false") as subject:
        time.sleep(SETTLE_S)
        cpu, begun = subject.cpu_seconds(), time.monotonic()
        delay = measure_delay(subject, seconds)
        cpu = (subject.cpu_seconds() - cpu) / (time.monotonic() - begun)
        dropped = subject.counters()["queue_dropped_blocks"]
        table.add_row("sweep to WebSocket client, p50", "", f"{1e3 * delay.p50_s:.0f} ms", f"{delay.tracks} tracks")
        table.add_row(
            "sweep to WebSocket client, p99", "150 ms", f"{1e3 * delay.p99_s:.0f} ms", f"{delay.updates} updates"
        )
        table.add_row("processor, with simulator", "", f"{cpu:.2f} cores", f"{dropped} blocks dropped")
        table.add_row("memory", "", f"{subject.resident_mib():.0f} MiB", "")
    step("200 clients, 300 targets")
    with running_demo(DEMO__SYNTHETIC_TARGETS="300", DEMO__REPORTS="true") as subject:
        time.sleep(SETTLE_S)
        load = measure_clients(subject, 200, seconds)
        per_client = f"{load.kilobytes_per_client_per_second:.0f} kB/s each"
        table.add_row(
            "200 clients at 1 Hz, messages a client",
            "1 a second",
            f"{load.messages_per_client_per_second:.2f}",
            per_client,
        )
        table.add_row(
            "processor, with simulator",
            "2 cores",
            f"{load.cpu_cores:.2f} cores",
            f"{load.blocks_dropped} blocks dropped",
        )
    return table
