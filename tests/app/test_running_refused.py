"""The real service and a radar whose datagrams do not fit its settings: status, metrics, and sources that are two."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from app.api.application import create_app
from app.live.hub import Hub
from app.service import SurfaceService
from app.settings import PartSettings, PartsSettings, RadarSettings, Settings
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import encode_sweeps
from pipeline.picture import SensorState
from tests.app.runtime.small_radar import AZIMUTHS, RANGES, VIDEO
from tests.support.running import until
from tests.support.small_airport import as_geojson, small_airport

LIGHT = 299_792_458.0


class Running:
    """A service with one radar on a port of its own."""

    def __init__(self, folder: Path, **radar: Any) -> None:
        udp = UdpSettings(address="127.0.0.1", port=0, **radar.pop("udp", {}))
        settings = RadarSettings(
            id="smr-1", latitude=48.72, longitude=2.38, azimuths=AZIMUTHS, ranges=RANGES,
            range_step_m=VIDEO.range_step_m, blocks_per_scan=8, udp=udp, **radar,
        )  # fmt: skip
        parts = PartsSettings(detect=PartSettings(name="hybrid"))
        airport = small_airport()
        self.service = SurfaceService(
            Settings(data_dir=folder, view3d=False, radars=(settings,), parts=parts), airport, as_geojson(airport)
        )
        self.service.prepare()
        self.service.start()
        self.sent = 0

    def send(self, cells: int = RANGES, scale: float = 1.0, sics: tuple[int, ...] = (1,)) -> None:
        """A turn of each source, in turn."""
        edge = np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
        seconds = np.full(AZIMUTHS, time.time() % 86400)
        made = [
            encode_sweeps(
                np.full((AZIMUTHS, cells), 30, np.uint8), edge, edge + 2 * np.pi / AZIMUTHS, seconds, self.sent,
                sac=0, sic=sic, cell_duration_s=2 * scale * VIDEO.range_step_m / LIGHT,
            )
            for sic in sics
        ]  # fmt: skip
        with socket.socket(type=socket.SOCK_DGRAM) as out:
            for i in range(AZIMUTHS):
                for datagrams, lengths in made:
                    out.sendto(datagrams[i, : lengths[i]].tobytes(), ("127.0.0.1", self.service.video_port("smr-1")))
        self.sent += AZIMUTHS
        until(lambda: self.state().counters["datagrams"] >= self.sent * len(sics), "all have come")

    def state(self) -> SensorState:
        return next(one for one in self.service.sensors() if one.id == "smr-1")

    def refused(self) -> list[dict[str, str]]:
        """Labels of the metric."""
        app = create_app(self.service, hub=Hub(self.service, self.service.settings), store=None)

        async def ask() -> str:
            async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
                return (await client.get("/metrics")).text

        found = {one.name: one for one in text_string_to_metric_families(asyncio.run(ask()))}
        return [one.labels for one in found["airside_sensor_refused"].samples if one.value == 1]


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    made: list[Running] = []

    def make(**radar: Any) -> Running:
        made.append(Running(tmp_path, **radar))
        return made[-1]

    yield make
    for one in made:
        one.service.stop()


def test_a_radar_of_other_cells_says_so_everywhere(
    running: Callable[..., Running], caplog: pytest.LogCaptureFixture
) -> None:
    radar = running()
    assert (radar.state().status, radar.refused()) == ("waiting", [])
    radar.send(cells=RANGES - 9, scale=1.5)
    until(lambda: radar.state().detail != "", "it is told")
    step = VIDEO.range_step_m
    why = f"refused: cells {RANGES - 9}, settings say {RANGES}; cells of {1.5 * step:.4g} m, settings say {step:.4g} m"
    assert (radar.state().status, radar.state().detail) == ("degraded", why)
    assert radar.refused() == [{"sensor": "smr-1", "reason": why}]
    (logged,) = [text for text in map(logging.LogRecord.getMessage, caplog.records) if "messages refused" in text]
    assert logged.endswith(why)


def test_the_setting_to_resample_takes_them(running: Callable[..., Running]) -> None:
    radar = running(resample=True)
    radar.send(cells=RANGES - 9, scale=1.5)
    radar.send(cells=RANGES - 9, scale=1.5)
    until(lambda: radar.state().counters["sweeps"] >= AZIMUTHS, "a turn is worked on")
    assert radar.state().counters["wrong_geometry"] == 0
    assert radar.refused() == []


def test_another_source_than_the_wanted_is_named(running: Callable[..., Running]) -> None:
    radar = running(udp={"sac": 5, "sic": 7})
    radar.send()
    until(lambda: radar.state().detail != "", "it is told")
    assert radar.state().detail == "refused: SAC 0 SIC 1, settings say SAC 5 SIC 7"


def test_two_sources_on_one_port_are_named_and_one_is_taken(running: Callable[..., Running]) -> None:
    radar = running()
    radar.send(sics=(1, 2))
    radar.send(sics=(1, 2))
    until(lambda: radar.state().counters["wrong_source"] == 2 * AZIMUTHS, "the second is counted")
    assert radar.state().counters["lost"] == radar.state().counters["restart"] == 0
    until(lambda: "SAC 0 SIC 1 and SAC 0 SIC 2" in radar.state().detail, "both are named")
    assert radar.state().status == "degraded"
    assert radar.refused() == []
