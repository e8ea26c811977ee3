"""The real service and the fake one, each with what a test needs to move it; for the suite that both must pass."""

from __future__ import annotations

import contextlib
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from app.contract import Service
from app.ingest.octets import encode_sweeps
from app.service import SurfaceService
from app.settings import LimitsSettings, NodeSettings, PartSettings, PartsSettings, RadarSettings, Settings
from pipeline.picture import Picture, SensorState
from pipeline.tables import TargetReports
from tests.app.runtime.small_radar import AZIMUTHS, RANGES, VIDEO
from tests.support.fake_service import FakeService
from tests.support.running import until
from tests.support.small_airport import as_geojson, small_airport
from tests.support.sweeps import sweeps_of

QUEUE = 64
"""Tables that the services here hold until the next picture."""

RUNWAY = "06/24"
HEARD, UNHEARD = "smr-1", "smr-2"
"""Radars of which one has sent a turn, the other nothing."""


class Rig(ABC):
    """A service with the radars HEARD and UNHEARD and one node, and what a test needs to move it."""

    service: Service

    @abstractmethod
    def next_picture(self) -> Picture:
        """A picture made after this call."""

    @abstractmethod
    def raise_alert(self) -> int:
        """The number of an alert that is live from now on."""

    @abstractmethod
    def clear_alert(self) -> None:
        """What raised the alert is over; a picture without it has been made."""

    @abstractmethod
    def stalled(self) -> contextlib.AbstractContextManager[None]:
        """Meanwhile nothing is taken out of the queues."""

    def sensor(self, id: str) -> SensorState:
        return next(one for one in self.service.sensors() if one.id == id)


def settings_here(folder: Path) -> Settings:
    radars = tuple(
        RadarSettings(
            id=id, latitude=48.72, longitude=2.38, azimuths=AZIMUTHS, ranges=RANGES, range_step_m=VIDEO.range_step_m,
            udp=None,
        )
        for id in (HEARD, UNHEARD)
    )  # fmt: skip
    node = NodeSettings(id="node-1", latitude=48.7183, longitude=2.3597, hold="hold-w1", runway=RUNWAY)
    return Settings(
        data_dir=folder, view3d=False, radars=radars, nodes=(node,), limits=LimitsSettings(rows_queued=QUEUE),
        parts=PartsSettings(detect=PartSettings(name="hybrid")),
    )  # fmt: skip


class RealRig(Rig):
    """The real service; the radar's turn is posted, the alert is an aircraft that rolls on a closed runway."""

    def __init__(self, folder: Path) -> None:
        airport = small_airport()
        self.real = SurfaceService(settings_here(folder), airport, as_geojson(airport))
        self.service = self.real
        self.real.prepare()
        self.real.checks["database"] = True
        self.real.start()
        site = self.real.radars[0]
        self.real.submit_sweeps(HEARD, encode_sweeps(sweeps_of(site), site))
        until(lambda: self.sensor(HEARD).counters["sweeps"] == AZIMUTHS, "the turn is worked on")

    def next_picture(self) -> Picture:
        made: list[Picture] = []
        end = self.real.listen(lambda picture, _: made.append(picture))
        until(lambda: len(made) > 0, "a picture is made")
        end()
        return made[0]

    def raise_alert(self) -> int:
        self.real.set_runway(RUNWAY, open=False, in_use=None, visibility=None)
        runway = self.real.airport.runways[0]
        (east, north), heading = runway.centreline.interpolate(600.0).coords[0], runway.ends[0].heading
        began = time.time() - 2.5
        for step in range(16):
            t = 0.25 * step
            report = TargetReports.build(
                1, time=began + t, address="39ab01", callsign="AFR1", category=1, on_ground=True, speed=30.0,
                course=heading, east=east + 30.0 * t * np.sin(heading), north=north + 30.0 * t * np.cos(heading),
            )  # fmt: skip
            self.real.submit_target_reports(report)
            picture = self.next_picture()
            if picture.alerts:
                return picture.alerts[0].id
        raise AssertionError("an aircraft rolls on a closed runway and no alert is raised")

    def clear_alert(self) -> None:
        self.real.set_runway(RUNWAY, open=True, in_use=None, visibility=None)
        until(lambda: not self.next_picture().alerts, "the alert is cleared")

    @contextlib.contextmanager
    def stalled(self) -> Iterator[None]:
        reached, go_on = threading.Event(), threading.Event()

        def hold(_picture: Picture, _changes: Any) -> None:
            reached.set()
            go_on.wait(20.0)

        end = self.real.listen(hold)
        try:
            assert reached.wait(20.0)
            yield
        finally:
            go_on.set()
            end()


class FakeRig(Rig):
    """The fake service; pictures are made when the test asks for them."""

    def __init__(self, folder: Path) -> None:
        self.fake = FakeService(settings_here(folder), targets=4)
        self.service = self.fake
        self.fake.step()

    def next_picture(self) -> Picture:
        return self.fake.step()

    def raise_alert(self) -> int:
        alert = self.fake.raise_alert()
        self.fake.step()
        return alert.id

    def clear_alert(self) -> None:
        for id in [one.id for one in self.fake.step().alerts]:
            self.fake.clear_alert(id)
        self.fake.step()

    def stalled(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()
