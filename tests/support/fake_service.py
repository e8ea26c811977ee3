"""A service without a pipeline: synthetic aircraft and vehicles, one alert that comes and goes, sensors, runways.

Run it for work on the displays: `python -m tests.support.fake_service --port 8123 --targets 50`.
"""

from __future__ import annotations

import argparse
import contextlib
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.assembly import FRONT_END, build_parts, chain_of
from app.contract import (
    FrontEnd,
    PictureListener,
    Readiness,
    Refused,
    RefusedTime,
    ReplayControl,
    Submitted,
    UnknownId,
    Video,
)
from app.ingest.octets import OctetIntake
from app.runtime.clocks import FeedTimes
from app.runtime.front_end import FrontEndSwitch
from app.runtime.radar_worker import RadarWorker, Turn
from app.settings import RadarSettings, Settings
from pipeline.airport.model import Airport
from pipeline.picture import Alert, AlertChange, AlertTarget, Picture, RunwayState, SensorState, Visibility
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, Sweeps, TargetReports, Tracks, VideoFormat
from tests.support.fake_replay import FakeReplay
from tests.support.fake_traffic import Mover, lines_of, synthetic_tracks
from tests.support.small_airport import as_geojson, small_airport

ALERT_EVERY_S = 40.0
ALERT_FOR_S = 22.0


def parts_on(site: RadarSite, index: int) -> FrontEndSwitch:
    """The real parts of a radar that never turns, with the figures of a turn."""
    chain = chain_of(site, index, build_parts(Settings(), FRONT_END), None)
    worker = RadarWorker(site, chain, 4, lambda _: True)
    worker.turn = Turn(7, 214, {"keep": 0.0012, "detect": 0.0184, "extract": 0.0031})
    return FrontEndSwitch(worker, index, None, compile=lambda _: None)


class FakeService:
    """Implements `app.contract.Service`; `start` moves the targets in a thread at `rate_hz` pictures a second.

    ready: False as while a service starts, when it takes nothing. What is submitted lies in node_events, target_reports
    and sweeps; between two pictures as many tables are taken as `limits.rows_queued` allows.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        targets: int = 12,
        rate_hz: float = 4.0,
        airport: Airport | None = None,
        geojson: dict[str, Any] | None = None,
        seed: int = 1,
        replay: FakeReplay | None = None,
    ) -> None:
        self.settings = settings or Settings(
            mode="demo" if replay is None else "replay",
            radars=(RadarSettings(id="smr-1", latitude=48.72, longitude=2.38),),
        )
        self.airport = airport or small_airport()
        self.airport_geojson = geojson or as_geojson(self.airport)
        self.radars = (
            RadarSite(
                "smr-1", 0.0, 0.0, 22.0, VideoFormat(azimuths=1024, ranges=512, range_step_m=6.0), simulated=True
            ),
            RadarSite("smr-2", 500.0, 0.0, 22.0, VideoFormat(azimuths=1024, ranges=512, range_step_m=6.0)),
        )
        self._switches = {site.id: parts_on(site, index) for index, site in enumerate(self.radars)}
        self.cut: dict[str, str] = {}
        self.nodes = (NodeSite("node-1", -1450.0, -560.0, 2.6, hold="hold-w1", runway="06/24", simulated=True),)
        self.replay: ReplayControl | None = replay
        self._recording = replay
        self.rate_hz = rate_hz
        self.node_events: list[NodeEvents] = []
        self.target_reports: list[TargetReports] = []
        self.sweeps: list[Sweeps] = []
        self.bad_rows: dict[str, Counter[str]] = {"nodes": Counter(), "reports": Counter()}
        self._times = {
            "nodes": FeedTimes("event", self.settings.clocks.nodes, [one.id for one in self.nodes]),
            "reports": FeedTimes("report", self.settings.clocks.reports),
        }
        self._octets = {site.id: OctetIntake(site, index) for index, site in enumerate(self.radars)}
        self._waiting = 0
        self.ready = True
        self.runways = {
            one.id: RunwayState(one.id, in_use=one.ends[0].designator if i == 0 else None)
            for i, one in enumerate(self.airport.runways)
        }
        self._listeners: list[PictureListener] = []
        self._lock = threading.RLock()
        self._newest: Picture | None = None
        self._alerts: dict[int, Alert] = {}
        self._changes: list[AlertChange] = []
        self._next_alert = 1
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._began = 0.0 if replay is None else replay.begin
        self._rng = np.random.default_rng(seed)
        self.movers = self._populate(targets)
        if replay is not None:
            replay.on_seek.append(self._wind)

    def _populate(self, targets: int) -> list[Mover]:
        lines = lines_of(self.airport, self._rng)
        movers = []
        for i in range(targets):
            if i < len(self.airport.runways):
                points, speed = np.asarray(self.airport.runways[i].centreline.coords), 65.0
            else:
                points, speed = lines[i % len(lines)], float(self._rng.uniform(3, 14)) if i % 5 else 0.0
            movers.append(Mover(points, speed, float(self._rng.uniform(0, 4000))))
        return movers

    def clock(self) -> float:
        """UTC s: of the recording when one is replayed."""
        return time.time() if self._recording is None else self._recording.time()

    def still(self) -> bool:
        """A replay is paused and its picture is made: there is nothing to show that is not shown."""
        return self._recording is not None and self._newest is not None and self._newest.time == self.clock()

    def _wind(self) -> None:
        """Nothing of before the seek is left."""
        with self._lock:
            self._alerts.clear()
            self._changes.clear()
            self._newest = None

    def step(self, now: float | None = None) -> Picture:
        """Make the next picture and tell the listeners."""
        now = self.clock() if now is None else now
        with self._lock:
            self._began = self._began or now
            tracks = synthetic_tracks(self.movers, self.airport, self._began, now)
            self._script_alert(tracks, now)
            picture = Picture(
                time=now,
                tracks=tracks,
                alerts=tuple(self._alerts.values()),
                runways=tuple(self.runways.values()),
                sensors=self.sensors(),
                timings={"detect": 0.0011, "extract": 0.0004, "track": 0.0006},
            )
            self._newest = picture
            self._waiting = 0
            changes, self._changes = tuple(self._changes), []
            listeners = tuple(self._listeners)
        for listener in listeners:
            listener(picture, changes)
        return picture

    def raise_alert(self, text: str = "Vehicle passed holding point W1", now: float | None = None) -> Alert:
        """Put an alert into the next picture."""
        now = self.clock() if now is None else now
        with self._lock:
            runway = self.airport.runways[0]
            targets = tuple(
                AlertTarget(
                    i + 1,
                    f"AFR10{i}" if i == 0 else None,
                    f"39000{i}",
                    "aircraft" if i == 0 else "vehicle",
                    10.0 * i,
                    5.0,
                    30.0,
                    0.5,
                )
                for i in range(2)
            )
            alert = Alert(
                self._next_alert, "hold_entry", "information", "new", text, now, now, targets, runway=runway.id,
                holding_point="W1", time_to_threshold=21.5, distance_to_threshold=1400.0, separation=900.0,
                conflict_position=(0.0, 0.0), sensors=("smr-1",), simulated=True, cat004_type=5, cat011_type=1,
            )  # fmt: skip
            self._next_alert += 1
            self._change("raise", alert, now)
            return alert

    def update_alert(self, id: int, now: float | None = None, **values: Any) -> Alert:
        """Change a live alert."""
        now = self.clock() if now is None else now
        with self._lock:
            alert = replace(self._alerts[id], updated_at=now, **values)
            self._change("update", alert, now)
            return alert

    def clear_alert(self, id: int, reason: str = "runway vacated", now: float | None = None) -> Alert:
        """Clear a live alert."""
        now = self.clock() if now is None else now
        with self._lock:
            alert = replace(self._alerts[id], state="cleared", cleared_at=now, clear_reason=reason, updated_at=now)
            self._change("clear", alert, now)
            return alert

    def _change(self, operation: Any, alert: Alert, now: float) -> None:
        self._changes.append(AlertChange(operation, now, alert))
        if alert.state == "cleared":
            self._alerts.pop(alert.id, None)
        else:
            self._alerts[alert.id] = alert

    def _script_alert(self, tracks: Tracks, now: float) -> None:
        if self._thread is None:
            return
        phase = (now - self._began) % ALERT_EVERY_S
        live = next(iter(self._alerts.values()), None)
        if live is None and 3.0 < phase < ALERT_FOR_S:
            self.raise_alert(now=now)
        elif live is not None and phase >= ALERT_FOR_S:
            self.clear_alert(live.id, now=now)
        elif live is not None and live.stage == "information" and phase > 8.0:
            self.update_alert(live.id, now=now, stage="alarm", state="ongoing")

    def start(self) -> None:
        """Move in a thread."""
        self._began = self._began or time.time()
        self._thread = threading.Thread(target=self._run, name="fake-surface", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stand still."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(5.0)

    def _run(self) -> None:
        while not self._stop.wait(1.0 / self.rate_hz):
            if not self.still():
                self.step()

    def readiness(self) -> Readiness:
        return Readiness({"database": True, "warm": self.ready, "picture": self.ready and self._newest is not None})

    def picture(self) -> Picture | None:
        return self._newest

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        self._listeners.append(listener)

        def end() -> None:
            with contextlib.suppress(ValueError):
                self._listeners.remove(listener)

        return end

    def sensors(self) -> tuple[SensorState, ...]:
        now = self.clock()
        events, reports = (sum(map(len, tables)) for tables in (self.node_events, self.target_reports))
        heard = SensorState("reports", "report", "ok", now, counters={"taken": reports, **self._bad("reports")})
        others = (
            self._times["nodes"].shown(
                SensorState("nodes", "node", "ok", now, True, counters={"taken": 7 + events, **self._bad("nodes")})
            ),
        )
        if reports or self._times["reports"].has_refused or self.bad_rows["reports"]:
            others += (self._times["reports"].shown(heard),)
        return (
            SensorState(
                "smr-1", "radar", "degraded" if "smr-1" in self.cut else "ok", now, True, self.cut.get("smr-1", ""),
                counters={"sweeps": 4096, "lost": 3, "duplicate": 0, "late": 1}, parts=self._switches["smr-1"].names,
            ),
            SensorState(
                "smr-2", "radar", "silent", now - 60, False, "nothing heard for 60 s", {"sweeps": 10},
                self._switches["smr-2"].names,
            ),
            *others,
        )  # fmt: skip

    def _bad(self, feed: str) -> dict[str, int]:
        return {f"refused_{reason}": count for reason, count in self.bad_rows[feed].items()}

    def video(self, radar: str) -> Video:
        site = next((one for one in self.radars if one.id == radar), None)
        if site is None:
            raise UnknownId(radar)
        if radar == "smr-2" or not self.ready:
            raise Refused("radar smr-2 has not been heard yet")
        rng = np.random.default_rng(int(time.time()))
        amplitude = rng.rayleigh(14.0, (site.video.azimuths, site.video.ranges)).clip(0, 255).astype(np.uint8)
        picture = self._newest
        if picture is not None:
            east, north = picture.tracks.state[:, 0], picture.tracks.state[:, 1]
            rows = (np.mod(np.arctan2(east, north), 2 * np.pi) / site.video.azimuth_step_rad).astype(int)
            cells = (np.hypot(east, north) / site.video.range_step_m).astype(int)
            for row, cell in zip(rows.tolist(), cells.tolist(), strict=True):
                if cell < site.video.ranges - 4:
                    amplitude[(row + np.arange(-3, 4)) % site.video.azimuths, cell - 3 : cell + 4] = 220
        return Video(site, amplitude, picture.time if picture else 0.0)

    def front_end(self, radar: str) -> FrontEnd:
        return self._switch(radar).state()

    def choose_parts(self, radar: str, wanted: Mapping[str, Mapping[str, Any]]) -> FrontEnd:
        return self._switch(radar).choose(wanted)

    def _switch(self, radar: str) -> FrontEndSwitch:
        if radar not in self._switches:
            raise UnknownId(radar)
        self._started()
        return self._switches[radar]

    def _started(self) -> None:
        if not self.ready:
            raise Refused("the service is still starting")

    def acknowledge(self, alert: int, by: str) -> Alert:
        self._started()
        with self._lock:
            live = self._alerts.get(alert)
            if live is None:
                if 0 < alert < self._next_alert:
                    raise Refused(f"alert {alert} is cleared")
                raise UnknownId(alert)
            now = time.time()
            if live.state != "acknowledged":
                live = replace(
                    live, state="acknowledged", acknowledged_at=now, acknowledged_by=by, updated_at=now, aural=False
                )
            self._change("acknowledge", live, now)
            return live

    def set_runway(
        self, runway: str, *, open: bool | None, in_use: str | None, visibility: Visibility | None
    ) -> RunwayState:
        self._started()
        with self._lock:
            state = self.runways.get(runway)
            if state is None:
                raise UnknownId(runway)
            if in_use and in_use not in runway.split("/"):
                raise Refused(f"runway {runway} has the directions {' and '.join(runway.split('/'))}")
            if visibility not in (None, "normal", "low"):
                raise Refused('visibility is "normal" or "low"')
            if open is not None:
                state = replace(state, open=open)
            if in_use and not state.open:
                raise Refused(f"runway {runway} is closed; open it to put it in use")
            if in_use is not None or not state.open:
                state = replace(state, in_use=in_use or None)
            if visibility is not None:
                state = replace(state, visibility=visibility)
            self.runways[runway] = state
            return state

    def submit_sweeps(self, radar: str, body: bytes) -> dict[str, int]:
        if radar not in self._octets:
            raise UnknownId(radar)
        self._started()
        blocks, counted = self._octets[radar].take(body)
        self.sweeps += blocks
        return counted

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        return self._take("nodes", events, self.node_events)

    def submit_target_reports(self, reports: TargetReports) -> Submitted:
        return self._take("reports", reports, self.target_reports)

    def note_bad_rows(self, feed: Literal["nodes", "reports"], counts: Mapping[str, int]) -> None:
        self.bad_rows[feed].update(counts)

    def _take(self, kind: str, table: Any, tables: list[Any]) -> Submitted:
        self._started()
        good, refused = self._times[kind].judge(table, time.time())
        if refused and not len(good):
            raise RefusedTime(refused[0].message, refused)
        with self._lock:
            if self._waiting >= self.settings.limits.rows_queued:
                raise Refused(f"the queue for {kind} is full")
            if len(good):
                self._waiting += 1
                tables.append(good)
        return Submitted(len(good), refused)


def main() -> None:
    """Serve the fake airport until interrupted."""
    import uvicorn

    from app.api.application import create_app
    from app.live.hub import Hub

    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--port", type=int, default=8123)
    words.add_argument("--targets", type=int, default=50)
    words.add_argument("--rate", type=float, default=4.0, help="pictures a second")
    given = words.parse_args()
    airport: Airport | None = None
    geojson: dict[str, Any] | None = None
    try:
        from app.airports import load_airport

        airport, geojson = load_airport("LFPO")
    except (ImportError, OSError, ValueError, KeyError) as error:
        print(f"no imported Orly ({error}): using the one made by hand")
    service = FakeService(targets=given.targets, rate_hz=given.rate, airport=airport, geojson=geojson)
    hub = Hub(service, service.settings)
    service.listen(hub.publish)
    with tempfile.TemporaryDirectory() as folder:
        store: Any = None
        try:
            from app.store.store import Store
        except ImportError:
            print("no store yet: nothing is kept")
        else:
            store = Store(f"sqlite:///{Path(folder) / 'fake.sqlite3'}", service.settings, service.airport)
            store.start()
            service.listen(store.record)
        service.start()
        app = create_app(service, hub=hub, store=store)
        uvicorn.run(app, host="127.0.0.1", port=given.port, log_level="warning", ws_per_message_deflate=False)
        service.stop()
        if store is not None:
            store.stop()


if __name__ == "__main__":
    main()
