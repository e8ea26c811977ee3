"""Close-up video of posed targets: what a radar's log video shows of one aircraft or vehicle, or of a few together.

The targets are dense clouds of scatterers of random phase over their outlines (fuselage, swept wings, tailplane,
engines; a vehicle is a rectangle), seen with the radar's resolution (Gaussian in azimuth and range) over Rayleigh
clutter. Every look draws new gains of parts and of scatterers, which no estimator can know. For experiments on
extraction and bearing, which Galati et al., "Airport surveillance processing chain for high resolution radar", section
4, did on real pictures. The proportions of the parts and their strengths are ours, chosen to look like X-band pictures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, contains_xy, union_all
from shapely.geometry.base import BaseGeometry

from pipeline.kernels.compiled import allocating
from pipeline.reference.types import TYPES, TargetType
from pipeline.tables import TargetClass, VideoFormat

Floats = NDArray[np.float64]

B734 = TargetType("B734", TargetClass.AIRCRAFT, 36.4, 28.9, 11.1, 3.8, 0.44, 2, 80.0)
"""The B737 of the papers' time."""

CLOSEUP_TYPES: dict[str, TargetType] = {**TYPES, "B734": B734}
"""All types by name that a close-up can show."""

LOG_MEAN_DB = -10 * float(np.euler_gamma) / math.log(10)
"""Mean log power of Rayleigh clutter relative to the log of its mean power."""

FUSELAGE, RIGHT_WING, LEFT_WING, TAIL, RIGHT_ENGINE, LEFT_ENGINE, BODY = range(7)
_STRENGTH_DB = np.array([0.0, -2.0, -2.0, 0.0, 4.0, 4.0, 0.0])
_REACH = 2.1
"""Half-power widths to which the echo of a point is followed on each side: 53 dB down."""


@dataclass(frozen=True, slots=True)
class Posed:
    """A target and where its middle stands, metres from the radar. heading: rad from true north, of its nose."""

    kind: TargetType
    east: float
    north: float
    heading: float

    @classmethod
    def at(cls, kind: TargetType, range_m: float, azimuth: float, heading: float) -> Posed:
        """A target at a range and azimuth (rad from true north) from the radar."""
        return cls(kind, range_m * math.sin(azimuth), range_m * math.cos(azimuth), heading)

    def place(self, forward: Floats, right: Floats) -> tuple[Floats, Floats]:
        """East and north of points in the target's own frame, metres from its middle."""
        sine, cosine = math.sin(self.heading), math.cos(self.heading)
        return self.east + forward * sine + right * cosine, self.north + forward * cosine - right * sine

    def outline(self) -> BaseGeometry:
        """The outline on the ground, metres (east, north) from the radar."""
        corners = [np.stack(self.place(one[:, 0], one[:, 1]), axis=1) for _, one in parts_of(self.kind)]
        return union_all([Polygon(one) for one in corners])


@dataclass(frozen=True, slots=True)
class Echoes:
    """How targets answer. part_gain_db, scatterer_gain_db: standard deviation, from look to look, of the gain of each
    part and of each scatterer. specular_db: how much brighter the side of the fuselage turned to the radar is abeam; it
    falls with the fourth power of the sine of the aspect. shadow_db: how much weaker a wing is behind the fuselage.
    pulse_m: half-power length of the pulse.
    """

    part_gain_db: float = 4.0
    scatterer_gain_db: float = 3.0
    specular_db: float = 8.0
    shadow_db: float = 6.0
    pulse_m: float = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Closeup:
    """A piece of a turn of video with targets in it.

    amplitude: (rows, cells) uint8 log amplitude. first_row: row of the azimuth grid of the first row; the others follow
    clockwise, also across north. first_cell: range cell of the first column. clutter_level: mean log amplitude of the
    clutter, steps. power: (targets, rows, cells) float32, the echo of each target without its speckle, over the mean
    power of the clutter. targets: the truth. outlines: of each target the corners of its parts, each (n, 2) of row and
    cell in the piece, the centre of a cell being at whole numbers.
    """

    amplitude: NDArray[np.uint8]
    first_row: int
    first_cell: int
    clutter_level: float
    power: NDArray[np.float32]
    targets: tuple[Posed, ...]
    outlines: tuple[tuple[Floats, ...], ...]


def closeup(
    chance: np.random.Generator,
    targets: Sequence[Posed],
    snr_db: float,
    video: VideoFormat | None = None,
    *,
    margin_m: float = 12.0,
    clutter_level: float = 60.0,
    echoes: Echoes | None = None,
) -> Closeup:
    """One look at the targets.

    snr_db: the mean over each target's outline of its echo's power, over the mean power of the clutter. video: the
    radar's grid, 4096 x 1024 of 3 m with 0.18 degrees two-way resolution unless given. margin_m: ground shown about the
    outlines. Raises ValueError without targets, or when one stands so near that it surrounds the radar, or past the
    last range cell.
    """
    video, echoes = video or VideoFormat(), echoes or Echoes()
    first_row, first_cell, shape = _window(targets, video, margin_m)
    grid = (
        float(first_row), float(first_cell), video.azimuth_step_rad, video.beamwidth_rad / video.azimuth_step_rad,
        video.first_range_m, video.range_step_m, echoes.pulse_m / video.range_step_m, float(video.azimuths),
    )  # fmt: skip
    field = np.empty((*shape, 2), np.float32)
    reach = math.ceil(_REACH * grid[3])
    _speckle(chance.standard_normal((shape[0] + 2 * reach, shape[1], 2), np.float32), grid[3], field)
    power = np.zeros((len(targets), *shape), np.float32)
    for k, one in enumerate(targets):
        east, north, strength = _scatterers(chance, one, video, echoes)
        phase = chance.uniform(0.0, 2 * np.pi, len(east))
        echo = np.zeros((*shape, 2), np.float32)
        mean = _illuminate(east, north, strength, phase, grid, echo, power[k])
        scale = 10 ** (snr_db / 10) / mean
        power[k] *= scale
        field += np.float32(math.sqrt(scale)) * echo
    decibels = 10 * np.log10(np.maximum(field[..., 0] ** 2 + field[..., 1] ** 2, 1e-9)) - LOG_MEAN_DB
    amplitude = np.clip(np.rint(decibels / video.db_per_step + clutter_level), 0, 255).astype(np.uint8)
    outlines = tuple(
        tuple(np.stack(_cells(*one.place(corners[:, 0], corners[:, 1]), grid), axis=1) for _, corners in parts)
        for one, parts in ((one, parts_of(one.kind)) for one in targets)
    )
    return Closeup(amplitude, first_row % video.azimuths, first_cell, clutter_level, power, tuple(targets), outlines)


@lru_cache(maxsize=64)
def parts_of(kind: TargetType) -> tuple[tuple[int, Floats], ...]:
    """The parts of a type and their corners, (n, 2) metres forward and right of its middle."""
    half, body, span = kind.length / 2, kind.fuselage / 2, kind.width / 2
    if kind.category != TargetClass.AIRCRAFT:
        return ((BODY, np.array([[half, span], [-half, span], [-half, -span], [half, -span]])),)
    fuselage = np.array(
        [[1.0, 0.3], [0.88, 1.0], [-0.5, 1.0], [-1.0, 0.2], [-1.0, -0.2], [-0.5, -1.0], [0.88, -1.0], [1.0, -0.3]]
    ) * (half, body)
    # a wing's own middle stands a little ahead of the aircraft's, wherever its sweep puts the root
    wing = _surface(0.0, body, span, 0.155 * kind.length, 0.035 * kind.length, kind.sweep)
    centre = Polygon(wing).centroid.x
    root = 0.03 * kind.length - centre
    wing[:, 0] += root
    tail = _surface(-0.76 * half, 0.3 * body, 0.36 * span, 0.11 * kind.length, 0.05 * kind.length, kind.sweep)
    nose = root - (0.33 * span - body) * math.tan(kind.sweep) + 1.8
    engine = np.array([[nose, -0.5], [nose, 0.5], [nose - 4.0, 0.5], [nose - 4.0, -0.5]]) * (1.0, 0.5 * kind.fuselage)
    engine[:, 1] += 0.33 * span
    mirrored = np.array([1.0, -1.0])
    both_tails = np.concatenate([tail, (tail * mirrored)[::-1]])
    made = [(FUSELAGE, fuselage), (RIGHT_WING, wing), (LEFT_WING, wing * mirrored), (TAIL, both_tails)]
    if kind.engines:
        made += [(RIGHT_ENGINE, engine), (LEFT_ENGINE, engine * mirrored)]
    return tuple(made)


def _surface(nose: float, inner: float, outer: float, root: float, tip: float, sweep: float) -> Floats:
    """The corners of a wing from its inner to its outer end; root, tip: its depths there."""
    back = nose - (outer - inner) * math.tan(sweep)
    return np.array([[nose, inner], [back, outer], [back - tip, outer], [nose - root, inner]])


def _window(targets: Sequence[Posed], video: VideoFormat, margin_m: float) -> tuple[int, int, tuple[int, int]]:
    """First row (below 0 or past the grid across north), first cell, and shape."""
    if not targets:
        raise ValueError("a close-up needs a target")
    corners = [one.place(c[:, 0], c[:, 1]) for one in targets for _, c in parts_of(one.kind)]
    east, north = (np.concatenate([one[axis] for one in corners]) for axis in (0, 1))
    distance = np.hypot(east, north)
    middle = math.atan2(float(targets[0].east), float(targets[0].north))
    off = np.mod(np.arctan2(east, north) - middle + np.pi, 2 * np.pi) - np.pi
    if distance.min() < video.range_step_m or np.abs(off).max() > np.pi / 2:
        raise ValueError("a target surrounds the radar")
    margin = margin_m / distance.min() + 3 * video.beamwidth_rad
    low, high = (middle + off.min() - margin, middle + off.max() + margin)
    first_row = math.floor(low / video.azimuth_step_rad)
    rows = min(math.ceil(high / video.azimuth_step_rad) - first_row, video.azimuths)
    cells = (distance - video.first_range_m) / video.range_step_m
    margin = margin_m / video.range_step_m + 3
    first_cell = max(math.floor(cells.min() - margin), 0)
    last_cell = min(math.ceil(cells.max() + margin), video.ranges)
    if cells.max() > video.ranges - 1 or cells.min() < 0:
        raise ValueError("a target stands outside the range cells")
    return first_row, first_cell, (rows, last_cell - first_cell)


@lru_cache(maxsize=256)
def _lattice(kind: TargetType, spacing: float) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Points every `spacing` metres over the outline: forward, right, and the part that each belongs to."""
    x = np.arange(-kind.length / 2 + spacing / 2, kind.length / 2, spacing)
    y = np.arange(-kind.width / 2 + spacing / 2, kind.width / 2, spacing)
    forward, right = (one.ravel() for one in np.meshgrid(x, y, indexing="ij"))
    part = np.full(len(forward), -1)
    for name, corners in parts_of(kind):
        inside = contains_xy(Polygon(corners), forward, right)
        part[inside & ((part < 0) | (name in (RIGHT_ENGINE, LEFT_ENGINE)))] = name
    kept = part >= 0
    return forward[kept], right[kept], part[kept]


def _scatterers(
    chance: np.random.Generator, target: Posed, video: VideoFormat, echoes: Echoes
) -> tuple[Floats, Floats, Floats]:
    """East, north and power of each scatterer: several in every resolution cell, and many in the smallest target."""
    kind = target.kind
    resolution = math.hypot(target.east, target.north) * video.beamwidth_rad * video.range_step_m
    fewest = math.sqrt(min(kind.length * kind.width, kind.length * kind.fuselage) / 48)
    spacing = max(0.2, round(min(max(math.sqrt(resolution / 8), 0.35), 0.8, fewest) / 0.05) * 0.05)
    forward, right, part = _lattice(kind, spacing)
    n = len(forward)
    forward = forward + chance.uniform(-spacing / 2, spacing / 2, n)
    right = right + chance.uniform(-spacing / 2, spacing / 2, n)
    gain = _STRENGTH_DB[part] + chance.normal(0.0, echoes.part_gain_db, 7)[part]
    gain += chance.normal(0.0, echoes.scatterer_gain_db, n)
    if kind.category == TargetClass.AIRCRAFT:
        look = math.atan2(-target.east, -target.north) - target.heading
        ahead, abeam = math.cos(look), math.sin(look)
        facing = (part == FUSELAGE) & (right * np.sign(abeam) > 0.3 * kind.fuselage)
        gain[facing] += 10 * math.log10(1 + (10 ** (echoes.specular_db / 10) - 1) * abeam**4)
        wing = (part == RIGHT_WING) | (part == LEFT_WING)
        crossing = forward - right * ahead / (abeam if abeam else 1e-9)
        gain[wing & (right * abeam < 0) & (np.abs(crossing) < kind.length / 2)] -= echoes.shadow_db
    east, north = target.place(forward, right)
    return east, north, 10 ** (gain / 10)


def _cells(east: Floats, north: Floats, grid: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Row and cell, in the piece, of points on the ground."""
    row = np.arctan2(east, north) / grid[2] - 0.5 - grid[0]
    row = row - grid[7] * np.floor(row / grid[7] + 0.25)
    return row, (np.hypot(east, north) - grid[4]) / grid[5] - grid[1]


@allocating
def _speckle(white: Any, beam: float, field: Any) -> None:
    """Complex Gaussian clutter of mean power 1, correlated from row to row as the beam makes it. white: more rows."""
    rows, cells = field.shape[0], field.shape[1]
    taps = white.shape[0] - rows + 1
    weight = np.empty(taps, np.float32)
    total = 0.0
    for k in range(taps):
        a = (k - 0.5 * (taps - 1)) / beam
        weight[k] = np.exp(-1.3862943611 * a * a)
        total += 2.0 * weight[k] * weight[k]
    weight /= np.sqrt(total)
    field[:] = 0.0
    for i in range(rows):
        row = field[i]
        for k in range(taps):
            source, by = white[i + k], weight[k]
            for j in range(cells):
                row[j, 0] += by * source[j, 0]
                row[j, 1] += by * source[j, 1]


@allocating
def _illuminate(east: Any, north: Any, strength: Any, phase: Any, grid: Any, echo: Any, power: Any) -> Any:
    """Add up the echoes, coherently and in power; the mean power at the scatterers is returned."""
    first_row, first_cell, azimuth_step, beam, first_range, step, pulse, azimuths = grid
    rows, cells = power.shape
    n = east.size
    nearest = np.empty((n, 2), np.int64)
    across = np.empty(cells, np.float64)
    for c in range(n):
        row_at = np.arctan2(east[c], north[c]) / azimuth_step - 0.5 - first_row
        row_at -= azimuths * np.floor(row_at / azimuths + 0.25)
        cell_at = (np.sqrt(east[c] ** 2 + north[c] ** 2) - first_range) / step - first_cell
        nearest[c, 0] = min(max(int(row_at + 0.5), 0), rows - 1)
        nearest[c, 1] = min(max(int(cell_at + 0.5), 0), cells - 1)
        low, high = max(int(row_at - _REACH * beam), 0), min(int(row_at + _REACH * beam) + 1, rows - 1)
        near, far = max(int(cell_at - _REACH * pulse), 0), min(int(cell_at + _REACH * pulse) + 1, cells - 1)
        amplitude = np.sqrt(strength[c])
        re, im = amplitude * np.cos(phase[c]), amplitude * np.sin(phase[c])
        for j in range(near, far + 1):
            b = (j - cell_at) / pulse
            across[j] = np.exp(-1.3862943611 * b * b)
        for i in range(low, high + 1):
            a = (i - row_at) / beam
            in_beam = np.exp(-1.3862943611 * a * a)
            line, seen = echo[i], power[i]
            for j in range(near, far + 1):
                gain = in_beam * across[j]
                line[j, 0] += gain * re
                line[j, 1] += gain * im
                seen[j] += gain * gain * strength[c]
    total = 0.0
    for c in range(n):
        total += power[nearest[c, 0], nearest[c, 1]]
    return total / n
