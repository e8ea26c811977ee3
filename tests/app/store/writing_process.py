"""Records as fast as it can and prints what is committed, until it is killed."""

from __future__ import annotations

import sys

from app.store.store import Store
from pipeline.picture import AlertChange
from tests.support.fake_service import FakeService
from tests.support.running import settings_for_tests


def main() -> None:
    service = FakeService(targets=40)
    store = Store(sys.argv[1], settings_for_tests(), service.airport)
    store.start()
    alert = service.raise_alert(now=1_760_000_000.0)
    changes: tuple[AlertChange, ...] = tuple(service._changes)
    now = 1_760_000_000.0
    told = (0, 0)
    while True:
        now += 1.0
        store.record(service.step(now), changes)
        changes = (AlertChange("update", now, alert),)
        counters = store.writer_counters()
        if (counters["points"], counters["alert_changes"]) != told:
            told = (counters["points"], counters["alert_changes"])
            print(*told, flush=True)


if __name__ == "__main__":
    main()
