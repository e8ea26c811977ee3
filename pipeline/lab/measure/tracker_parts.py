"""What filter and association cost by themselves on a thousand tracks, beside one object of filterpy for each track."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Expected
from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.filter.kalman import Kalman
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch
from pipeline.lab.measure.tracker_workload import EPOCH, Field
from pipeline.track.store import TrackStore

SLOW_REPEATS = 3
"""Turns of what takes a hundred times as long."""


def bench_tracker_parts(watch: Stopwatch, targets: int = 1000, peers: bool = True, seed: int = 1) -> Iterator[BenchRow]:
    """Filter and association of one turn. peers: also filterpy, which must be installed."""
    kalman, associate = Kalman(), GlobalNearestNeighbour()
    rng = np.random.default_rng(seed)
    plots = Field(targets, seed=seed).scan(0)
    place = rng.uniform(-1.0, 1.0, (targets, 2)) * Field(targets).half
    real = min(targets, len(plots))
    place[:real] = np.stack([plots.east[:real] + 1.0, plots.north[:real] - 1.0], axis=1)
    noise = np.tile(4.0 * np.eye(2), (targets, 1, 1))
    store, rows = TrackStore(targets, 1, kalman.columns), np.arange(targets)
    prior = Prior(np.zeros((targets, 2)), np.tile(2.0 * np.eye(2), (targets, 1, 1)), np.ones(targets, np.bool_))
    kalman.start(store, rows, Measured.of(np.full(targets, EPOCH), place, noise), prior)
    begun = store.filter.copy(), store.time.copy()
    taken = Measured.of(np.full(targets, EPOCH + 1.0), place + rng.normal(0, 2, (targets, 2)), noise)
    each = Hypotheses.single(rows)

    def settle(turn: int) -> None:
        store.filter[:], store.time[:] = begun

    def filtering(_: Any) -> None:
        kalman.update(store, kalman.predict(store, rows, taken.time), taken, each)

    settle(0)
    moments = kalman.moments(kalman.predict(store, rows, np.full(targets, EPOCH + 0.5)))
    expected = Expected(
        np.full(targets, EPOCH + 0.5), moments.mean, moments.covariance, np.full(targets, 1.0),
        np.tile([12.0, 9.0, 0.0], (targets, 1)), np.zeros(targets), rows, np.zeros(targets),
    )  # fmt: skip
    measured = Measured.of(plots.time, np.stack([plots.east, plots.north], axis=1), plots.covariance)
    every = np.arange(len(plots), dtype=np.int32)
    yield watch.row("filter", settle, filtering, note=f"predict and update of {targets:,} tracks")
    yield watch.row(
        "associate",
        _nothing,
        lambda _: associate(expected, measured, rows, every),
        note=f"gate and assign {len(plots):,} plots",
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
