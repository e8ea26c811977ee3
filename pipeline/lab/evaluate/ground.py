"""Radar video of ground whose law is known in every cell, for measuring detectors.

A turn has 512 azimuths of 256 cells of 3 m, so that a macro-cell of 100 m holds about 650. What a cell answers with is
known exactly, so the false alarm probability of a detector follows from its thresholds (`Scene.exceedance`), and 1e-6
is measured without waiting for false alarms.

The papers give no figures of clutter; all of these are ours, after their figure 2 (asphalt just above the noise, two
kinds of grass, buildings).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import gammaln

from pipeline.airport.model import SurfaceKind
from pipeline.kernels.compiled import allocating
from pipeline.lab.evaluate.cfar_law import DB, Law, swerling3_draw
from pipeline.tables import Sweeps, VideoFormat

SURFACES = ("asphalt", "weak grass", "strong grass", "building")
ASPHALT, WEAK, STRONG, BUILDING = range(4)
_KINDS = np.array([SurfaceKind.APRON, SurfaceKind.GRASS, SurfaceKind.GRASS, SurfaceKind.BUILDING], np.uint8)
"""The map knows grass, not how strongly it answers."""

GUST_M, GUST_STEP_M = 120.0, 15.0
GUST_SIDE = 128

HELD_OUT = 1_000_000
"""Seeds from here on are held out: nothing is ever tuned on them."""


@dataclass(frozen=True)
class Rain:
    """A convective cell that drifts over the scene, and stratiform rain everywhere.

    rate: mm/h. Its power adds to that of the ground: at 16 mm/h the cell's middle has 13 dB, the stratiform rain 3 dB
    more than asphalt; both follow the rate by its power of 1.6 (Marshall and Palmer). begin: scan at which it starts;
    it swells for `ramp` scans, stays, and fades for `ramp`. Attenuation is not modelled.
    """

    rate: float = 16.0
    begin: int = 0
    ramp: int = 20
    stay: int = 40
    convective_db: float = 13.0
    stratiform_db: float = 3.0
    radius_m: float = 200.0
    drift_mps: float = 8.0

    def __post_init__(self) -> None:
        if not self.rate > 0 or self.ramp < 1 or self.stay < 0:
            raise ValueError("rate must be greater than 0, ramp 1 or more, stay 0 or more")

    @property
    def scans(self) -> int:
        """How many scans it lasts."""
        return 2 * self.ramp + self.stay

    def strength(self, scan: int) -> float:
        """0 before and after, 1 at its height."""
        age = scan - self.begin
        return float(np.clip(min(age / self.ramp, (self.scans - age) / self.ramp), 0.0, 1.0))

    def power(self, scan: int, east: NDArray[np.float32], north: NDArray[np.float32]) -> NDArray[np.float32]:
        """Power over asphalt's at these places, m from the radar."""
        drift = self.drift_mps * (scan - self.begin - self.scans / 2)
        apart = np.square(east - np.float32(0.8 * drift)) + np.square(north - np.float32(150 + 0.6 * drift))
        cell = np.exp(apart * np.float32(-0.5 / self.radius_m**2)) * np.float32(10 ** (self.convective_db / 10))
        scale = self.strength(scan) * (self.rate / 16.0) ** 1.6
        return np.asarray(np.float32(scale) * (cell + np.float32(10 ** (self.stratiform_db / 10))))


@dataclass(frozen=True)
class Ground:
    """How the ground answers. `build` makes the scene.

    seed: of the layout and the texture. level_db: mean power of each of SURFACES over asphalt. texture_db: standard
    deviation of the mean from cell to cell, which does not change. wind_db: the same of gusts that drift over the grass
    at wind_mps. law: of the fluctuation from scan to scan. beam_rows: azimuths that one look lights; with 1 the speckle
    is independent from cell to cell, with more it is correlated in azimuth as by a beam of that width. map_error:
    cells by which the map is wrong, in azimuth and in range. asphalt_step: mean power of asphalt in steps of the video.
    """

    seed: int = 0
    azimuths: int = 512
    ranges: int = 256
    range_step_m: float = 3.0
    db_per_step: float = 0.3125
    asphalt_step: float = 72.0
    level_db: tuple[float, float, float, float] = (0.0, 8.0, 14.0, 35.0)
    texture_db: tuple[float, float, float, float] = (0.5, 1.0, 1.5, 2.0)
    wind_db: float = 0.5
    wind_mps: float = 5.0
    law: Law = field(default=Law())
    beam_rows: int = 1
    map_error: int = 1
    asphalt_only: bool = False

    def __post_init__(self) -> None:
        if min(self.azimuths, self.ranges) < 16 or self.beam_rows < 1:
            raise ValueError("azimuths and ranges must be 16 or more, beam_rows 1 or more")
        if min(*self.texture_db, self.wind_db) < 0 or not self.db_per_step > 0:
            raise ValueError("texture_db and wind_db must not be negative, db_per_step greater than 0")

    @classmethod
    def homogeneous(cls, seed: int = 0, law: Law | None = None) -> Ground:
        """Asphalt without texture."""
        flat = (0.0, 0.0, 0.0, 0.0)
        return cls(seed=seed, texture_db=flat, wind_db=0.0, law=law or Law(), asphalt_only=True)

    @classmethod
    def heterogeneous(cls, seed: int = 0) -> Ground:
        """Asphalt, two grasses, buildings; the development scene, seeds below HELD_OUT."""
        return cls(seed=seed)

    @classmethod
    def held_out(cls, number: int = 0) -> Ground:
        """Another layout, other grass, harsher texture and gusts; nothing may be tuned on it."""
        return replace(
            cls(seed=HELD_OUT + number),
            level_db=(0.0, 6.0, 17.0, 35.0),
            texture_db=(0.7, 1.2, 2.0, 3.0),
            wind_db=0.7,
        )

    def build(self) -> Scene:
        """The scene; the same settings make the same."""
        return Scene(self)


class Scene:
    """A scene that can be looked at. Nothing in it changes; randomness is handed in.

    video: its grid. kind: (azimuths, ranges) uint8 index into SURFACES of each cell. surface: the map that detectors
    get, SurfaceKind, wrong by `Ground.map_error` cells. east, north: (azimuths, ranges) float32 m from the radar.
    """

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        step = 2 * np.pi / ground.azimuths
        self.video = VideoFormat(
            azimuths=ground.azimuths,
            ranges=ground.ranges,
            range_step_m=ground.range_step_m,
            beamwidth_rad=ground.beam_rows * step,
            db_per_step=ground.db_per_step,
        )
        azimuth = (np.arange(ground.azimuths) + 0.5) * step
        slant = ground.range_step_m * np.arange(ground.ranges)
        self.east = np.outer(np.sin(azimuth), slant).astype(np.float32)
        self.north = np.outer(np.cos(azimuth), slant).astype(np.float32)
        chance = np.random.default_rng([ground.seed, 1])
        self.kind = _layout(self.east, self.north, chance)
        if ground.asphalt_only:
            self.kind[:] = ASPHALT
        self.surface = _KINDS[_shifted(self.kind, ground.map_error)]
        texture = np.array(ground.texture_db, np.float32)[self.kind]
        self._still = (
            np.float32(ground.asphalt_step * ground.db_per_step)
            + np.array(ground.level_db, np.float32)[self.kind]
            + texture * chance.standard_normal(self.kind.shape, np.float32)
        )
        self._gusts = _gusts(chance) * np.float32(ground.wind_db)
        self._grass = np.flatnonzero((self.kind == WEAK) | (self.kind == STRONG))

    @property
    def asphalt_db(self) -> float:
        """Mean power of asphalt without texture, dB above amplitude 0."""
        return self.ground.asphalt_step * self.ground.db_per_step

    def nominal_db(self, kind: int) -> float:
        """Mean power of a surface without texture and gusts, dB above amplitude 0."""
        return self.asphalt_db + self.ground.level_db[kind]

    def mean_db(self, scan: int, rain: Rain | None = None) -> NDArray[np.float32]:
        """(azimuths, ranges) true mean power of the clutter in this scan, dB above amplitude 0."""
        mean = self._still.copy()
        if self.ground.wind_db > 0 and len(self._grass):
            east, north = self._gust_places
            moved = scan * self.ground.wind_mps / GUST_STEP_M
            column = (east + np.float32(0.6 * moved)).astype(np.int32) % GUST_SIDE
            line = (north + np.float32(0.8 * moved)).astype(np.int32) % GUST_SIDE
            mean.ravel()[self._grass] += self._gusts[line, column]
        if rain is not None and rain.strength(scan) > 0:
            asphalt = np.float32(self.asphalt_db)
            total = np.exp((mean - asphalt) * np.float32(np.log(10) / 10))
            total += rain.power(scan, self.east, self.north)
            mean = asphalt + np.float32(10) * np.log10(total)
        return mean

    def amplitude(
        self,
        chance: np.random.Generator,
        mean_db: NDArray[np.float32],
        targets: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None,
    ) -> NDArray[np.uint8]:
        """(azimuths, ranges) video of one scan. targets: flat indices of cells, and the mean power in dB of the
        Swerling 3 target in each; the clutter in such a cell is Rayleigh whatever the law."""
        out = np.empty(mean_db.shape, np.uint8)
        step = np.float32(1 / self.video.db_per_step)
        if self.ground.beam_rows == 1:
            main, tail = self.ground.law.quantiles
            _draw(mean_db, chance.integers(0, 2**32, mean_db.shape, np.uint32), main, tail, step, out)
        else:
            out[:] = np.clip(np.rint((mean_db + self._correlated(chance)) * step), 0, 255)
        if targets is not None:
            cells, power = targets
            value = swerling3_draw(chance, mean_db.ravel()[cells], power)
            out.ravel()[cells] = np.clip(np.rint(value * step), 0, 255)
        return out

    def exceedance(self, thresholds: NDArray[Any], mean_db: NDArray[Any], shift_db: float = 0.0) -> NDArray[np.float64]:
        """Probability that each cell of clutter is detected against these thresholds (`Detector.thresholds`), raised by
        shift_db; exact, rounding to 8 bits included."""
        return np.where(
            thresholds >= 255, 0.0, self.ground.law.survival(self.limit_db(thresholds) - mean_db + shift_db)
        )

    def limit_db(self, thresholds: NDArray[Any]) -> NDArray[np.float32]:
        """What an amplitude must pass before it is rounded, to exceed the thresholds: dB above amplitude 0."""
        return (thresholds.astype(np.float32) + np.float32(0.5)) * np.float32(self.video.db_per_step)

    def sweeps(self, scan: int, amplitude: NDArray[np.uint8]) -> Sweeps:
        """One scan as a block."""
        row = np.arange(self.video.azimuths, dtype=np.int32)
        turn = (row + 0.5) / self.video.azimuths
        return Sweeps(0, scan, row, 2 * np.pi * turn, 1000.0 + scan + turn, amplitude, last=True)

    def clutter(self, chance: np.random.Generator, scans: range) -> Iterator[Sweeps]:
        """Scans of the ground alone."""
        for scan in scans:
            yield self.sweeps(scan, self.amplitude(chance, self.mean_db(scan)))

    @cached_property
    def _gust_places(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        far = np.float32(2 * GUST_SIDE)  # keeps the coordinates positive, a whole number of times round
        east, north = (one.ravel()[self._grass] / np.float32(GUST_STEP_M) + far for one in (self.east, self.north))
        return east, north

    def _correlated(self, chance: np.random.Generator) -> NDArray[np.float32]:
        """Decibels about the mean of speckle that beam_rows rows share, of the scene's law."""
        wide = self.ground.beam_rows
        echo = chance.standard_normal((2, *self.kind.shape), np.float32)
        lit = sum(np.roll(echo, row, axis=1) for row in range(wide))
        power = np.square(lit).sum(axis=0) / np.float32(2 * wide)
        law = self.ground.law
        if law.family == "k":
            power *= chance.standard_gamma(law.shape, power.shape, np.float32) / np.float32(law.shape)
        # Weibull power is a power of the exponential
        stretch = 2 / law.shape if law.family == "weibull" else 1.0
        decibels = np.float32(10 * stretch) * np.log10(np.maximum(power, np.float32(1e-7)))
        return np.asarray(decibels - np.float32(DB * gammaln(1 + stretch)), np.float32)


def _layout(east: NDArray[np.float32], north: NDArray[np.float32], chance: np.random.Generator) -> NDArray[np.uint8]:
    """Index into SURFACES: an apron about the radar with a terminal behind it, two taxiways and a runway in grass."""
    turn, bend = chance.uniform(0, 2 * np.pi), chance.uniform(0, 2 * np.pi)
    x = east * np.float32(np.cos(turn)) - north * np.float32(np.sin(turn))
    y = east * np.float32(np.sin(turn)) + north * np.float32(np.cos(turn))
    strip, inner = chance.uniform(470, 520), chance.uniform(330, 360)
    kind = np.full(east.shape, WEAK, np.uint8)
    edge = 90 * np.sin(x / 140 + bend)
    kind[(y > 570 + edge / 2) | (y < -330 + edge) | (np.abs(x + edge) > 540 + edge / 3)] = STRONG
    for middle, half in ((strip, 30.0), (inner, 20.0)):
        kind[np.abs(y - middle) < half] = ASPHALT
    cross = chance.uniform(-60, 60)
    kind[(np.abs(x - cross) < 40) & (y > 0) & (y < strip)] = ASPHALT
    kind[(np.abs(x) < 380) & (y > -70) & (y < 250)] = ASPHALT
    for left in (-330.0, -90.0, 150.0):
        at = left + chance.uniform(-20, 20)
        kind[(x > at) & (x < at + 170) & (y > -160) & (y < -90)] = BUILDING
    return kind


def _shifted(kind: NDArray[np.uint8], cells: int) -> NDArray[np.uint8]:
    moved = np.roll(kind, cells, axis=0)
    if cells:
        moved[:, cells:] = moved[:, :-cells].copy()
    return moved


def _gusts(chance: np.random.Generator) -> NDArray[np.float32]:
    field = gaussian_filter(chance.standard_normal((GUST_SIDE, GUST_SIDE)), GUST_M / GUST_STEP_M, mode="wrap")
    return np.asarray(field / field.std(), np.float32)


@allocating
def _draw(mean: Any, bits: Any, main: Any, tail: Any, step: Any, out: Any) -> None:
    for i in range(mean.shape[0]):
        means, row, made = mean[i], bits[i], out[i]
        for j in range(means.size):
            place = row[j] >> np.uint32(16)
            value = main[place]
            if place == 65535:
                value = tail[row[j] & np.uint32(65535)]
            made[j] = np.uint8(min(max(np.rint((means[j] + value) * step), np.float32(0)), np.float32(255)))
