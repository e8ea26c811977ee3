"""Passed holding positions: one behind another, and those of another runway."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.airport.model import Airport
from pipeline.alert.monitor import AlertMonitor
from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import IN_USE, RULES, Mover, Played, arrival, hold, play, small_airport

VEHICLE = TargetClass.VEHICLE


def with_a_second_hold() -> Airport:
    """At 700 m east the holding position far out (F1) has another one behind it, just before the area (G1)."""
    airport = small_airport()
    return replace(airport, holding_positions=(*airport.holding_positions, hold("G1", 700, -100, 0.0)))


def played(*movers: Mover, until: float = 59.0) -> Played:
    watch = AlertMonitor(with_a_second_hold(), RULES[1:2], runways=IN_USE)
    return play(watch, [arrival(1, 60), *movers], 0, until)


def test_between_two_holds_nobody_has_entered() -> None:
    between = Mover(3, [(0, 700, -300), (10, 700, -200), (20, 700, -120), (90, 700, -119.9)], VEHICLE)
    assert played(between).changes == []


@pytest.mark.parametrize("waits", [5.0, 22.0], ids=["at once", "after a wait longer than an entry is remembered"])
def test_who_passes_the_second_hold_too_is_told_with_its_name(waits: float) -> None:
    # slowly, so that nobody can say before that it will not stop; it comes into the area 7.3 s later
    on = 20 + waits
    path = [(0, 700, -300), (10, 700, -200), (20, 700, -110), (on, 700, -109), (on + 15, 700, -70), (90, 700, -69)]
    alerts = played(Mover(3, path, VEHICLE)).raised()
    assert [one.holding_point for one in alerts] == ["G1"]
    assert on + 7 <= alerts[0].raised_at <= on + 10


def test_back_over_the_second_hold_is_over() -> None:
    van = Mover(3, [(0, 700, -300), (10, 700, -200), (20, 700, -110), (30, 700, -60), (40, 700, -130), (90, 700, -131)],
                VEHICLE)  # fmt: skip
    told = played(van).changes
    assert [one.operation for one in told if one.operation != "update"] == ["raise", "clear"]
