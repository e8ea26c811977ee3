"""Housekeeping: which young tracks within the extent of an established one are ended."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.measured import Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.tables import Source, TrackPhase
from pipeline.track.core import Core, make_core
from pipeline.track.maintenance import keep_house
from pipeline.track.settings import TrackerSettings
from pipeline.track.shape import SETTLED
from pipeline.track.store import ENDED
from pipeline.track.update import start_tracks, unknown_velocity
from tests.pipeline.track.scene import RADAR, T0, FlatZones


def young_beside_large(east: float) -> Core:
    """A confirmed track of 40 by 30 m, and a tentative one of a radar `east` m beside its middle."""
    core = make_core(
        (RADAR,), (), FlatZones(), TrackerSettings(), 4, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )
    place = np.array([[500.0, 0.0], [500.0 + east, 0.0]])
    measured = Measured.of(np.full(2, T0), place, np.tile(np.eye(2), (2, 1, 1)))
    start_tracks(core, measured, unknown_velocity(core, 2), 0, Source.RADAR, False)
    store, core.time = core.store, T0
    store.phase[0], store.id[0] = TrackPhase.CONFIRMED, 1
    store.length[:2], store.width[:2], store.heading[0] = (40.0, 3.0), (30.0, 2.0), np.pi / 2
    store.extent_count[:2] = (SETTLED, 1)
    store.evidence["score"][:2, 0], store.evidence["history"][:2, 0], store.evidence["looks"][:2, 0] = 5.0, 1, 1
    return core


def left(core: Core) -> int:
    keep_house(core, T0)
    return int((core.store.phase[: core.store.n] != ENDED).sum())


@pytest.mark.parametrize(("east", "tracks"), [(0.0, 1), (15.0, 1), (-15.0, 1), (60.0, 2)])
def test_a_young_track_within_an_established_one_is_a_part_of_it(east: float, tracks: int) -> None:
    assert left(young_beside_large(east)) == tracks


@pytest.mark.parametrize("column", ["node_time", "report_time"])
def test_what_a_node_or_a_report_told_of_is_no_part_of_another(column: str) -> None:
    core = young_beside_large(10.0)
    core.store.rows[column][1] = T0
    assert left(core) == 2


def test_without_an_extent_of_its_own_it_may_be_anything() -> None:
    core = young_beside_large(10.0)
    core.store.extent_count[1] = 0
    assert left(core) == 2


def test_one_that_is_not_established_takes_none_for_a_part_of_it() -> None:
    core = young_beside_large(10.0)
    core.store.extent_count[0] = SETTLED - 1
    assert left(core) == 2
