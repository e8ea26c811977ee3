"""Uncertainty that is not the same in all directions: the longer axis counts, wherever it points."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import RULES, Mover, arrival, elongated, monitor, parked, play

AXES = pytest.mark.parametrize("degrees", [0.0, 90.0, 45.0, -30.0], ids=["along", "across", "oblique", "other side"])
OCCUPIED = RULES[:1]


def raised_at(*movers: Mover) -> float | None:
    """When an alert is raised, with an arrival that is on the threshold at 60 s."""
    alerts = play(monitor(rules=OCCUPIED), [arrival(1, 60), *movers], 20, 59).raised()
    return min((one.raised_at for one in alerts), default=None)


def at_the_edge(sd: Any) -> Mover:
    """12 m inside the protection area."""
    return parked(3, 0, -78, TargetClass.UNKNOWN, sd=sd)


@AXES
def test_who_may_be_outside_the_area_by_its_longer_axis_is_no_occupant(degrees: float) -> None:
    assert raised_at(at_the_edge(elongated(15.0, 2.0, degrees))) is None
    assert raised_at(at_the_edge(elongated(2.0, 2.0, degrees))) == 30.0
    assert raised_at(at_the_edge(elongated(10.0, 2.0, degrees))) == 30.0, "12 m are more than its longer axis"


@AXES
def test_who_is_uncertain_by_its_longer_axis_is_raised_at_the_second_look(degrees: float) -> None:
    assert raised_at(parked(3, 0, 0, sd=elongated(11.0, 2.0, degrees))) == 30.0
    assert raised_at(parked(3, 0, 0, sd=elongated(13.0, 2.0, degrees))) == 31.0


@AXES
def test_a_speed_that_is_uncertain_by_its_longer_axis_is_not_believed(degrees: float) -> None:
    def stages(sd: Any) -> set[str]:
        rolls = Mover(7, [(0, -1000, 0), (20, -600, 0)], TargetClass.UNKNOWN, {"speed_sd": sd})
        return {one.alert.stage for one in play(monitor(rules=OCCUPIED), [rolls, parked(3, -400, 0)], 0, 15).changes}

    assert stages(elongated(8.0, 0.7, degrees)) == set(), "20 m/s are not three times 8 m/s"
    assert stages(elongated(6.0, 0.7, degrees)) == {"alarm"}
