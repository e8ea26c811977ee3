"""The search for near tracks, against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.track.core import Core, make_core
from pipeline.track.neighbours import MARGIN_M, close_rows
from pipeline.track.settings import TrackerSettings
from tests.pipeline.track.scene import RADAR, T0, FlatZones

REACH = 40.0


def scattered(rng: np.random.Generator, n: int = 60) -> Core:
    core = make_core(
        (RADAR,), (), FlatZones(), TrackerSettings(), n, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )
    core.store.append(n)
    core.store.rows["state"][:, :2] = rng.uniform(-300, 300, (n, 2))
    core.store.rows["state"][:, 2:] = rng.normal(0, 20, (n, 2))
    core.store.time[:] = T0 + rng.uniform(-1, 0, n)
    return core


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("every", [True, False])
def test_those_with_a_neighbour_are_found_in_order(seed: int, every: bool) -> None:
    rng = np.random.default_rng(seed)
    core = scattered(rng)
    rows = np.sort(rng.permutation(60)[:50])
    marked = None if every else rng.random(50) < 0.1
    state = core.store.state[rows]
    place = state[:, :2] + (T0 - core.store.time[rows])[:, None] * state[:, 2:]
    apart = np.abs(place[:, None] - place).max(axis=2) + np.where(np.eye(50), np.inf, 0.0)
    allowed = np.ones((50, 50), np.bool_) if marked is None else marked[:, None] | marked
    wanted = ((apart <= REACH + MARGIN_M) & allowed).any(axis=1)
    assert 0 < wanted.sum() < 50
    assert close_rows(core, rows, T0, REACH, marked).tolist() == rows[wanted].tolist()


def test_nobody_is_near_nothing() -> None:
    core = scattered(np.random.default_rng(1))
    assert not len(close_rows(core, np.arange(1), T0, 1e6))
    assert not len(close_rows(core, np.arange(9), T0, 1e6, np.zeros(9, np.bool_)))
    assert len(close_rows(core, np.arange(9), T0, 1e6)) == 9
