"""What is held of a target's height when its reports do not say whether it is on the ground."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.tables import TargetReports
from tests.pipeline.track.scene import T0, make_tracker

UNKNOWN = {"ground_known": False}


def after(*reports: dict[str, Any]) -> tuple[bool, float]:
    """(on_ground, altitude) of a target that sends these reports, one a second."""
    tracker = make_tracker()
    for second, one in enumerate(reports):
        at = {"time": T0 + second, "east": 50.0 * second, "north": 200.0, "speed": 50.0, "course": np.pi / 2}
        tracker.target_reports(TargetReports.build(1, address="~2a1b3c", **at, **one))
    store = tracker._core.store
    assert store.n == 1
    assert store.address[0] == "~2a1b3c"
    return bool(store.on_ground[0]), float(store.altitude[0])


@pytest.mark.parametrize(("altitude", "on_ground"), [(3000.0, False), (16.0, False), (15.0, True), (-8.0, True)])
def test_the_altitude_decides_when_the_sender_does_not_say(altitude: float, on_ground: bool) -> None:
    assert after({**UNKNOWN, "altitude": altitude}) == (on_ground, altitude)
    assert after({**UNKNOWN, "altitude": altitude, "on_ground": True}) == (on_ground, altitude)


def test_a_report_that_says_nothing_of_the_height_changes_nothing() -> None:
    assert after({**UNKNOWN, "altitude": 3000.0}, UNKNOWN) == (False, 3000.0)
    assert after({"altitude": 900.0, "on_ground": False}, UNKNOWN) == (False, 900.0)


def test_without_any_word_of_the_height_it_is_held_to_be_on_the_ground() -> None:
    on_ground, altitude = after(UNKNOWN, UNKNOWN)
    assert on_ground
    assert np.isnan(altitude)


def test_the_word_of_the_sender_goes_before_the_altitude() -> None:
    assert after({"altitude": 40.0, "on_ground": True}) == (True, 40.0)
    assert after({"altitude": 2.0, "on_ground": False}) == (False, 2.0)
