"""Rain over ground that had been learned dry: how many false alarms it makes, and what is still detected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.lab.evaluate import Figure, Line, Row, Trial
from pipeline.lab.evaluate.cfar_cases import BINS, Case, Watch, every_part, false_alarms, labels, margins, shift_for
from pipeline.lab.evaluate.cfar_law import Law
from pipeline.lab.evaluate.cfar_scenes import HELD_OUT_SCENE, HETEROGENEOUS, ground_of
from pipeline.lab.evaluate.cfar_targets import POINT, SHIFTS, Numbers, detection, place
from pipeline.lab.evaluate.ground import Rain, Scene
from pipeline.lab.evaluate.statistics import mean_interval


@dataclass(frozen=True)
class CfarRain:
    """A shower drifts over the scene.

    detectors, pfa, snr_db: as in cfar-scenes. scenes: which. rates: mm/h. learn_scans: dry before it rains; the targets
    come `early` scans before that. every: scans between two that are measured.
    """

    title: str = "Rain over learned ground: peak Pfa, and Pd during it"
    source: str = "Galati et al., section 3: rain up to 16 mm/h; no figures"
    reading: str = (
        "a convective cell (13 dB over asphalt in its middle at 16 mm/h, Gaussian, 200 m) drifts at 8 m/s over"
        " stratiform rain (3 dB at 16 mm/h); both swell for 20 scans, stay for 40, fade for 20; power follows the rate"
        " by its power of 1.6 and adds to the ground's; no attenuation. Peak: the worst scan of the mean over scene and"
        " trials. At equal Pfa: limits raised so that the last dry scan has the nominal Pfa"
    )
    trials: int = 10
    detectors: tuple[Case, ...] = field(default_factory=every_part)
    scenes: tuple[str, ...] = (HETEROGENEOUS, HELD_OUT_SCENE)
    rates: tuple[float, ...] = (4.0, 16.0)
    pfa: float = 1e-6
    snr_db: float = 20.5
    learn_scans: int = 120
    early: int = 20
    every: int = 2

    def quick(self) -> Self:
        """One trial of the heaviest rain over the held-out scene."""
        return replace(self, trials=1, scenes=self.scenes[-1:], rates=self.rates[-1:], every=4)

    @property
    def measured(self) -> NDArray[np.int64]:
        """Scans relative to the beginning of the rain; the first is the last dry one."""
        return np.array([-1, *range(0, Rain().scans, self.every)], np.int64)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """For each scene and rate: margins (detectors, measured, bins) and pd of points (detectors, measured,
        SHIFTS)."""
        found: dict[str, NDArray[np.generic]] = {}
        for scene in self.scenes:
            built = ground_of(scene, number).build()
            for rate in self.rates:
                counts, pd = self._watch(built, chance, Rain(rate=rate, begin=self.learn_scans))
                found |= {f"{scene}.{rate}.margins": counts, f"{scene}.{rate}.pd": pd}
        return found

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Peak Pfa and mean Pd, at the nominal setting and at equal Pfa when dry."""
        rows: list[Row] = []
        names = labels(self.detectors)
        for scene in self.scenes:
            for rate in self.rates:
                alarm, pd, equal_alarm, equal_pd = self._curves(results, scene, rate)
                head = f"{scene}, {rate:g} mm/h:"
                for d, label in enumerate(names):
                    wanted = 1e-5 if label == "adaptive" else None
                    rows.append(_peak(f"{head} {label}, peak Pfa, nominal", alarm[:, d, 1:], wanted))
                for d, label in enumerate(names):
                    rows.append(_mean(f"{head} {label}, Pd of fixed points, nominal", pd[:, d, 1:]))
                for d, label in enumerate(names[:-1]):
                    rows.append(_peak(f"{head} {label}, peak Pfa, equal Pfa when dry", equal_alarm[:, d, 1:], None))
                    rows.append(_mean(f"{head} {label}, Pd of fixed points, equal Pfa when dry", equal_pd[:, d, 1:]))
        return tuple(rows)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Pfa and Pd over the scans of the rain."""
        made = []
        scans = self.measured.astype(np.float64)
        for scene in self.scenes:
            for rate in self.rates:
                alarm, pd, *_ = self._curves(results, scene, rate)
                lines, seen = [], []
                for d, label in enumerate(labels(self.detectors)):
                    lines.append(Line(label, scans, np.maximum(alarm[:, d].mean(axis=0), 1e-9)))
                    seen.append(Line(label, scans, 100 * pd[:, d].mean(axis=0)))
                lines.append(Line("wanted", scans, np.full(len(scans), 1e-5), style="bound"))
                what = f"{rate:g} mm/h over the {scene} scene, nominal setting"
                across = "scan since the rain began"
                made.append(Figure(f"Pfa, {what}", across, "mean Pfa", tuple(lines), log_y=True))
                made.append(Figure(f"Fixed points, {what}", across, "Pd, %", tuple(seen)))
        return tuple(made)

    def _watch(
        self, scene: Scene, chance: np.random.Generator, rain: Rain
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        targets = place(scene, chance, self.snr_db, Numbers(aircraft=4, points=40, slow=0, fast=0, grass=0))
        watch = Watch(self.detectors, scene, self.pfa)
        kind = np.where(targets.near, -1, 0)
        many, measured = len(self.detectors) + 1, list(self.measured + rain.begin)
        counts = np.zeros((many, len(measured), BINS + 1), np.float32)
        pd = np.full((many, len(measured), len(SHIFTS)), np.nan)
        for scan in range(measured[-1] + 1):
            mean = scene.mean_db(scan, rain)
            cells, kinds = targets.cells(scan - rain.begin + self.early)
            block = scene.sweeps(scan, scene.amplitude(chance, mean, (cells, targets.power_db[kinds])))
            if scan not in measured:
                watch.learn(block)
                continue
            at = measured.index(scan)
            for d, (limit, _) in enumerate(watch.measure(block, mean)):
                counts[d, at] = margins(limit, mean, kind, 1)[0]
                pd[d, at] = detection(limit, mean, targets, cells, kinds)[POINT]
        return counts, pd

    def _curves(self, results: Sequence[Trial], scene: str, rate: float) -> tuple[NDArray[np.float64], ...]:
        """Pfa and Pd (trials, detectors, measured) at the nominal setting; the same at equal Pfa when dry."""
        law = Law()
        counts = np.stack([one[f"{scene}.{rate}.margins"] for one in results]).astype(np.float64)
        pd = np.stack([one[f"{scene}.{rate}.pd"] for one in results])
        shift = np.array([shift_for(one, law, self.pfa) for one in counts[:, :, 0].sum(axis=0)])
        made = np.zeros((4, *counts.shape[:3]))
        for k, d, a in np.ndindex(counts.shape[:3]):
            for at, raised in ((0, 0.0), (2, float(shift[d]))):
                made[at, k, d, a] = false_alarms(counts[k, d, a], law, raised)
                made[at + 1, k, d, a] = np.interp(raised, SHIFTS, pd[k, d, a])
        return tuple(made)


EXPERIMENT = CfarRain


def _peak(name: str, alarm: NDArray[np.float64], wanted: float | None) -> Row:
    """Of (trials, scans): the mean of the worst scan."""
    worst = alarm[:, int(alarm.mean(axis=0).argmax())]
    low, high = mean_interval(worst)
    return Row(name, float(worst.mean()), max(low, 0.0), high, "", better="lower", wanted=wanted)


def _mean(name: str, pd: NDArray[np.float64]) -> Row:
    """Of (trials, scans): the mean, in %."""
    trials = 100 * pd.mean(axis=1)
    low, high = mean_interval(trials)
    return Row(name, float(trials.mean()), max(low, 0.0), min(high, 100.0), "%", better="higher")
