"""The byte forms of what enters the engine, what comes out of it, and its whole state: the language of a journal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.alert.life import Case
from pipeline.alert.monitor import MonitorState
from pipeline.contracts.alert import Conflict, Entry
from pipeline.engine import EngineState, Outcome
from pipeline.inputs import (
    Acknowledge,
    ClockStep,
    Envelope,
    PartsChanged,
    SensorHealth,
    SetRunway,
    Tick,
)
from pipeline.picture import Alert, AlertChange, AlertTarget, RunwayState, SensorState
from pipeline.situation.holds import HoldMemory
from pipeline.situation.pairs import Pair
from pipeline.tables import SectorPlots, Sweeps, Tracks
from pipeline.tables.arrays import Array, Floats
from pipeline.track.false_plots import FalsePlots
from pipeline.track.latency import Latencies
from pipeline.track.numbers import TrackNumbers
from pipeline.track.radar_clock import RadarClock
from pipeline.values import ValueCodec


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What one input led to, as it is recorded and compared: everything but how long it took.

    time, tracks, alerts, runways: of the picture; time is nan and the others are empty where none was made. refused:
    why a command could not be carried out; empty otherwise.
    """

    time: float
    tracks: Tracks
    alerts: tuple[Alert, ...]
    runways: tuple[RunwayState, ...]
    changes: tuple[AlertChange, ...]
    refused: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class ChainBlock:
    """What a radar's chain is about to work on.

    expected: (4, n) what the tracks expect of headings (`RadarChain.expected`); None: as before.
    """

    block: Sweeps
    expected: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ChainState:
    """A radar's chain before the next block. parts: of each verb its name and settings. state: `save_whole()`."""

    radar: int
    parts: dict[str, Any]
    state: dict[str, Array]


CODEC = ValueCodec(
    (
        Envelope, SectorPlots, Tick, ClockStep, SensorHealth, PartsChanged, Acknowledge, SetRunway,
        Shown, Alert, AlertTarget, AlertChange, RunwayState, SensorState,
        EngineState, RadarClock, FalsePlots, TrackNumbers, Latencies, MonitorState, Case, Conflict, HoldMemory, Entry,
        Pair, ChainBlock, ChainState, Sweeps,
    )
)  # fmt: skip
"""Knows every class that a journal holds, and no other."""

INPUT, OUTPUT, SNAPSHOT, SENSORS = "input", "output", "snapshot", "sensors"
"""The topics of a journal: envelopes, what came of them (`Shown`), states of the engine, health of the sensors."""

SWEEPS, CHAIN = "sweeps", "chain"
"""Optional topics: blocks of raw sweeps (`ChainBlock`), and states of the radars' chains (`ChainState`)."""


def shown(outcome: Outcome) -> Shown | None:
    """What is recorded of an outcome; None when nothing came of the input."""
    picture = outcome.picture
    if picture is None and outcome.refused is None:
        return None
    if picture is None:
        return Shown(float("nan"), Tracks.empty(), (), (), outcome.changes, repr(outcome.refused))
    return Shown(picture.time, picture.tracks, picture.alerts, picture.runways, outcome.changes)
