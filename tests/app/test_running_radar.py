"""The real service with one small radar whose sweeps are posted: a storm, a change of parts, a restart."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.api.application import create_app
from app.contract import Refused
from app.ingest.octets import encode_sweeps
from app.live.hub import Hub
from app.runtime.host_clock import HostClock
from app.service import SurfaceService
from app.settings import PartSettings, PartsSettings, RadarSettings, Settings
from pipeline.picture import SensorState
from tests.app.runtime.small_radar import AZIMUTHS, RANGES, T0, VIDEO, small_site, turn
from tests.support.running import until
from tests.support.small_airport import as_geojson, small_airport


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


class Radar:
    """A service and the radar that is posted to it."""

    def __init__(self, folder: Path, detect: PartSettings) -> None:
        radar = RadarSettings(
            id="smr-1", latitude=48.72, longitude=2.38, azimuths=AZIMUTHS, ranges=RANGES,
            range_step_m=VIDEO.range_step_m, blocks_per_scan=8, udp=None,
        )  # fmt: skip
        settings = Settings(data_dir=folder, view3d=False, radars=(radar,), parts=PartsSettings(detect=detect))
        airport = small_airport()
        self.now = T0
        host = HostClock(lambda: self.now, lambda: self.now)
        self.service = SurfaceService(settings, airport, as_geojson(airport), host)
        self.service.prepare()
        self.service.start()
        self.scan = 0
        self.clock = Clock()
        self.service._workers["smr-1"].cuts._clock = self.clock

    def turns(self, many: int, **how: Any) -> int:
        """Post so many turns; the plots that came of them."""
        before = self.state().counters["plots"]
        for _ in range(many):
            for block in turn(self.scan, **how):
                self.now = float(block.time[-1])
                self.service.submit_sweeps("smr-1", encode_sweeps(block, small_site()))
            self.scan += 1
            until(lambda: self.state().counters["sweeps"] == self.scan * AZIMUTHS, "the turn is worked on")
        return self.state().counters["plots"] - before

    def state(self) -> SensorState:
        return next(one for one in self.service.sensors() if one.id == "smr-1")

    def get(self, path: str) -> httpx.Response:
        """What the web application answers."""
        app = create_app(self.service, hub=Hub(self.service, self.service.settings), store=None)

        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
                return await client.get(path)

        return asyncio.run(ask())


@pytest.fixture
def radar(tmp_path: Path) -> Iterator[Radar]:
    made = Radar(tmp_path, PartSettings(name="hybrid", max_runs=200))  # type: ignore[call-arg]
    yield made
    made.service.stop()


def test_a_storm_is_seen_everywhere_and_passes(radar: Radar) -> None:
    radar.turns(3)
    assert radar.state().status == "ok"
    radar.turns(2, storm=True)
    state = radar.state()
    assert state.status == "degraded"
    assert state.detail.startswith("detections cut, ")
    assert state.detail.endswith(" sweeps in the last 10 s")
    assert state.counters["degraded_blocks"] > 0
    told = next(one for one in radar.get("/api/v1/sensors").json()["sensors"] if one["id"] == "smr-1")
    assert (told["status"], told["detail"]) == ("degraded", state.detail)
    assert told["parts"]["detect"] == "hybrid"
    metrics = radar.get("/metrics").text
    assert 'airside_sensor_status{sensor="smr-1",status="degraded"} 1.0' in metrics
    assert f'reason="degraded_sweeps",sensor="smr-1"}} {float(state.counters["degraded_sweeps"])}' in metrics
    surface = radar.service._surface
    assert surface is not None
    until(lambda: surface.engine.sensors_degraded, "the alert rules know")
    assert radar.service.front_end("smr-1").cut["degraded_sweeps"] == state.counters["degraded_sweeps"]
    radar.clock.now += 10.1
    radar.turns(2)
    assert (radar.state().status, radar.state().detail) == ("ok", "")
    assert radar.service.front_end("smr-1").cut == {}


def test_parts_change_while_sweeps_flow(radar: Radar, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    radar.turns(3)
    answer = radar.service.choose_parts("smr-1", {"detect": {"name": "adaptive", "learn_scans": 3}})
    assert answer.running["detect"]["name"] == "hybrid"
    assert answer.next is not None
    assert answer.next["detect"]["learn_scans"] == 3
    assert answer.scans_left == 3
    assert radar.state().detail == "detect adaptive learning, 3 turns to go"
    assert radar.state().parts == {**radar.state().parts, "detect": "hybrid"}
    assert all(radar.turns(1) >= 2 for _ in range(6)), "no turn without plots"
    answer = radar.service.front_end("smr-1")
    assert (answer.running["detect"]["name"], answer.next, answer.scans_left) == ("adaptive", None, None)
    assert answer.ms_a_turn.keys() >= {"detect", "extract"}
    assert radar.state().parts["detect"] == "adaptive"
    assert radar.state().counters["sweeps"] == 9 * AZIMUTHS
    assert "smr-1: detect adaptive in place of detect hybrid: Adaptive(" in caplog.text


def test_tracks_tell_the_radar_how_their_targets_point(radar: Radar) -> None:
    told: list[Any] = []
    radar.service._workers["smr-1"].chain.expect = lambda *columns: told.append(columns)  # type: ignore[method-assign]
    radar.turns(1)
    until(lambda: radar.service._workers["smr-1"]._expected is not None, "a picture tells what to expect")
    radar.turns(1)
    assert told
    assert all(len(columns) == 4 for columns in told)


def test_a_change_is_taken_back_by_asking_for_what_runs(radar: Radar) -> None:
    radar.turns(3)
    running = radar.service.front_end("smr-1").running
    radar.service.choose_parts("smr-1", {"detect": {"name": "adaptive"}})
    answer = radar.service.choose_parts("smr-1", running)
    assert (answer.running, answer.next) == (running, None)
    radar.turns(2)
    assert radar.service.front_end("smr-1").running == running


def test_a_restart_does_not_learn_again(tmp_path: Path) -> None:
    first = Radar(tmp_path, PartSettings(name="adaptive"))
    with pytest.raises(Refused, match="not been heard"):
        first.service.video("smr-1")
    assert first.turns(12) == 0
    assert first.turns(3) >= 6
    first.service.stop()
    second = Radar(tmp_path, PartSettings(name="adaptive"))
    assert second.state().counters["states_resumed"] == 1
    assert second.turns(2) >= 4
    second.service.stop()
    assert second.state().counters["states_saved"] == 1
    other = Radar(tmp_path, PartSettings(name="adaptive", pfa=1e-5))  # type: ignore[call-arg]
    assert other.state().counters["states_resumed"] == 0
    assert other.turns(2) == 0
    other.service.stop()
