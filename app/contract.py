"""What the running service offers to those that serve it outward (REST, feeds, displays); `app.service` keeps it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from app.settings import Settings
from pipeline.airport.model import Airport
from pipeline.picture import Alert, AlertChange, Picture, RunwayState, SensorState, Visibility
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, TargetReports


class UnknownId(KeyError):
    """No radar, runway, alert, track or node is called so."""


class Refused(ValueError):
    """The command or the data cannot be taken; the message says why."""


class RefusedRow(NamedTuple):
    """A row that was not taken. row: its place in what was given, from 0. reason: one word. message: for the sender."""

    row: int
    reason: str
    message: str


class RefusedTime(Refused):
    """Everything in a message is refused for its time. rows: each with its reason ("ahead", "behind", "invalid")."""

    def __init__(self, message: str, rows: Sequence[RefusedRow]) -> None:
        super().__init__(message)
        self.rows = tuple(rows)


@dataclass(frozen=True, slots=True)
class Submitted:
    """What became of rows that were given: how many are taken, and those refused for their time."""

    taken: int
    refused: tuple[RefusedRow, ...] = ()


@dataclass(frozen=True, slots=True)
class Readiness:
    """What has been reached at start-up: every check by name, ready when all are true."""

    checks: dict[str, bool]

    @property
    def ready(self) -> bool:
        """All checks are true."""
        return all(self.checks.values())


@dataclass(frozen=True, slots=True, eq=False)
class Video:
    """The newest full turn of one radar. amplitude: (azimuths, ranges) uint8. time: UTC of the newest sweep."""

    site: RadarSite
    amplitude: NDArray[np.uint8]
    time: float


class WrongParts(ValueError):
    """The parts that are asked for do not exist, or not with these settings; the message names the nearest word."""


@dataclass(frozen=True, slots=True)
class FrontEnd:
    """What works on one radar's video. running, next: of each verb the part, its name and every setting.

    next: what learns beside and takes over after scans_left turns; None when nothing does. plots_a_scan, ms_a_turn:
    of the newest whole turn, the time by stage. cut: what was left out in the last 10 s, by counter.
    """

    radar: str
    running: dict[str, dict[str, Any]]
    next: dict[str, dict[str, Any]] | None
    scans_left: int | None
    plots_a_scan: int
    ms_a_turn: dict[str, float]
    cut: dict[str, int]


@dataclass(frozen=True, slots=True)
class ReplayState:
    """Where the replay of a journal stands. begin, end, time: UTC s of the recording. speed: times the recorded pace.

    source: name of the journal. gaps: times at which the recording has a hole or the service was started anew.
    """

    source: str
    begin: float
    end: float
    time: float
    playing: bool
    speed: float
    gaps: tuple[float, ...] = ()


class ReplayControl(Protocol):
    """Steers the replay of a journal. All methods may be called from any thread."""

    def state(self) -> ReplayState:
        """Where it stands."""

    def steer(
        self, *, playing: bool | None = None, speed: float | None = None, time: float | None = None
    ) -> ReplayState:
        """Play or pause, at another pace, from another time (UTC s of the recording); None leaves as it is.

        Raises Refused for a time outside the recording and for a speed that is not in 0.1 .. 64.
        """


PictureListener = Callable[[Picture, tuple[AlertChange, ...]], None]
"""Called in the surface thread for every new picture; must return at once and must not raise."""


class Service(Protocol):
    """All methods may be called from any thread and do not block longer than a picture takes."""

    settings: Settings
    airport: Airport
    airport_geojson: dict[str, Any]
    radars: tuple[RadarSite, ...]
    nodes: tuple[NodeSite, ...]
    replay: ReplayControl | None
    """How to steer what is shown; None for a service that shows what happens now."""

    def readiness(self) -> Readiness:
        """Which of the start-up checks (database, warm-up, picture) are passed."""

    def picture(self) -> Picture | None:
        """The newest picture; None before the first."""

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every new picture; returns the function that ends it."""

    def sensors(self) -> tuple[SensorState, ...]:
        """The health of every sensor, with counters."""

    def video(self, radar: str) -> Video:
        """The newest turn of a radar. Raises UnknownId, or Refused when it has not been heard yet."""

    def front_end(self, radar: str) -> FrontEnd:
        """What works on a radar's video. Raises UnknownId; Refused while the service starts."""

    def choose_parts(self, radar: str, wanted: Mapping[str, Mapping[str, Any]]) -> FrontEnd:
        """Have other parts work on a radar's video; verbs left out stay. wanted: of each verb its name and settings.

        Builds and compiles in the calling thread, so it may take a while. Raises UnknownId, WrongParts, Refused.
        """

    def acknowledge(self, alert: int, by: str) -> Alert:
        """Acknowledge a live alert. Raises UnknownId; Refused when it is cleared."""

    def set_runway(
        self, runway: str, *, open: bool | None, in_use: str | None, visibility: Visibility | None
    ) -> RunwayState:
        """Set a runway's use. in_use: a designator, "" for not in use, None to leave. Raises UnknownId, Refused."""

    def submit_sweeps(self, radar: str, body: bytes) -> dict[str, int]:
        """Take sweeps in the documented octet form; counts taken and dropped. Raises UnknownId, Refused."""

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        """Take node events (their `node` is the index in `nodes`), but for those whose time is wrong.

        Raises RefusedTime when all are refused, Refused when the queue is full.
        """

    def submit_target_reports(self, reports: TargetReports) -> Submitted:
        """Take target reports; answers and raises like `submit_node_events`."""

    def note_bad_rows(self, feed: Literal["nodes", "reports"], counts: Mapping[str, int]) -> None:
        """Count rows that could not be read, by reason, among what the feed's sensor state tells."""
