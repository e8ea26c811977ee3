"""How well each estimator finds where an aircraft points, over ranges and types."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label

from pipeline.contracts.bearing import Expected, TargetView
from pipeline.kernels.scan_convert import grid_of, scan_converted
from pipeline.lab.evaluate import Figure, Line, Picture, Row, Trial
from pipeline.lab.evaluate.statistics import mean_interval, rms_interval, wilson
from pipeline.lab.simulate.closeup import CLOSEUP_TYPES, Posed, closeup
from pipeline.parts import build
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

SITE = RadarSite("smr", 0.0, 0.0, 0.0, VideoFormat())

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "Hough, weighted": ("hough", {"weighted": True}),
    "Hough, binary": ("hough", {"weighted": False}),
    "moments, weighted": ("moments", {"weighted": True}),
    "moments, binary": ("moments", {"weighted": False}),
    "template correlation": ("template", {}),
    "H/C": ("hough_template", {}),
    "ml": ("ml", {}),
}
"""What the table calls each part and its settings."""

SLOW = "template correlation"
CORE_DEG = 25.0
DETECTED_DB = 13.83
"""Above the mean log amplitude of the ground: 1e-6 false alarms a cell of Rayleigh clutter."""

LINKED_M = 3.0
PICTURE, PIXEL_M = 64, 1.0

Errors = NDArray[np.float64]


@dataclass(frozen=True)
class BearingExperiment:
    """types, ranges_m: of which and where. snr_db: mean over the aircraft. prior_deg: standard deviation of the heading
    that a track expects, where one is given. template_every: the full correlation does only every so many trials.
    """

    title: str = "Bearing of an aircraft from its picture"
    source: str = "Galati et al., section 4B"
    reading: str = (
        "3 m x 0.18 degrees (two-way), 4096 azimuths, 8-bit log video over Rayleigh ground; dense scatterers of random"
        " phase, per look 4 dB of random gain a part and 3 dB a scatterer, near side of the fuselage specular, far wing"
        " in its shadow; heading and azimuth uniform; the plot is the largest group of cells 13.83 dB over the mean"
        " log ground, linked over 3 m. Errors modulo 180 degrees; core: those under 25 degrees (the paper's figures"
        " can only be that: with wings taken for fuselages none would stay below 6.5). With an expected heading the"
        " sense counts, too. The templates are of types from A320 to B77W, without the 737-400 that is seen; ml knows"
        " no type. Echo and templates are plain planforms, though drawn apart: expect more error on real aircraft."
    )
    trials: int = 200
    types: tuple[str, ...] = ("B734", "A320", "AT72", "A332")
    ranges_m: tuple[float, ...] = (100.0, 200.0, 400.0, 700.0, 1000.0, 1500.0)
    snr_db: float = 22.0
    prior_deg: float = 5.0
    template_every: int = 10

    def quick(self) -> Self:
        """Two types at two ranges."""
        return replace(self, trials=20, types=("B734", "AT72"), ranges_m=(400.0, 1000.0), template_every=20)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """One look at each type at each range by every method, without and with an expected heading.

        error, scaled: (methods, 2, types, ranges) degrees, and over the standard deviation given; nan without a
        bearing. asked: whether the method was asked. seconds: (methods, types, ranges).
        """
        shape = (len(METHODS), 2, len(self.types), len(self.ranges_m))
        error, scaled = np.full(shape, np.nan), np.full(shape, np.nan)
        asked = np.zeros(shape, bool)
        seconds = np.full((shape[0], *shape[2:]), np.nan)
        parts = {name: build("bearing", *chosen) for name, chosen in METHODS.items()}
        if number % self.template_every:
            del parts[SLOW]
        states = {name: part.start(SITE) for name, part in parts.items()}
        shown: dict[str, NDArray[Any]] = {}
        for t, kind in enumerate(self.types):
            for r, range_m in enumerate(self.ranges_m):
                azimuth, heading = chance.uniform(0, 2 * math.pi, 2)
                seen = _look(chance, kind, range_m, azimuth, heading, self.snr_db)
                spread = math.radians(self.prior_deg)
                expected = Expected(float((heading + chance.normal(0, spread)) % (2 * math.pi)), spread)
                for m, name in enumerate(METHODS):
                    if name not in parts or seen is None:
                        continue
                    for p, prior in enumerate((None, expected)):
                        begin = clock()
                        made = parts[name](seen, prior, states[name])
                        if prior is None:
                            seconds[m, t, r] = clock() - begin
                        asked[m, p, t, r] = True
                        error[m, p, t, r] = _error(made.bearing, heading, 2 * math.pi if made.nose_known else math.pi)
                        scaled[m, p, t, r] = error[m, p, t, r] / math.degrees(made.sd)
                        if number == 0 and t == 0 and prior is None:
                            shown[f"axis {name} {range_m:g}"] = np.array([made.bearing])
                if number == 0 and t == 0 and seen is not None:
                    shown[f"picture {range_m:g}"] = _picture(seen, azimuth, range_m)
                    shown[f"truth {range_m:g}"] = np.array([heading])
        return {"error": error, "scaled": scaled, "asked": asked, "seconds": seconds, **shown}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """The paper's figures, what is wanted, then every method and type over all ranges."""
        error = np.stack([one["error"] for one in results])
        scaled = np.stack([one["scaled"] for one in results])
        asked = np.stack([one["asked"] for one in results])
        seconds = np.stack([one["seconds"] for one in results])
        far = np.array(self.ranges_m) >= 400
        at = {name: k for k, name in enumerate(METHODS)}
        made = [*self._of_the_paper(error, at), *self._wanted(error, scaled, far, at)]
        for k, name in enumerate(METHODS):
            made.append(_time(f"time a target, {name}", seconds[:, k]))
        for k, name in enumerate(METHODS):
            for p, given in enumerate(("", ", expected heading")):
                if p and name not in (SLOW, "ml"):
                    continue
                for t, kind in enumerate(self.types):
                    made += _three(f"{name}{given}, {kind}", error[:, k, p, t])
                made += _without(f"{name}{given}, all types: without a bearing", error[:, k, p], asked[:, k, p])
        return tuple(made)

    def _of_the_paper(self, error: Errors, at: dict[str, int]) -> list[Row]:
        def core(name: str, choose: Callable[[list[float]], float]) -> tuple[float, float, float]:
            each = [_core(error[:, at[name], 0, 0, r]) for r in range(len(self.ranges_m))]
            values = [_rms(one) for one in each]
            chosen = each[values.index(choose(values))]
            return (_rms(chosen), *rms_interval(chosen)) if len(chosen) else (math.nan, math.nan, math.nan)

        kind = self.types[0]
        # these are the paper's own methods: near its figure or not, there is nothing to beat
        return [
            Row(f"Hough, {kind}: core rms at the worst range", *core("Hough, binary", max), "deg", 6.5, 1.5),
            Row(f"moments, {kind}: core rms at the best range", *core("moments, weighted", min), "deg", 12.5, 1.5),
            Row(f"H/C, {kind}: core rms at the worst range", *core("H/C", max), "deg", 3.0, 1.0),
        ]

    def _wanted(self, error: Errors, scaled: Errors, far: NDArray[np.bool_], at: dict[str, int]) -> list[Row]:
        kind, m = self.types[0], at["ml"]
        prior = error[:, m, 1, 0]
        name = f"ml, {kind}, expected heading"
        square = np.square(scaled[:, m])
        return [
            *_rms_row(f"ml, {kind}, 400 m and more: all-trials rms", error[:, m, 0, 0][:, far], 3.5),
            *_rms_row(f"{name}: all-trials rms", prior, 2.0),
            *_gross_row(f"{name}: gross errors", prior, 0.0),
            *_square_row("ml: mean square of core error over its sd", square[:, 0], error[:, m, 0]),
            *_square_row("ml, expected heading: mean square of core error over its sd", square[:, 1], error[:, m, 1]),
        ]

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Error against range for each method and type, and an example with the axes that were found."""
        error = np.stack([one["error"] for one in results])
        made = []
        for t, kind in enumerate(self.types):
            lines = [(name, error[:, k, 0, t]) for k, name in enumerate(METHODS)]
            lines.append(("ml, expected heading", error[:, len(METHODS) - 1, 1, t]))
            core = tuple(self._line(name, one) for name, one in lines)
            note = "Errors of 25 degrees and more are left out here. Bands: 95 %."
            made.append(Figure(f"Core rms, {kind}", "range, m", "rms, deg", core, log_y=True, note=note))
            gross = tuple(self._gross(name, one) for name, one in lines)
            note = "Errors of 25 degrees and more, mostly a wing taken for the fuselage."
            made.append(Figure(f"Gross errors, {kind}", "range, m", "%", gross, note=note))
        return (*made, *self._examples(results[0] if results else {}))

    def _line(self, name: str, error: Errors) -> Line:
        each = [_core(error[:, r]) for r in range(len(self.ranges_m))]
        bounds = np.array([rms_interval(one) if len(one) else (math.nan, math.nan) for one in each])
        values = np.array([_rms(one) for one in each])
        return Line(name, np.array(self.ranges_m), values, bounds[:, 0], bounds[:, 1])

    def _gross(self, name: str, error: Errors) -> Line:
        each = [_given(error[:, r]) for r in range(len(self.ranges_m))]
        values = [100 * float(np.mean(np.abs(one) >= CORE_DEG)) if len(one) else math.nan for one in each]
        return Line(name, np.array(self.ranges_m), np.array(values))

    def _examples(self, first: Trial) -> tuple[Figure, ...]:
        made = []
        half = PICTURE * PIXEL_M / 2
        for range_m in self.ranges_m:
            if f"picture {range_m:g}" not in first:
                continue
            found = {"truth": first[f"truth {range_m:g}"]}
            found |= {
                name: first[f"axis {name} {range_m:g}"] for name in METHODS if f"axis {name} {range_m:g}" in first
            }
            pictures = tuple(
                Picture(
                    f"{name}: {math.degrees(float(axis[0])):.1f}°", first[f"picture {range_m:g}"],
                    (-half, half, -half, half), "step", _marks(float(axis[0]), half)
                )
                for name, axis in found.items() if name in ("truth", "Hough, binary", "moments, binary", "H/C", "ml")
            )  # fmt: skip
            title = f"{self.types[0]} at {range_m:g} m, north up, and the axes that were found"
            made.append(Figure(title, "east, m", "north, m", pictures=pictures))
        return tuple(made)


def _look(
    chance: np.random.Generator, kind: str, range_m: float, azimuth: float, heading: float, snr_db: float
) -> TargetView | None:
    """A close-up and the window of its largest group of detected cells."""
    video = SITE.video
    seen = closeup(chance, [Posed.at(CLOSEUP_TYPES[kind], range_m, azimuth, heading)], snr_db, video)
    detected = seen.amplitude > seen.clutter_level + DETECTED_DB / video.db_per_step
    reach = max(1, round(LINKED_M / (range_m * video.azimuth_step_rad) / 2))
    groups, count = label(binary_dilation(detected, np.ones((2 * reach + 1, 3), bool)))
    if count == 0:
        return None
    groups = np.where(detected, groups, 0)
    largest = int(np.bincount(groups.ravel())[1:].argmax()) + 1
    rows, cells = np.nonzero(groups == largest)
    top, near = int(rows.min()), int(cells.min())
    return TargetView(
        amplitude=seen.amplitude,
        azimuth=(seen.first_row + 0.5) * video.azimuth_step_rad % (2 * math.pi),
        range_m=video.first_range_m + seen.first_cell * video.range_step_m,
        plot=(top, int(rows.max()) - top + 1, near, int(cells.max()) - near + 1),
    )


def _picture(seen: TargetView, azimuth: float, range_m: float) -> NDArray[np.float32]:
    grid = grid_of(SITE, seen.azimuth, seen.range_m)
    place = (range_m * math.sin(azimuth), range_m * math.cos(azimuth))
    return scan_converted(seen.amplitude, grid, place, step=PIXEL_M, size=PICTURE)


def _marks(axis: float, half: float) -> NDArray[np.float64]:
    """Points along an axis."""
    along = np.linspace(-0.9 * half, 0.9 * half, 25)
    return np.stack([along * math.sin(axis), along * math.cos(axis)], axis=1)


def _error(bearing: float, heading: float, around: float) -> float:
    return math.degrees((bearing - heading + around / 2) % around - around / 2)


def _given(error: Errors) -> Errors:
    return error[np.isfinite(error)]


def _core(error: Errors) -> Errors:
    given = _given(error)
    return given[np.abs(given) < CORE_DEG]


def _rms(error: Errors) -> float:
    return float(np.sqrt(np.mean(np.square(error)))) if len(error) else math.nan


def _percent(hits: int, tries: int) -> tuple[float, float]:
    low, high = wilson(hits, tries)
    return 100 * low, 100 * high


def _time(name: str, seconds: Errors) -> Row:
    each = 1e6 * _given(seconds)
    if not len(each):
        return Row(name, math.nan, math.nan, math.nan, "us", repeatable=False)
    each.sort()
    # the order statistics between which the median lies with 95 %
    half = 0.98 * math.sqrt(len(each))
    low, high = (each[round(min(max(len(each) / 2 + by, 0), len(each) - 1))] for by in (-half, half))
    middle = np.median(each)
    wanted = 3000.0 if name.endswith(" ml") else None
    return Row(name, float(middle), float(low), float(high), "us", better="lower", wanted=wanted, repeatable=False)


def _three(name: str, error: Errors) -> list[Row]:
    return [
        *_rms_row(f"{name}: core rms", _core(error)),
        *_gross_row(f"{name}: gross errors", error),
        *_rms_row(f"{name}: all-trials rms", error),
    ]


def _rms_row(name: str, error: Errors, wanted: float | None = None) -> list[Row]:
    given = _given(error)
    if not len(given):
        return []
    return [Row(name, _rms(given), *rms_interval(given), "deg", better="lower", wanted=wanted)]


def _gross_row(name: str, error: Errors, wanted: float | None = None) -> list[Row]:
    given = _given(error)
    if not len(given):
        return []
    gross = len(given) - len(_core(error))
    return [Row(name, 100 * gross / len(given), *_percent(gross, len(given)), "%", better="lower", wanted=wanted)]


def _square_row(name: str, square: Errors, error: Errors) -> list[Row]:
    core = square[np.abs(error) < CORE_DEG]
    return [Row(name, float(core.mean()), *mean_interval(core), "")] if len(core) else []


def _without(name: str, error: Errors, asked: NDArray[np.bool_]) -> list[Row]:
    tries = int(asked.sum())
    none = tries - len(_given(error))
    return [Row(name, 100 * none / tries, *_percent(none, tries), "%")] if tries else []


EXPERIMENT = BearingExperiment
