"""How often an aircraft falls into several plots, how often two targets become one, and how well plots are placed.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4A, describes the extraction and gives no figures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pipeline import parts
from pipeline.contracts.extract import Extractor
from pipeline.detect.calibration import threshold_offset_db
from pipeline.lab.evaluate import Figure, Line, Picture, Row, Trial
from pipeline.lab.evaluate.statistics import mean_interval, rms_interval, wilson
from pipeline.lab.simulate.closeup import CLOSEUP_TYPES, Closeup, Posed, closeup
from pipeline.sites import RadarSite
from pipeline.tables import Detections, Plots, Sweeps, VideoFormat

Floats = NDArray[np.float64]

ALONE = ("B734", "A320", "AT72", "CAR", "B77W")
"""Types that are looked at alone; the first four for splits, all for the calibration of the covariance."""

PAIRS = (("CAR", "CAR", 10.0), ("CAR", "CAR", 15.0), ("B734", "CAR", 8.0), ("B734", "CAR", 15.0))
"""Types of two targets and the clear ground between their outlines, m."""

BANDS = ((0.0, 700.0, "to 700 m"), (700.0, 1000.0, "at 1 km"), (1000.0, 1500.0, "at 1.5 km"), (1500.0, 1e9, "beyond"))
"""Ranges that share a row of the table: after the first, up to and with the second."""

SPLIT, MERGED, MISSED, ERROR, NEES = range(5)

ACCURACY_M = 7.5
"""m: the position error that 95 of 100 reports of a surface movement radar must keep (EUROCAE ED-116)."""


@dataclass(frozen=True)
class Extraction:
    """One trial looks once at every scene, at every range and strength, and hands the same video to each extractor.

    extractors: parts by name, with their own settings. pfa: of the threshold over clutter of known level. snr_db: mean
    over the outline of a target, over the mean clutter.
    """

    title: ClassVar[str] = "Plots split and merged, and where they are"
    source: ClassVar[str] = "Galati et al., section 4A (eq. 1.2); no figures there"
    reading: ClassVar[str] = (
        "3 m x 0.18 degrees, 4096 azimuths; dense random scatterers over the outlines, any heading; thresholds of the "
        "hybrid detector with the clutter level known; no plot is cut before an eighth of a turn. Split: a second plot "
        "has most of its cells on the target, even "
        "if it is one cell. Merged: the plot with most cells of one target is that of the other. Error: centroid of "
        "the plot with most cells against the middle of the target. NEES/2: error squared over the plot's own "
        "covariance, 1 when honest."
    )
    trials: int = 300
    extractors: tuple[str, ...] = ("manhattan", "hysteresis")
    ranges_m: tuple[float, ...] = (100.0, 200.0, 400.0, 700.0, 1000.0, 1500.0, 2000.0, 2500.0)
    snr_db: tuple[float, ...] = (22.0, 16.0)
    pfa: float = 1e-6

    def quick(self) -> Self:
        """Fewer trials at fewer ranges."""
        return replace(self, trials=12, ranges_m=(200.0, 700.0, 1000.0, 1500.0))

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """`found`: (extractors, strengths, scenes, ranges, 5); the scenes are those ALONE, then PAIRS."""
        scenes = len(ALONE) + len(PAIRS)
        found = np.full((len(self.extractors), len(self.snr_db), scenes, len(self.ranges_m), 5), np.nan)
        tools = [_part(name) for name in self.extractors]
        for s, snr in enumerate(self.snr_db):
            for k in range(scenes):
                for r, range_m in enumerate(self.ranges_m):
                    look = closeup(chance, _targets(chance, k, range_m), snr)
                    for e, part in enumerate(tools):
                        found[e, s, k, r] = _judge(look, part, self.pfa)
        return {"found": found}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Splits and merges by band of ranges, errors, and the calibration of the covariance.

        Of all scenes at the first strength, of what matters most at the others; the figures have all."""
        found = np.stack([one["found"] for one in results])
        made: list[Row] = []
        for e, part in enumerate(self.extractors):
            for s, snr in enumerate(self.snr_db):
                what = f"{part}, {snr:g} dB"
                made += self._rates(found[:, e, s], what, s == 0, wanted=part == "hysteresis" and snr >= 20)
                made += self._calibration(found[:, e, s], what, s == 0)
        return tuple(made)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Rates, errors and calibration against range, and looks with their plots."""
        found = np.stack([one["found"] for one in results])
        pairs = range(len(ALONE), len(ALONE) + len(PAIRS))
        return (
            self._against_range(found, [0], SPLIT, "A B737 in more than one plot", "% of looks"),
            self._against_range(found, [1, 2], SPLIT, "Other aircraft in more than one plot", "% of looks"),
            *(self._against_range(found, [k], MERGED, f"{_name(k)}: one plot of both", "% of looks") for k in pairs),
            self._against_range(found, [0, 3], ERROR, "Error of the position (median)", "m"),
            self._against_range(found, range(len(ALONE)), NEES, "Covariance: NEES/2, 1 is honest", "", log_y=True),
            *(self._looks(range_m) for range_m in (self.ranges_m[0], self.ranges_m[-2])),
        )

    def _rates(self, found: Floats, what: str, whole: bool, wanted: bool) -> list[Row]:
        made = []
        kinds = range(4 if whole else 1)
        bands = [(band, one[2]) for band, one in enumerate(BANDS) if self._in_band(band).any()]
        for band, where in bands:
            bound = (5.0, 15.0, None, None)[band] if wanted else None
            made += [self._rate(found, k, band, SPLIT, f"{_name(k)} split {where}, {what}", bound) for k in kinds]
        for k in range(len(ALONE), len(ALONE) + len(PAIRS)):
            for band, where in bands if whole or PAIRS[k - len(ALONE)][2] == 15 else ():
                bound = 2.0 if wanted and band < 3 and PAIRS[k - len(ALONE)][2] == 15 else None
                made.append(self._rate(found, k, band, MERGED, f"{_name(k)} merged {where}, {what}", bound))
        for k in kinds:
            error = found[:, k, :, ERROR]
            error = error[np.isfinite(error)]
            far = int((error > ACCURACY_M).sum())
            made.append(_percent(f"{_name(k)} more than {ACCURACY_M} m off, {what}", far, error.size, None))
            rms = float(np.sqrt(np.mean(error**2)))
            made.append(Row(f"{_name(k)} rms error, {what}", rms, *rms_interval(error), "m"))
            missed = found[:, k, :, MISSED]
            made.append(_percent(f"{_name(k)} without a plot, {what}", int(missed.sum()), missed.size, None))
        return made

    def _rate(self, found: Floats, scene: int, band: int, of: int, name: str, bound: float | None) -> Row:
        values = found[:, scene, self._in_band(band), of]
        return _percent(name, int(values.sum()), values.size, bound)

    def _calibration(self, found: Floats, what: str, whole: bool) -> list[Row]:
        made = []
        everywhere = np.ones(len(self.ranges_m), np.bool_)
        bands = [(self._in_band(k), one[2]) for k, one in enumerate(BANDS)] if whole else [(everywhere, "everywhere")]
        for k in range(len(ALONE)):
            for here, where in bands:
                values = found[:, k, here, NEES].ravel()
                values = values[np.isfinite(values)]
                if len(values):
                    name = f"{_name(k)} NEES/2 {where}, {what}"
                    low, high = mean_interval(values)
                    made.append(Row(name, float(values.mean()), low, high, "", better="lower", wanted=2.0))
        return made

    def _in_band(self, band: int) -> NDArray[np.bool_]:
        low, high, _ = BANDS[band]
        ranges = np.array(self.ranges_m)
        return (ranges > low) & (ranges <= high)

    def _against_range(
        self, found: Floats, scenes: Sequence[int], of: int, title: str, unit: str, log_y: bool = False
    ) -> Figure:
        lines = []
        x = np.array(self.ranges_m)
        for e, part in enumerate(self.extractors):
            for s, snr in enumerate(self.snr_db):
                for k in scenes:
                    values = found[:, e, s, k, :, of]
                    label = f"{part}, {snr:g} dB" + (f", {_name(k)}" if len(scenes) > 1 else "")
                    if of in (SPLIT, MERGED):
                        ends = np.array([wilson(v.sum(), len(v)) for v in values.T]).T * 100
                        lines.append(Line(label, x, 100 * values.mean(axis=0), ends[0], ends[1]))
                    else:
                        middle = np.nanmedian(values, axis=0) if of == ERROR else np.nanmean(values, axis=0)
                        lines.append(Line(label, x, middle))
        if of == NEES:
            lines += [Line(f"{one:g}", x[[0, -1]], np.full(2, one), style="bound") for one in (0.5, 2.0)]
        return Figure(title, "range, m", unit, tuple(lines), log_x=True, log_y=log_y)

    def _looks(self, range_m: float) -> Figure:
        pictures = []
        for k in (0, len(ALONE) + 1, len(ALONE) + 3):
            chance = np.random.default_rng([k, int(range_m)])
            look = closeup(chance, _targets(chance, k, range_m), self.snr_db[0])
            for name in self.extractors:
                _, plots = _extract(look, _part(name), self.pfa, look.amplitude)
                pictures.append(_picture(look, plots, f"{_name(k)}: {name}, {len(plots)} plots"))
        note = "White points: the outlines of the targets; larger steps of points: the windows of the plots."
        return Figure(f"Looks at {range_m:g} m", "range, m", "azimuth, degrees", pictures=tuple(pictures), note=note)


EXPERIMENT = Extraction


def _name(scene: int) -> str:
    if scene < len(ALONE):
        return ALONE[scene]
    one, other, gap = PAIRS[scene - len(ALONE)]
    return f"{one} and {other} {gap:g} m apart"


def _targets(chance: np.random.Generator, scene: int, range_m: float) -> list[Posed]:
    azimuth, heading = chance.uniform(0.0, 2 * np.pi, 2)
    if scene < len(ALONE):
        return [Posed.at(CLOSEUP_TYPES[ALONE[scene]], range_m, azimuth, heading)]
    first, second, gap = PAIRS[scene - len(ALONE)]
    one = Posed.at(CLOSEUP_TYPES[first], range_m, azimuth, heading)
    # cars follow one another; a car stands anywhere beside an aircraft
    towards, turned = (heading, heading) if first == second else chance.uniform(0.0, 2 * np.pi, 2)
    outline = one.outline()
    low, high = 0.0, 100.0
    while high - low > 0.02:
        far = (low + high) / 2
        other = Posed(
            CLOSEUP_TYPES[second], one.east + far * math.sin(towards), one.north + far * math.cos(towards), turned
        )
        if outline.distance(other.outline()) < gap:
            low = far
        else:
            high = far
    return [one, other]


@lru_cache(maxsize=8)
def _part(name: str) -> Any:
    return parts.build("extract", name, {"max_open_runs": 4096, "max_extent_turn": 0.125})


@lru_cache(maxsize=8)
def _offset_db(pfa: float) -> float:
    return threshold_offset_db(pfa, VideoFormat().db_per_step)


def _detections(look: Closeup, pfa: float, growth_db: float | None) -> Detections:
    """What a detector finds that knows the clutter: the limits are rounded as the hybrid's are."""
    step = VideoFormat().db_per_step

    def above(offset_db: float) -> NDArray[np.uint64]:
        cells = look.amplitude > math.floor(look.clutter_level + offset_db / step + 0.5)
        padded = np.zeros((len(cells), -(-cells.shape[1] // 64) * 64), np.bool_)
        padded[:, : cells.shape[1]] = cells
        return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)

    return Detections(above(_offset_db(pfa)), growth=None if growth_db is None else above(growth_db))


def _extract(look: Closeup, part: Extractor, pfa: float, amplitude: NDArray[np.uint8]) -> tuple[Detections, Plots]:
    """The plots of a look; amplitude: what they are to be measured on."""
    grid = VideoFormat()
    cells = look.amplitude.shape[1]
    video = replace(grid, ranges=cells, first_range_m=grid.first_range_m + look.first_cell * grid.range_step_m)
    found = _detections(look, pfa, getattr(part, "growth_db", None))
    state = part.start(RadarSite("closeup", 0.0, 0.0, 0.0, video))
    made = []
    row = look.first_row + np.arange(len(amplitude))
    for scan in (0, 1):
        here = row // grid.azimuths == scan
        if not here.any():
            continue
        on_grid = (row[here] % grid.azimuths).astype(np.int32)
        azimuth = (on_grid + 0.5) * grid.azimuth_step_rad
        growth = None if found.growth is None else found.growth[here]
        sweeps = Sweeps(0, scan, on_grid, azimuth, azimuth + scan, amplitude[here])
        made.append(part(sweeps, Detections(found.mask[here], growth=growth), state))
    return found, Plots.concatenate([*made, part.flush(state)])


def _judge(look: Closeup, part: Extractor, pfa: float) -> Floats:
    """SPLIT and MERGED and MISSED as 0 or 1, ERROR in metres and NEES/2 (nan where there is no plot)."""
    _, plots = _extract(look, part, pfa, look.amplitude)
    if not len(plots):
        return np.array([0.0, 0.0, 1.0, np.nan, np.nan])
    # a cell is of the target that answers most in it; the mean of 1 over such cells tells which part of a plot they are
    whose = np.where(look.power.max(axis=0) > 1, look.power.argmax(axis=0), -1)
    part_of = np.empty((len(look.targets), len(plots)))
    for t in range(len(look.targets)):
        marked = _extract(look, part, pfa, (whose == t).astype(np.uint8))[1]
        part_of[t] = marked.mean_amplitude
    cells = part_of * plots.cells
    main = cells.argmax(axis=1)
    missed = bool((cells.max(axis=1) == 0).any())
    merged = len(look.targets) > 1 and not missed and main[0] == main[1]
    split = (part_of[0] > 0.5).sum() > 1
    if cells[0].max() == 0:
        return np.array([split, merged, missed, np.nan, np.nan], float)
    at = main[0]
    error = np.array([plots.east[at] - look.targets[0].east, plots.north[at] - look.targets[0].north])
    nees = error @ np.linalg.solve(plots.covariance[at], error) / 2
    return np.array([split, merged, missed, math.hypot(*error), nees], float)


def _percent(name: str, hits: int, tries: int, bound: float | None) -> Row:
    low, high = wilson(hits, tries)
    return Row(name, 100 * hits / tries, 100 * low, 100 * high, "%", better="lower", wanted=bound)


def _picture(look: Closeup, plots: Plots, label: str) -> Picture:
    grid = VideoFormat()
    rows, cells = look.amplitude.shape
    step, turn = np.rad2deg(grid.azimuth_step_rad), grid.azimuths
    left = look.first_cell * grid.range_step_m
    extent = (
        left - grid.range_step_m / 2, left + (cells - 0.5) * grid.range_step_m,
        (look.first_row + rows) * step, look.first_row * step,
    )  # fmt: skip
    marks = [_along(corners, 24) for one in look.outlines for corners in one]
    for first, high, near, wide in plots.window:
        top = (first - look.first_row) % turn - 0.5
        side = near - 0.5
        box = np.array([[top, side], [top, side + wide], [top + high, side + wide], [top + high, side]])
        marks.append(_along(box, 6))
    at = np.concatenate(marks)
    points = np.stack([left + at[:, 1] * grid.range_step_m, (look.first_row + at[:, 0] + 0.5) * step], axis=1)
    return Picture(label, look.amplitude, extent, "step", points)


def _along(corners: Floats, many: int) -> Floats:
    """Points along each side of a polygon."""
    share = (np.arange(many) / many)[:, None, None]
    return ((1 - share) * corners + share * np.roll(corners, -1, axis=0)).reshape(-1, 2)
