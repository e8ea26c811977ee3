"""Changes of a radar's parts that come all at once."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

import pytest

from app.assembly import FRONT_END, build_parts, chain_of, parts_of
from app.contract import Refused
from app.runtime.front_end import FrontEndSwitch
from app.runtime.radar_worker import RadarWorker
from app.settings import Settings
from pipeline.chain import RadarChain
from pipeline.detect.hybrid import Hybrid
from tests.app.runtime.small_radar import small_site
from tests.support.running import until


def test_what_takes_over_while_a_change_is_asked_for_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    site = small_site()
    parts = build_parts(Settings(), FRONT_END)
    worker = RadarWorker(site, chain_of(site, 0, parts, None), 4, lambda _: True)
    switch = FrontEndSwitch(worker, 0, None, lambda _: None)
    other = {**parts, "detect": Hybrid(pfa=1e-5)}
    switch._next = other

    def taken_over(chain: RadarChain) -> dict[str, Any]:
        found = parts_of(chain)
        if switch._next is other:
            switch._next, worker.chain = None, chain_of(site, 0, other, None)
        return found

    monkeypatch.setattr("app.runtime.front_end.parts_of", taken_over)
    assert switch.choose({"extract": {"name": "manhattan", "min_cells": 2}}).running["detect"]["pfa"] == 1e-5


def test_changes_beyond_one_that_waits_are_refused_at_once() -> None:
    """Else a few clients would take every thread that answers requests."""
    site = small_site()
    worker = RadarWorker(site, chain_of(site, 0, build_parts(Settings(), FRONT_END), None), 4, lambda _: True)
    begun, go_on = threading.Semaphore(0), threading.Event()

    def compile(_: Mapping[str, Mapping[str, Any]]) -> None:
        begun.release()
        assert go_on.wait(30)

    switch = FrontEndSwitch(worker, 0, None, compile)
    threads = [
        threading.Thread(target=switch.choose, args=({"detect": {"name": "hybrid", "pfa": pfa}},), daemon=True)
        for pfa in (1e-4, 1e-5)
    ]
    threads[0].start()
    assert begun.acquire(timeout=30)
    threads[1].start()
    until(lambda: switch._room._value == 0, "the second waits")
    with pytest.raises(Refused, match="other changes"):
        switch.choose({"detect": {"name": "hybrid"}})
    go_on.set()
    for thread in threads:
        thread.join(30)
    assert switch.state().running["detect"]["pfa"] == 1e-5
    switch.choose({"detect": {"name": "hybrid", "pfa": 1e-3}})
    assert switch.state().running["detect"]["pfa"] == 1e-3
