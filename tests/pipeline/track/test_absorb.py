"""What a track takes over from another one of the same target."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.measured import Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.tables import Source
from pipeline.track.core import Core, make_core
from pipeline.track.fragments import absorb
from pipeline.track.settings import TrackerSettings
from pipeline.track.update import start_tracks, unknown_velocity
from tests.pipeline.track.scene import RADAR, T0, FlatZones


def pair(sds: tuple[float, float], times: tuple[float, float]) -> Core:
    """Two tracks, sure of their places by so many m, whose newest plots are of these times, with looks planned."""
    core = make_core(
        (RADAR,), (), FlatZones(), TrackerSettings(), 4, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )
    measured = Measured.of(
        np.array(times), np.array([[500.0, 0.0], [505.0, 0.0]]), np.array([sd**2 * np.eye(2) for sd in sds])
    )
    start_tracks(core, measured, unknown_velocity(core, 2), 0, Source.RADAR, False)
    look = core.store.look
    look["last"][:2], look["wake"][:2], look["planned"][:2] = [[100], [200]], [[3], [7]], [[False], [True]]
    return core


@pytest.mark.parametrize(
    ("sds", "times", "taken"),
    [
        ((2.0, 1.0), (T0, T0), True), ((1.0, 2.0), (T0, T0), False), ((1.0, 1.0), (T0, T0), False),
        ((1.0, 2.0), (T0, T0 + 1.0), True), ((2.0, 1.0), (T0 + 1.0, T0), True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("keep_place", [False, True])
def test_the_state_is_that_of_the_surer_or_newer_with_the_looks_planned_for_it(
    sds: tuple[float, float], times: tuple[float, float], taken: bool, keep_place: bool
) -> None:
    core = pair(sds, times)
    absorb(core, 0, 1, keep_place)
    from_other, store = taken and not keep_place, core.store
    assert store.state[0, 0] == (505.0 if from_other else 500.0)
    assert store.filter["state"][0].tolist() == store.state[0].tolist()
    look = store.look[0, 0]
    assert (look["last"], look["wake"], bool(look["planned"])) == ((200, 7, True) if from_other else (100, 3, False))
    assert store.radar_time[0] == store.updated[0] == max(times)


def test_hits_add_up_and_evidence_is_that_of_both() -> None:
    core = pair((1.0, 2.0), (T0, T0))
    store = core.store
    store.hits[:2], store.rows["moved"][:2] = (3, 5), (False, True)
    for name, values in (("history", (0b101, 0b110)), ("looks", (4, 6)), ("misses", (2, 1)), ("score", (7.0, 9.0))):
        store.evidence[name][:2, 0] = values
    absorb(core, 0, 1)
    assert (store.hits[0], bool(store.moved[0])) == (8, True)
    assert store.evidence[0, 0].tolist() == (0b111, 6, 1, 9.0)


@pytest.mark.parametrize("named", [False, True])
def test_who_it_is_and_how_large_is_taken_where_the_other_knows_more(named: bool) -> None:
    core = pair((1.0, 2.0), (T0, T0))
    store = core.store
    store.named[:2], store.address[:2], store.claimed[:2] = (named, True), ("a" if named else "", "b"), (0, 2)
    store.length[:2], store.extent_count[:2] = (30.0, 10.0), (2, 3 if named else 2)
    absorb(core, 0, 1)
    assert store.address[0] == ("a" if named else "b")
    assert store.category[0] == (0 if named else 2)
    assert store.length[0] == (10.0 if named else 30.0)
