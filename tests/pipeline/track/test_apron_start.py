"""What begins on an apron is slow, so that fragments of parked aircraft are not taken for one target in motion."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.airport.model import SurfaceKind
from pipeline.track.settings import StartSettings, TrackerSettings
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import FlatZones, Target, line, make_tracker, run

HERE = np.array([500.0, -400.0])


def seen_apart(metres: float, bearing: float, surface: SurfaceKind, apron_speed_sd: float = 7.0) -> Tracker:
    """A plot, and one turn later another, so far away."""
    there = HERE + metres * np.array([np.sin(bearing), np.cos(bearing)])
    first, second = Target(line(*HERE, 0, 0), 4, 3, gone=1.0), Target(line(*there, 0, 0), 4, 3, born=1.0)
    settings = TrackerSettings(start=StartSettings(apron_speed_sd=apron_speed_sd))
    tracker = make_tracker(zones=FlatZones(surface), settings=settings)
    run(tracker, [first, second], 2, sd=0.5)
    return run(tracker, [], 1, first=2)


@pytest.mark.parametrize("bearing", [0.0, 1.0, np.pi / 2, 2.5, 4.0])
@pytest.mark.parametrize(
    ("metres", "surface", "sd", "same"),
    [
        (20.0, SurfaceKind.APRON, 7.0, True),
        (40.0, SurfaceKind.APRON, 7.0, False),
        (40.0, SurfaceKind.APRON, 14.0, True),
        (20.0, SurfaceKind.APRON, 3.0, False),
        (40.0, SurfaceKind.TAXIWAY, 7.0, True),
    ],
)
def test_a_second_plot_is_the_same_target_when_its_speed_is_one_of_the_place(
    metres: float, surface: SurfaceKind, sd: float, same: bool, bearing: float
) -> None:
    table = seen_apart(metres, bearing, surface, sd).save()["store"]["rows"]
    assert table["hits"].tolist() == ([2] if same else [1, 1])


def test_the_first_velocity_on_an_apron_is_drawn_towards_rest() -> None:
    """Two plots 10 m apart with much noise: a mover of 10 m/s elsewhere, half as fast on the apron."""
    speeds = []
    for surface in (SurfaceKind.APRON, SurfaceKind.TAXIWAY):
        targets = [Target(line(500, -400, 0, 0), gone=1.0), Target(line(510, -400, 0, 0), born=1.0)]
        tracker = run(make_tracker(zones=FlatZones(surface)), targets, 2, sd=6.0)
        speeds.append(float(np.hypot(*tracker.save()["store"]["rows"]["state"][0, 2:])))
    assert speeds[0] < 0.7 * speeds[1]
