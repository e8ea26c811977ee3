"""What filter and association cost by themselves on a thousand tracks, beside one object of filterpy for each track."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Expected, Measured
from pipeline.filter.kalman import Kalman
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch
from pipeline.lab.measure.tracker_workload import EPOCH, Field
from pipeline.tables.arrays import Floats

SLOW_REPEATS = 3
"""Turns of what takes a hundred times as long."""


def bench_tracker_parts(watch: Stopwatch, targets: int = 1000, peers: bool = True, seed: int = 1) -> Iterator[BenchRow]:
    """Filter and association of one turn. peers: also filterpy, which must be installed."""
    kalman, associate = Kalman(), GlobalNearestNeighbour()
    rng = np.random.default_rng(seed)
    plots = Field(targets, seed=seed).scan(0)
    state = np.zeros((targets, 4))
    state[:, :2] = rng.uniform(-1.0, 1.0, (targets, 2)) * Field(targets).half
    real = min(targets, len(plots))
    state[:real, 0], state[:real, 1] = plots.east[:real] + 1.0, plots.north[:real] - 1.0
    covariance = np.tile(np.diag([4.0, 4.0, 2.0, 2.0]), (targets, 1, 1))
    at = np.full(targets, EPOCH + 0.5)
    extent = np.tile([12.0, 9.0, 0.0], (targets, 1))
    expected = Expected(at, state, covariance, np.full(targets, 1.0), extent, np.zeros(targets))
    measured = Measured(plots.time, np.stack([plots.east, plots.north], axis=1), plots.covariance)
    dt, noise = np.ones(targets), np.tile(4.0 * np.eye(2), (targets, 1, 1))
    position: Floats = state[:, :2] + rng.normal(0, 2, (targets, 2))

    def filtering(_: Any) -> None:
        kalman.update(*kalman.predict(state, covariance, dt), np.zeros(targets), position, noise)

    yield watch.row("filter", _nothing, filtering, note=f"predict and update of {targets:,} tracks")
    yield watch.row(
        "associate", _nothing, lambda _: associate(expected, measured), note=f"gate and assign {len(plots):,} plots"
    )
    if peers:
        yield _filterpy(Stopwatch(watch.clock, SLOW_REPEATS, watch.frames), targets)


def _nothing(turn: int) -> None:
    """There is nothing to prepare."""


def _filterpy(watch: Stopwatch, targets: int) -> BenchRow:
    """The same predict and update by one filterpy object a track."""
    from filterpy.common import Q_continuous_white_noise
    from filterpy.kalman import KalmanFilter

    objects = []
    for _ in range(targets):
        one = KalmanFilter(dim_x=4, dim_z=2)
        one.F = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
        one.H = np.eye(2, 4)
        one.Q = Q_continuous_white_noise(2, 1.0, 1.0, block_size=2, order_by_dim=False)
        one.R = 4.0 * np.eye(2)
        objects.append(one)

    def work(_: Any) -> None:
        for one in objects:
            one.predict()
            one.update(np.array([1.0, 2.0]))

    return watch.row("filterpy", _nothing, work, peer=True, note="KalmanFilter, one object a track")
