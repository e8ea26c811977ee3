"""Wrong clocks at the real service: one report or event of another time, a radar whose clock steps, a leap second."""

from __future__ import annotations

import asyncio
import re
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.api.application import create_app
from app.ingest.octets import encode_sweeps
from app.live.hub import Hub
from app.runtime.host_clock import HostClock
from app.service import SurfaceService
from app.settings import NodeSettings, PartSettings, PartsSettings, RadarSettings, Settings
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import encode_sweeps as encode_datagrams
from pipeline.picture import AlertChange, Picture, SensorState
from pipeline.tables import TargetReports, TrackPhase
from tests.app.runtime.small_radar import AZIMUTHS, RANGES, T0, VIDEO, small_site, turn
from tests.support.running import until
from tests.support.small_airport import as_geojson, small_airport

YEAR_2099 = 4_085_000_000.0
LIGHT = 299_792_458.0


def radar_settings(**values: Any) -> RadarSettings:
    return RadarSettings(
        **{
            "id": "smr-1", "latitude": 48.72, "longitude": 2.38, "azimuths": AZIMUTHS, "ranges": RANGES,
            "range_step_m": VIDEO.range_step_m, "blocks_per_scan": 8, "udp": None, **values,
        }
    )  # fmt: skip


class Running:
    """A service, and the web application before it."""

    def __init__(self, folder: Path, *radars: RadarSettings, clock: HostClock | None = None) -> None:
        parts = PartsSettings(detect=PartSettings(name="hybrid"))
        node = NodeSettings(id="N1", latitude=48.7233, longitude=2.3794)
        settings = Settings(data_dir=folder, view3d=False, radars=radars, nodes=(node,), parts=parts)
        airport = small_airport()
        self.service = SurfaceService(settings, airport, as_geojson(airport), clock)
        self.stored: list[float] = []
        self.service.keep_node_events = lambda events: self.stored.extend(events.time.tolist())
        self.service.prepare()
        self.service.start()
        self.application = create_app(self.service, hub=Hub(self.service, self.service.settings), store=None)

    def ask(self, method: str, path: str, **words: Any) -> httpx.Response:
        transport = httpx.ASGITransport(self.application)

        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
                return await client.request(method, "/api/v1" + path, **words)

        return asyncio.run(ask())

    def sensor(self, id: str) -> SensorState:
        return next(one for one in self.service.sensors() if one.id == id)

    def time(self) -> float:
        picture = self.service.picture()
        return picture.time if picture is not None else 0.0

    def tracks(self) -> int:
        picture = self.service.picture()
        return len(picture.tracks) if picture is not None else 0


@pytest.fixture(params=["with a radar", "without"])
def running(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Running]:
    made = Running(tmp_path, *([radar_settings()] if request.param == "with a radar" else []))
    if made.service.radars:
        now = time.time()
        for block in turn(0):
            sent = replace(block, time=block.time - T0 + now - 1.0)
            made.service.submit_sweeps("smr-1", encode_sweeps(sent, small_site()))
        until(lambda: made.sensor("smr-1").counters["sweeps"] == AZIMUTHS, "the turn is worked on")
    yield made
    made.service.stop()


PLACE = {"reports": ("/targets/reports", {"lat": 48.7233, "lon": 2.3794, "address": "39abcd"}),
         "nodes": ("/nodes/events", {"node": "N1", "speed_mps": 8.0})}  # fmt: skip


@pytest.mark.parametrize("kind", ["reports", "nodes"])
@pytest.mark.parametrize(
    ("wrong", "reason", "words"),
    [
        (lambda now: now + 3600.0, "ahead", r"3,(600|59\d) s ahead of this host: local time\?"),
        (lambda now: YEAR_2099, "ahead", "years ahead of this host"),
        (lambda now: now + 18.0, "ahead", r"1[78] s ahead of this host: GPS time\?"),
        (lambda now: 4711.0, "behind", r"counts from its own start\?"),
    ],
    ids=["+1 h", "2099", "+18 s", "uptime"],
)
def test_one_datum_of_another_time_is_refused_and_changes_nothing_else(
    running: Running, kind: str, wrong: Callable[[float], float], reason: str, words: str
) -> None:
    path, row = PLACE[kind]
    now = time.time()
    answer = running.ask("POST", path, json={**row, "time": wrong(now)})
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert re.search(words, answer.json()["detail"])
    state = running.sensor(kind)
    assert state.status == "degraded"
    assert f"1 {'report' if kind == 'reports' else 'event'} {reason} " in state.detail
    assert "refused" in state.detail
    assert state.counters[f"refused_{reason}"] == 1
    assert state.clock_offset_s == pytest.approx(wrong(now) - now, abs=5.0)
    assert all(one.status != "degraded" for one in running.service.sensors() if one.id != kind)

    answer = running.ask("POST", path, json=[{**row, "time": time.time()}, {**row, "time": wrong(now)}])
    told = answer.json()
    assert (answer.status_code, told["taken"], told[f"refused_{reason}"]) == (200, 1, 1)
    assert [(one["index"], one["reason"]) for one in told["errors"]] == [(1, reason)]
    good = time.time()
    assert running.ask("POST", path, json={**row, "time": good}).json() == {"taken": 1}
    # ticks alone may have brought the picture to this time before the good one was worked on
    until(
        lambda: (
            running.time() >= good - 0.001 and (running.tracks() > 0 if kind == "reports" else len(running.stored) > 1)
        ),
        "the good one is in the picture",
    )
    assert running.time() <= time.time() + 0.2
    assert running.sensor(kind).counters["taken"] == 2
    picture = running.service.picture()
    assert picture is not None
    assert len(picture.tracks) >= (1 if kind == "reports" else 0)
    assert all(abs(one - now) < 60 for one in running.stored)
    assert len(running.stored) == (2 if kind == "nodes" else 0)
    metrics = running.service.sensors()
    (offset,) = (one.clock_offset_s for one in metrics if one.id == kind)
    assert offset == pytest.approx(0.0, abs=5.0), "not the refused one's, which is 18 s at least"


def test_a_clock_0_7_s_ahead_is_corrected_and_shown(running: Running) -> None:
    path, row = PLACE["reports"]
    for _ in range(3):
        assert running.ask("POST", path, json={**row, "time": time.time() + 0.7}).json() == {"taken": 1}
    state = running.sensor("reports")
    assert state.status == "ok"
    assert state.clock_offset_s == pytest.approx(0.7, abs=0.3)
    assert state.last is not None
    assert state.last <= time.time()


class Standing:
    """UTC that goes on when the test says so."""

    now = 1.8e9

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize("going_on", ["refused", "silent"])
def test_tracks_coast_and_end_and_alerts_clear_though_nothing_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, going_on: str
) -> None:
    """An airliner on a closed runway, then only reports of a wrong time, or none; then good ones again."""
    monkeypatch.setattr("app.runtime.surface_worker.TICK_S", 0.02)
    monkeypatch.setattr("app.runtime.feeds.SENSOR_SILENT_S", 0.5)
    clock = Standing()
    running = Running(tmp_path, clock=HostClock(clock, clock))
    try:
        changes: list[AlertChange] = []
        running.service.listen(lambda _, more: changes.extend(more))
        latitude, longitude = running.service.airport.frame.to_geodetic(-100.0, 50.0)
        airliner = {"lat": float(latitude), "lon": float(longitude), "address": "39abcd", "callsign": "AFR12",
                    "speed_mps": 0.0, "category": "aircraft"}  # fmt: skip

        def picture() -> Picture:
            made = running.service.picture()
            assert made is not None
            return made

        def second(offset: float | None) -> int:
            """A second passes, with a report at its end; its status."""
            clock.now += 1.0
            answer = 0
            if offset is not None:
                sent = {**airliner, "time": clock.now + offset}
                answer = running.ask("POST", "/targets/reports", json=sent).status_code
            until(lambda: running.time() >= clock.now - 1.0, "time goes on")
            return answer

        assert running.ask("PUT", "/runways/06/24/state", json={"open": False}).status_code == 200
        for _ in range(12):
            assert second(0.0) == 200
        until(lambda: len(picture().alerts) == 1, "the alert is raised")
        (alert,) = picture().alerts
        until(lambda: running.service._running.engine.sensors_degraded, "the reports are called silent")
        phases = []
        for _ in range(60):
            assert second(3600.0 if going_on == "refused" else None) in (0, 422)
            phases += picture().tracks.phase.tolist()
        until(lambda: not len(picture().tracks) and not picture().alerts, "track and alert are over")
        assert TrackPhase.COASTING in phases
        assert clock.now - 1.0 <= picture().time <= clock.now
        cleared = changes[-1].alert
        assert (cleared.id, cleared.clear_reason) == (alert.id, "sensor lost")
        assert cleared.cleared_at is not None
        assert clock.now - 60.0 < cleared.cleared_at < clock.now
        if going_on == "refused":
            state = running.sensor("reports")
            assert (state.status, state.counters["taken"], state.counters["refused_ahead"]) == ("degraded", 12, 60)
        for _ in range(12):
            assert second(0.0) == 200
        until(lambda: len(picture().tracks) == 1 and len(picture().alerts) == 1, "it goes on")
        assert picture().alerts[0].id == alert.id + 1
    finally:
        running.service.stop()


class Turning(Running):
    """With a radar that is posted to, and a host whose clock goes with its turns."""

    def __init__(self, folder: Path) -> None:
        self.now, self.host_wrong = T0, 0.0
        clock = HostClock(lambda: self.now + self.host_wrong, lambda: self.now)
        super().__init__(folder, radar_settings(), clock=clock)
        self.scan = 0

    def turns(self, many: int, wrong: float = 0.0) -> None:
        for _ in range(many):
            for block in turn(self.scan):
                self.now = float(block.time[-1])
                sent = replace(block, time=block.time + wrong)
                self.service.submit_sweeps("smr-1", encode_sweeps(sent, small_site()))
            self.scan += 1
            done = self.scan * AZIMUTHS
            until(lambda done=done: self.sensor("smr-1").counters["sweeps"] == done, "the turn is worked on")


@pytest.mark.parametrize("step", [3600.0, -3600.0, -T0], ids=["+1 h", "-1 h", "1970"])
def test_a_radar_whose_clock_steps_goes_on_and_says_so(tmp_path: Path, step: float) -> None:
    running = Turning(tmp_path)
    try:
        running.turns(5)
        assert running.sensor("smr-1").status == "ok"
        for wrong in (step, 0.0):
            running.turns(2, wrong)
            # the worker counts the sweeps of a block before it notes its time
            until(lambda: running.sensor("smr-1").last == pytest.approx(running.now, abs=0.05), "the time is right")
            state = running.sensor("smr-1")
            assert state.status == "degraded"
            assert f"clock stepped {'+' if (step > 0) == (wrong == step) else '-'}" in state.detail
            assert state.clock_offset_s == pytest.approx(wrong, abs=0.05)
            assert not running.service._running.engine.sensors_degraded, "what is corrected holds no alert back"
            until(lambda: running.time() > running.now - 0.2, "the picture goes on")
            running.turns(6, wrong)
            assert running.sensor("smr-1").counters["block_failures"] == 0
        running.turns(25)
        assert (running.sensor("smr-1").status, running.sensor("smr-1").detail) == ("ok", "")
        assert running.sensor("smr-1").counters["time_rebased"] == 2
        surface = running.service._surface
        assert surface is not None
        assert surface.engine.tracker.counters.get("sector_late", 0) == 0
    finally:
        running.service.stop()


@pytest.mark.parametrize("step", [3600.0, -3600.0])
def test_when_the_clock_of_the_host_is_set_the_picture_goes_with_it_once(tmp_path: Path, step: float) -> None:
    running = Turning(tmp_path)
    try:
        running.turns(4)
        for wrong in (step, 0.0):
            running.host_wrong = wrong
            running.turns(4)
            until(lambda wrong=wrong: abs(running.now + wrong - running.time()) < 0.3, "the picture goes on")
            counters = running.service._running.engine.counters
            lost = sum(counters.get(f"sector_{why}", 0) for why in ("late", "ahead"))
            assert lost <= 2 * 8, "a turn at each step at most"
    finally:
        running.service.stop()


def test_a_leap_second_at_midnight_loses_no_sweep_over_udp(tmp_path: Path) -> None:
    """Half a second before midnight to a second after, 23:59:60 between, with a host that is set back as well."""
    period, day = 0.25, 86400.0
    begun: float | None = None
    midnight = 20_001 * day

    def utc() -> float:
        if begun is None:
            return midnight - 3600.0  # while it starts; then it is set
        passed = time.monotonic() - begun
        return midnight - 0.5 + passed - (1.0 if passed > 1.5 else 0.0)

    radar = radar_settings(period_s=period, udp=UdpSettings(address="127.0.0.1", port=0))
    running = Running(tmp_path, radar, clock=HostClock(utc))
    try:
        port = running.service.video_port("smr-1")
        begun = time.monotonic()
        total = 10 * AZIMUTHS
        rows = np.arange(total)
        passed = rows * period / AZIMUTHS
        shown = np.where(passed < 0.5, day - 0.5 + passed, np.where(passed < 1.5, day + passed - 0.5, passed - 1.5))
        shown = np.floor(shown * 128) / 128
        start = rows * 2 * np.pi / AZIMUTHS
        datagrams, lengths = encode_datagrams(
            np.full((total, RANGES), 30, np.uint8), start, start + 2 * np.pi / AZIMUTHS, shown, 1, sac=0, sic=1,
            cell_duration_s=2 * VIDEO.range_step_m / LIGHT,
        )  # fmt: skip
        with socket.socket(type=socket.SOCK_DGRAM) as out:
            for i in range(total):
                wait = begun + passed[i] - time.monotonic()
                if wait > 0:
                    time.sleep(wait)
                out.sendto(datagrams[i, : lengths[i]].tobytes(), ("127.0.0.1", port))
        until(lambda: running.sensor("smr-1").counters["sweeps"] == total, "every sweep is taken")
        state = running.sensor("smr-1")
        assert state.counters["lost"] == state.counters["late"] == state.counters["azimuth_backwards"] == 0
        assert state.last is not None
        until(lambda: abs(running.sensor("smr-1").last - running.service.clock.now()) < 1.5, "near arrival")  # type: ignore[operator]
    finally:
        running.service.stop()


def test_without_a_radar_silent_reports_make_the_picture_degraded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = Running(tmp_path)
    try:
        engine = running.service._running.engine
        path, row = PLACE["reports"]
        assert running.ask("POST", path, json={**row, "time": time.time()}).status_code == 200
        until(lambda: running.time() > 0, "the report is taken")
        assert not engine.sensors_degraded
        monkeypatch.setattr("app.runtime.feeds.SENSOR_SILENT_S", 0.2)
        wrong = {**row, "time": time.time() + 3600}
        until(
            lambda: running.ask("POST", path, json=wrong).status_code == 422 and engine.sensors_degraded,
            "nothing was accepted any more",
        )
        assert running.sensor("reports").status == "degraded"
        monkeypatch.setattr("app.runtime.feeds.SENSOR_SILENT_S", 10.0)
        assert running.ask("POST", path, json={**row, "time": time.time()}).status_code == 200
        until(lambda: not engine.sensors_degraded, "it is well again")
    finally:
        running.service.stop()


def test_reports_from_several_threads_are_all_counted(tmp_path: Path) -> None:
    running = Running(tmp_path)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        now = running.service.clock.now()
        one = TargetReports.build(1, time=now, east=0.0, north=0.0, address="39abcd")

        def send() -> None:
            for _ in range(100):
                running.service.submit_target_reports(one)

        senders = [threading.Thread(target=send) for _ in range(8)]
        for sender in senders:
            sender.start()
        for sender in senders:
            sender.join()
        assert running.sensor("reports").counters["taken"] == 800
    finally:
        sys.setswitchinterval(interval)
        running.service.stop()
