"""Targets that come to the ground: where they stand, how they move, and which cells they fill in a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from pipeline.lab.evaluate.cfar_law import swerling3_survival
from pipeline.lab.evaluate.ground import ASPHALT, WEAK, Scene

BESIDE, EXTENDED, POINT, SLOW, FAST, GRASS = range(6)
KINDS = (
    "point beside an aircraft",
    "fixed aircraft (66 cells)",
    "fixed point",
    "slow mover",
    "fast mover",
    "vehicle on weak grass",
)

AIRCRAFT = (6, 11)
"""Azimuths and cells of an aircraft: 66 cells, as in the paper."""

VEHICLE = (2, 3)
LANE = 40
"""Cells along which movers move outward or inward."""

SLOW_PACE, FAST_PACE = 0.5, 10 / 3
"""Cells a scan: 1.5 and 10 m/s."""

SHIFTS = np.arange(-10.0, 30.01, 0.25)
"""Decibels by which limits are raised, for which Pd is kept."""

HAND_OVER = 8
"""Lanes over which the fast movers are dealt out, so that none comes back to where it was for a minute."""


@dataclass(frozen=True)
class Numbers:
    """How many there are: aircraft (each with a point target beside it), points, slow movers, fast ones, vehicles."""

    aircraft: int = 8
    points: int = 20
    slow: int = 6
    fast: int = 2
    grass: int = 12


@dataclass(frozen=True, eq=False)
class Targets:
    """cells(age) gives the flat indices of the cells of all targets `age` scans after they came, and the kind of each.

    power_db: mean power of a target by kind, dB above amplitude 0. near: (azimuths, ranges) bool, cells that a target
    ever fills.
    """

    places: tuple[tuple[int, NDArray[np.int64]], ...]
    moving: tuple[tuple[int, Callable[[int], NDArray[np.int64]]], ...]
    power_db: NDArray[np.float64]
    near: NDArray[np.bool_]

    def cells(self, age: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(cells, kinds); none before they come."""
        parts = [(kind, cells) for kind, cells in self.places] + [(kind, move(age)) for kind, move in self.moving]
        if age < 0 or not parts:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        where = np.concatenate([cells for _, cells in parts])
        kinds = np.concatenate([np.full(len(cells), kind) for kind, cells in parts])
        return where, kinds


def place(
    scene: Scene, chance: np.random.Generator, snr_db: float, numbers: Numbers = Numbers(), last_age: int = 200
) -> Targets:
    """Targets of snr_db over the mean log power of the surface that they stand on, without its texture and gusts.

    They keep two cells from other surfaces, and from each other. What finds no place in a scene is left out.
    """
    taken = np.zeros(scene.kind.shape, bool)
    places: list[tuple[int, NDArray[np.int64]]] = []
    moving: list[tuple[int, Callable[[int], NDArray[np.int64]]]] = []
    for _ in range(numbers.aircraft):
        rows, cells = AIRCRAFT
        corner = _free(scene, chance, taken, (rows, cells + 4), ASPHALT)
        if corner is not None:
            places.append((EXTENDED, _flat(scene, corner, AIRCRAFT)))
            places.append((BESIDE, _flat(scene, (corner[0] + rows // 2, corner[1] + cells + 3), (1, 1))))
    lanes = [_free(scene, chance, taken, (VEHICLE[0], LANE + 8), ASPHALT) for _ in range(numbers.slow)]
    moving += [(SLOW, _to_and_fro(scene, lane)) for lane in lanes if lane is not None]
    lanes = [_free(scene, chance, taken, (VEHICLE[0], LANE + 8), ASPHALT) for _ in range(HAND_OVER)]
    found = [lane for lane in lanes if lane is not None]
    if found:
        moving += [(FAST, _dealt_out(scene, found, k, numbers.fast)) for k in range(numbers.fast)]
    for kind, ground, many, size in (
        (POINT, ASPHALT, numbers.points, (1, 1)),
        (GRASS, WEAK, numbers.grass, VEHICLE),
    ):
        for _ in range(many):
            corner = _free(scene, chance, taken, size, ground)
            if corner is not None:
                places.append((kind, _flat(scene, corner, size)))
    log_mean = scene.ground.law.log_mean_db
    power = np.full(len(KINDS), scene.asphalt_db + log_mean + snr_db)
    power[GRASS] = scene.nominal_db(WEAK) + log_mean + snr_db
    made = Targets(tuple(places), tuple(moving), power, np.zeros(scene.kind.shape, bool))
    for _, fixed in places:
        made.near.ravel()[fixed] = True
    for _, move in moving:
        for age in range(last_age):
            made.near.ravel()[move(age)] = True
    return made


def _free(
    scene: Scene, chance: np.random.Generator, taken: NDArray[np.bool_], size: tuple[int, int], ground: int
) -> tuple[int, int] | None:
    """A corner of a free place of that ground, which is taken with two cells about it; from 45 to 700 m out."""
    rows, cells = size
    free = (scene.kind == ground) & ~taken
    free[:, :15] = free[:, 234:] = False
    room = minimum_filter(free, size=(rows + 4, cells + 4), mode="constant", origin=(-(rows // 2), -(cells // 2)))
    corners = np.flatnonzero(room)
    if not len(corners):
        return None
    row, cell = (int(one) for one in divmod(int(chance.choice(corners)), scene.kind.shape[1]))
    taken[max(0, row - 2) : row + rows + 2, cell - 2 : cell + cells + 2] = True
    return row, cell


def _flat(scene: Scene, corner: tuple[int, int], size: tuple[int, int]) -> NDArray[np.int64]:
    row, cell = np.mgrid[corner[0] : corner[0] + size[0], corner[1] : corner[1] + size[1]]
    return np.asarray(row * scene.kind.shape[1] + cell, np.int64).ravel()


def _to_and_fro(scene: Scene, lane: tuple[int, int]) -> Callable[[int], NDArray[np.int64]]:
    def cells(age: int) -> NDArray[np.int64]:
        way = (age * SLOW_PACE) % (2 * LANE)
        return _flat(scene, (lane[0], lane[1] + int(min(way, 2 * LANE - way))), VEHICLE)

    return cells


def _dealt_out(
    scene: Scene, lanes: list[tuple[int, int]], number: int, many: int
) -> Callable[[int], NDArray[np.int64]]:
    stay = int(LANE / FAST_PACE)

    def cells(age: int) -> NDArray[np.int64]:
        turn, along = divmod(age, stay)
        lane = lanes[(turn + number * len(lanes) // many) % len(lanes)]
        return _flat(scene, (lane[0], lane[1] + round(along * FAST_PACE)), VEHICLE)

    return cells


def detection(
    limit: NDArray[np.float32],
    mean: NDArray[np.float32],
    targets: Targets,
    cells: NDArray[np.int64],
    kinds: NDArray[np.int64],
) -> NDArray[np.float64]:
    """(KINDS, SHIFTS) mean probability that a target's cell passes the limits raised by each shift; nan where there is
    no target."""
    made = np.full((len(KINDS), len(SHIFTS)), np.nan)
    edge, clutter = limit.ravel()[cells].astype(np.float64), mean.ravel()[cells].astype(np.float64)
    edge = np.where(np.isinf(edge), 1e3, edge)
    for kind in np.unique(kinds):
        here = kinds == kind
        passed = swerling3_survival(
            edge[here, None] + SHIFTS, clutter[here, None], np.full((1, 1), targets.power_db[kind])
        )
        made[kind] = np.where(passed.mean(axis=0) < 1e-9, 0.0, passed.mean(axis=0))
    return made
