"""The replay of a journal as a service: REST, feed and displays show it as they show what happens now."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, NoReturn

from app.assembly import node_site, radar_site
from app.contract import FrontEnd, PictureListener, Readiness, Refused, ReplayControl, Submitted, UnknownId, Video
from app.replay.player import JournalPlayer
from app.replay.recorded import RecordedRun
from pipeline.picture import Alert, Picture, RunwayState, SensorState, Visibility
from pipeline.tables import NodeEvents, TargetReports

NOT_LIVE = "this is the replay of a recording: what happened cannot be changed"
"""Why a request that would change something is refused."""


class ReplayService:
    """Keeps to `app.contract.Service`; everything that would change what happens is refused."""

    def __init__(self, run: RecordedRun, player: JournalPlayer) -> None:
        self.settings = run.settings
        self.airport = run.airport
        self.airport_geojson = run.geojson
        self.radars = tuple(radar_site(one, run.airport) for one in run.settings.radars)
        self.nodes = tuple(node_site(one, run.airport) for one in run.settings.nodes)
        self.player = player
        self.replay: ReplayControl | None = player

    def readiness(self) -> Readiness:
        """Ready with the first picture."""
        return Readiness({"picture": self.player.newest is not None, "threads": self.player.alive})

    def picture(self) -> Picture | None:
        """The picture shown now."""
        return self.player.newest

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every picture."""
        return self.player.listen(listener)

    def sensors(self) -> tuple[SensorState, ...]:
        """The health of the sensors as it was recorded, and that of the replay itself."""
        failed, time = self.player.failed, self.player.state().time
        own = SensorState("replay", "store", "degraded" if failed else "ok", time, detail=failed or self.player.note)
        return (*self.player.sensors, own)

    def video(self, radar: str) -> Video:
        """Not in a replay."""
        self._known(radar)
        raise Refused("the picture of the radar is not part of a replay")

    def front_end(self, radar: str) -> FrontEnd:
        """Not in a replay."""
        self._known(radar)
        self._refuse()

    def choose_parts(self, radar: str, wanted: Mapping[str, Mapping[str, Any]]) -> FrontEnd:
        """Not in a replay; `airside replay --set` runs it with other parts."""
        self._known(radar)
        self._refuse()

    def acknowledge(self, alert: int, by: str) -> Alert:
        """Not in a replay."""
        self._refuse()

    def set_runway(
        self, runway: str, *, open: bool | None, in_use: str | None, visibility: Visibility | None
    ) -> RunwayState:
        """Not in a replay."""
        self._refuse()

    def submit_sweeps(self, radar: str, body: bytes) -> dict[str, int]:
        """Not in a replay."""
        self._known(radar)
        self._refuse()

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        """Not in a replay."""
        self._refuse()

    def submit_target_reports(self, reports: TargetReports) -> Submitted:
        """Not in a replay."""
        self._refuse()

    def note_bad_rows(self, feed: Literal["nodes", "reports"], counts: Mapping[str, int]) -> None:
        """Nothing: what comes in during a replay is refused."""

    def _known(self, radar: str) -> None:
        if radar not in {one.id for one in self.radars}:
            raise UnknownId(radar)

    def _refuse(self) -> NoReturn:
        raise Refused(NOT_LIVE)
