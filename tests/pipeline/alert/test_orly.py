"""The rules on the shipped map of Orly: every runway in both directions, every holding position that guards one."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from app.airports import load_airport
from pipeline.airport.model import Airport
from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.alert.monitor import AlertMonitor
from pipeline.picture import RunwayState
from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import RULES, Mover, play


@cache
def orly() -> tuple[Airport, RunwayFrames, HoldFrames]:
    airport, _ = load_airport("LFPO")
    return airport, RunwayFrames.build(airport), HoldFrames.build(airport)


def guarding(runway: int) -> list[int]:
    """Holding positions from which 12 m lead into the protection area."""
    _, frames, holds = orly()
    ahead = holds.position + 12.0 * holds.unit
    return [int(h) for h in np.nonzero(holds.runway == runway)[0] if frames.depth(runway, "normal", ahead)[h] > 0]


def final(runway: int, way: int, threshold_at: float) -> Mover:
    _, frames, _ = orly()
    unit = frames.unit[runway] * (1 if way == 0 else -1)
    threshold = frames.origin[runway] + frames.unit[runway] * frames.threshold[runway, way]
    out = threshold - unit * 70.0 * threshold_at
    path = [(0.0, *out), (threshold_at, *threshold), (threshold_at + 25, *(threshold + unit * 1500))]
    return Mover(1, path, extra={"callsign": "AFR1"})


def monitor_of_orly(runway: int, way: int) -> AlertMonitor:
    airport, frames, _ = orly()
    used = RunwayState(frames.ids[runway], in_use=frames.designators[runway][way])
    return AlertMonitor(airport, RULES, runways=(used,))


RUNWAYS = range(len(orly()[1].ids))


@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize("runway", RUNWAYS)
def test_every_guarded_way_onto_every_runway_is_watched(runway: int, way: int) -> None:
    _, frames, holds = orly()
    assert len(guarding(runway)) >= 2
    for hold in guarding(runway):
        bar, unit = holds.position[hold], holds.unit[hold]
        stop = bar + unit * 40
        path = [(0.0, *(bar - unit * 120)), (30.0, *bar), (40.0, *stop), (100.0, *(stop + 1e-3))]
        played = play(
            monitor_of_orly(runway, way),
            [final(runway, way, 55), Mover(3, path, TargetClass.VEHICLE)],
            5,
            50,
            noise=hold,
        )
        mine = [c for c in played.changes if c.alert.runway == frames.ids[runway]]
        alarms = [c for c in mine if c.alert.rule == "hold_entry" and c.alert.stage == "alarm"]
        assert alarms, holds.names[hold]
        assert alarms[0].time <= 37
        assert {c.alert.holding_point for c in alarms} <= set(holds.names)
        occupied = [c for c in mine if c.alert.rule == "runway_occupied" and c.alert.stage == "alarm"]
        assert occupied, holds.names[hold]
        assert occupied[0].time <= 43


@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize("runway", RUNWAYS)
def test_waiting_at_every_holding_position_is_nothing(runway: int, way: int) -> None:
    _, _, holds = orly()
    movers = [final(runway, way, 55)]
    for n, hold in enumerate(guarding(runway)):
        bar, unit = holds.position[hold], holds.unit[hold]
        path = [(0.0, *(bar - unit * 150)), (25.0, *(bar - unit * 22)), (100.0, *(bar - unit * 21.9))]
        movers.append(Mover(10 + n, path))
    assert play(monitor_of_orly(runway, way), movers, 0, 55, noise=runway).changes == []


@pytest.mark.parametrize("runway", RUNWAYS)
def test_landing_on_every_runway_is_nothing(runway: int) -> None:
    for way in (0, 1):
        assert play(monitor_of_orly(runway, way), [final(runway, way, 60)], 0, 85, noise=way).changes == []
