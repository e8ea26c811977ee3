"""The 3D view: a viser server on loopback and the thread that keeps its scene up to date."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from app.contract import ReplayControl, ReplayState
from app.view3d import panel
from app.view3d.ground import Ground, build_ground
from app.view3d.movers import Frame, Movers, outline
from pipeline.airport.model import Airport
from pipeline.picture import Picture

log = logging.getLogger(__name__)

URGENT_S = 0.1
"""A changed alert is shown at once, but not more often than this."""

IDLE_S = 2.0
"""How often the scene is brought up to date while nobody looks."""


class View3D:
    """Shows every picture that `update` is given, the newest one only. viser is imported by `start`, not before.

    host, port: where viser listens; it must not be reachable from outside, since it knows neither users nor origins.
    period_s: time between two updates of the scene. replay: where the replay stands, when one is shown.
    """

    def __init__(
        self,
        airport: Airport,
        mode: str = "live",
        host: str = "127.0.0.1",
        port: int = 0,
        period_s: float = 0.4,
        replay: ReplayControl | None = None,
    ) -> None:
        self.airport = airport
        self.mode = mode
        self.host = host
        self.ready = threading.Event()
        self._replay = replay
        self._asked_port = port
        self._period_s = period_s
        self._latest: Picture | None = None
        self._arrived = 0.0
        self._alerts: tuple[Any, ...] = ()
        self._wake = threading.Event()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        self._server: Any = None
        self._port: int | None = None
        self._viewers: dict[int, Any] = {}
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._movers = Movers(_outlines(airport))

    @property
    def port(self) -> int | None:
        """The port viser listens on; None while it does not."""
        return self._port

    def start(self) -> None:
        """Begin in a thread of its own; `ready` is set when the scene stands."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="view-3d", daemon=True)
            self._thread.start()

    def update(self, picture: Picture) -> None:
        """Take the newest picture; returns at once, whatever the scene is doing."""
        if self._latest is not None:
            self._counts["merged"] += 1
        self._latest = picture
        self._arrived = time.monotonic()
        self._counts["pictures"] += 1
        alerts = tuple((one.id, one.stage, one.state) for one in picture.alerts)
        if alerts != self._alerts:
            self._alerts = alerts
            self._wake.set()

    def stop(self) -> None:
        """End the thread and the server."""
        self._over.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join(15.0)

    def counters(self) -> dict[str, int]:
        """What was taken, merged (overtaken before it was shown), shown, failed, left without a place; they grow."""
        return dict(self._counts)

    def count(self, what: str) -> None:
        """Count something that happened at the door."""
        self._counts[what] += 1

    def viewers(self) -> list[Any]:
        """Those who look now."""
        with self._lock:
            return list(self._viewers.values())

    def _run(self) -> None:
        try:
            scene = self._open()
        except Exception:
            log.exception("the 3D view cannot start; everything else goes on")
            return
        self.ready.set()
        try:
            self._push(scene)
        finally:
            self._port = None
            with _quiet():
                self._server.stop()

    def _open(self) -> Any:
        with _quiet():
            server = _server(self.host, self._asked_port)
        self._server = server
        ground = build_ground(self.airport)
        try:
            from app.view3d.scene import Scene

            scene = Scene(server, ground, self._picked)
            _dress(server, self.airport, ground, self.mode)
            self._status = server.gui.add_html(panel.status(self.airport, self.mode, None, None))
            server.on_client_connect(lambda client: self._connected(client, ground))
            server.on_client_disconnect(self._disconnected)
        except BaseException:
            with _quiet():
                server.stop()
            raise
        self._port = int(server.get_port())
        return scene

    def _push(self, scene: Any) -> None:
        frame: Frame | None = None
        status_at, due = 0.0, 0.0
        while not self._over.is_set():
            now = time.monotonic()
            if now < due:
                self._wake.wait(due - now)
            begun = time.monotonic()
            urgent = self._wake.is_set()
            self._wake.clear()
            picture, self._latest = self._latest, None
            try:
                if picture is not None:
                    frame = self._movers.arrange(picture)
                    self._counts["without_place"] += self._movers.slots.refused
                    scene.show(frame)
                    self._counts["shown"] += 1
                self._forget_the_gone()
                if frame is not None:
                    for viewer in self.viewers():
                        self._refresh(viewer, frame)
                if urgent or begun - status_at >= 1.0:
                    status_at = begun
                    age = begun - self._arrived if frame is not None else None
                    shown = None if frame is None else frame.picture
                    self._status.content = panel.status(self.airport, self.mode, shown, age, self._stands(begun))
            except Exception:
                self._counts["failed"] += 1
                if self._counts["failed"] in (1, 10, 100, 1000):
                    log.exception("3D view: a picture could not be shown (%d so far)", self._counts["failed"])
            wait = self._period_s if self._viewers else IDLE_S
            earliest = begun + URGENT_S
            self._over.wait(max(0.0, earliest - time.monotonic()))
            due = begun + wait

    def _stands(self, now: float) -> ReplayState | None:
        """Where the replay stands; from a pause on, the age of the picture counts anew."""
        if self._replay is None:
            return None
        state = self._replay.state()
        if not state.playing:
            self._arrived = now
        return state

    def _refresh(self, viewer: Any, frame: Frame) -> None:
        try:
            viewer.refresh(frame)
        except Exception as error:
            # A client may vanish between two lines; its handles then refuse to be written.
            self._counts["viewer_failed"] += 1
            log.debug("3D view: viewer %s: %s", viewer.id, error)

    def _connected(self, client: Any, ground: Ground) -> None:
        from app.view3d.viewer import Viewer

        made = Viewer(client, self.airport, ground, self._wake.set)
        with self._lock:
            self._viewers[made.id] = made
        self._counts["viewers_served"] += 1
        self._wake.set()

    def _disconnected(self, client: Any) -> None:
        with self._lock:
            self._viewers.pop(client.client_id, None)

    def _forget_the_gone(self) -> None:
        """A client that left while it was being greeted has said goodbye before it was known."""
        here = self._server.get_clients()
        with self._lock:
            for gone in [one for one in self._viewers if one not in here]:
                del self._viewers[gone]

    def _picked(self, client: int, place: int | None) -> None:
        with self._lock:
            viewer = self._viewers.get(client)
        track = self._movers.slots.bearer(place)
        if viewer is not None and track is not None:
            viewer.select(track)


def _outlines(airport: Airport) -> dict[str, Any]:
    found = {}
    for one in airport.runways:
        points = np.asarray(one.strip.exterior.coords)
        found[one.id] = outline(points[:, 0], points[:, 1])
    return found


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """viser prints to the terminal through rich's own console; what is said there is ours to say."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def _server(host: str, port: int) -> Any:
    import viser
    from viser import _client_autobuild, _messages
    from viser.infra import _infra

    from app.view3d.loopback import answer_loopback_only

    # A client may leave between two lines that write to it; that is no news.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    # viser would run npm when the times of its files look odd, as they do in images and copied environments.
    _client_autobuild.ensure_client_is_built = lambda: None
    answer_loopback_only(_infra)
    server = viser.ViserServer(host=host, port=port, verbose=False)
    # Any client could ask for a public tunnel to this machine; the button alone can be hidden, the handler not.
    for unwanted in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(unwanted)
    return server


def _dress(server: Any, airport: Airport, ground: Ground, mode: str) -> None:
    from app.view3d.cameras import FAR_M, NEAR_M, overview

    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(111, 183, 232))
    word = "" if mode == "live" else f" {mode.upper()}"
    server.gui.set_panel_label(f"Airside 3D, {airport.icao}{word}")
    pose = overview(ground)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.up = pose.position, pose.look_at, (0.0, 0.0, 1.0)
    camera.fov, camera.near, camera.far = pose.fov, NEAR_M, FAR_M
