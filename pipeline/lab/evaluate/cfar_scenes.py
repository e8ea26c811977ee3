"""All detectors over ground that is known in every cell: Pd at equal Pfa, and the Pfa of their nominal settings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.lab.evaluate import Figure, Line, Picture, Row, Trial
from pipeline.lab.evaluate.cfar_cases import BINS, Case, Watch, every_part, false_alarms, labels, margins, shift_for
from pipeline.lab.evaluate.cfar_law import Law
from pipeline.lab.evaluate.cfar_targets import (
    BESIDE,
    EXTENDED,
    FAST,
    GRASS,
    KINDS,
    POINT,
    SHIFTS,
    SLOW,
    detection,
    place,
)
from pipeline.lab.evaluate.ground import SURFACES, Ground, Scene
from pipeline.lab.evaluate.statistics import mean_interval

HOMOGENEOUS, HETEROGENEOUS, HELD_OUT_SCENE = SCENES = ("homogeneous", "heterogeneous", "held out")
JUDGED = (BESIDE, EXTENDED, POINT, SLOW, FAST)
"""Kinds of target that Airside wants to be seen as well as by a detector that knew the clutter, less four points."""


def ground_of(scene: str, number: int) -> Ground:
    """The ground of trial `number`."""
    make = {
        HOMOGENEOUS: Ground.homogeneous, HETEROGENEOUS: Ground.heterogeneous, HELD_OUT_SCENE: Ground.held_out,
    }[scene]  # fmt: skip
    return make(number)


@dataclass(frozen=True)
class CfarScenes:
    """Detectors learn a scene, then targets come and stay.

    detectors: which. pfa: nominal, and at which Pd are compared. snr_db: of all targets over the mean log power of
    their surface. learn_scans: before they come. ages: scans after that in which is measured, the first being 1; those
    of `listed` are in the table.
    """

    title: str = "Pd at equal Pfa, and real Pfa, over homogeneous and mixed ground"
    source: str = "Galati et al., section 3C, figure 4"
    reading: str = (
        "512 x 256 cells of 3 m, macro-cells of about 650 cells; Rayleigh speckle independent from cell to cell and"
        " scan to scan; Swerling 3 targets 20.5 dB over the mean log power of their surface; the map knows grass, not"
        " which, and is wrong by one cell in azimuth and range. Pfa and Pd are integrated over the known law of every"
        " cell, given the thresholds that the detector had learned. For equal Pfa all thresholds of a detector are"
        " raised by one offset, for each scan anew, after the fact: what it learned is that of the nominal setting."
        " Seeds of the development scenes: the trial's number; held out: 1,000,000 more"
    )
    trials: int = 12
    detectors: tuple[Case, ...] = field(default_factory=every_part)
    scenes: tuple[str, ...] = SCENES
    pfa: float = 1e-6
    snr_db: float = 20.5
    learn_scans: int = 70
    ages: tuple[int, ...] = (1, 5, 15, 30, 60, 120)
    listed: tuple[int, ...] = (1, 15, 120)

    def quick(self) -> Self:
        """One trial, fewer scans measured."""
        return replace(self, trials=1, ages=self.listed)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """For each scene: margins (detectors, ages, surfaces, bins), pd (detectors, ages, kinds, SHIFTS); in the first
        trial also what was detected, as bits, and the scene."""
        found: dict[str, NDArray[np.generic]] = {}
        for name in self.scenes:
            scene = ground_of(name, number).build()
            made = self._watch(scene, chance, pictures=number == 0 and name == HETEROGENEOUS)
            found |= {f"{name}.{key}": value for key, value in made.items()}
        return found

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """What Airside asks of itself and figure 4 first; then Pfa, offsets and Pd of each scene."""
        tables = {name: _Table(self, name, results) for name in self.scenes}
        rows: list[Row] = []
        if HOMOGENEOUS in tables:
            rows += _figure_4(tables[HOMOGENEOUS], self)
            rows += _beside_hybrid(tables[HOMOGENEOUS], self)
        for table in tables.values():
            rows += table.alarm_rows()
        for table in tables.values():
            rows += table.detection_rows()
        return tuple(rows)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Pd at equal Pfa and real Pfa over the scans; the detections over the scene, as in the paper's figure 4."""
        made = []
        scans = np.array(self.ages, np.float64)
        for name in self.scenes:
            table = _Table(self, name, results)
            names = labels(self.detectors)
            for kind in (BESIDE, POINT):
                lines = tuple(
                    Line(label, scans, np.array([table.detected(d, a, kind)[0] for a in range(len(scans))]))
                    for d, label in enumerate(names)
                )
                made.append(Figure(f"{KINDS[kind].capitalize()}, {name} scene, equal Pfa", "scan", "Pd, %", lines))
            alarm = tuple(
                Line(label, scans, np.array([max(table.alarms(d, a)[0], 1e-9) for a in range(len(scans))]))
                for d, label in enumerate(names[:-1])
            )
            made.append(Figure(f"Real Pfa, {name} scene", "scan", "Pfa at the nominal setting", alarm, log_y=True))
        first = results[0]
        if f"{HETEROGENEOUS}.seen" in first:
            made += _pictures(self, first)
        return tuple(made)

    def _watch(self, scene: Scene, chance: np.random.Generator, pictures: bool) -> dict[str, NDArray[np.generic]]:
        targets = place(scene, chance, self.snr_db)
        watch = Watch(self.detectors, scene, self.pfa)
        kind = np.where(targets.near, -1, scene.kind.astype(np.int64))
        many = len(self.detectors) + 1
        counts = np.zeros((many, len(self.ages), len(SURFACES), BINS + 1), np.float32)
        pd = np.full((many, len(self.ages), len(KINDS), len(SHIFTS)), np.nan)
        seen = np.zeros((many, len(self.ages), *scene.kind.shape), bool)
        for scan in range(self.learn_scans + max(self.ages)):
            age = scan - self.learn_scans
            mean = scene.mean_db(scan)
            cells, kinds = targets.cells(age)
            block = scene.sweeps(scan, scene.amplitude(chance, mean, (cells, targets.power_db[kinds])))
            if age + 1 not in self.ages:
                watch.learn(block)
                continue
            at = self.ages.index(age + 1)
            for d, (limit, detected) in enumerate(watch.measure(block, mean)):
                counts[d, at] = margins(limit, mean, kind, len(SURFACES))
                pd[d, at] = detection(limit, mean, targets, cells, kinds)
                seen[d, at] = detected
        made: dict[str, NDArray[np.generic]] = {"margins": counts, "pd": pd}
        if pictures:
            made |= {"seen": np.packbits(seen[:, [0, -1]], axis=-1), "kind": scene.kind}
        return made


EXPERIMENT = CfarScenes


class _Table:
    """The figures of one scene, over all trials."""

    def __init__(self, experiment: CfarScenes, scene: str, results: Sequence[Trial]) -> None:
        self.experiment, self.scene, self.law = experiment, scene, Law()
        self.counts = np.stack([one[f"{scene}.margins"] for one in results]).astype(np.float64)
        self.pd = np.stack([one[f"{scene}.pd"] for one in results])
        self.names = labels(experiment.detectors)
        pooled = self.counts.sum(axis=0)
        self.shift = np.array([[shift_for(one, self.law, experiment.pfa) for one in ages] for ages in pooled])

    def alarms(self, d: int, a: int, surface: int | None = None) -> tuple[float, float, float]:
        """Mean Pfa at the nominal setting, and its interval."""
        chosen = self.counts[:, d, a] if surface is None else self.counts[:, d, a, surface : surface + 1]
        trials = np.array([false_alarms(one, self.law) for one in chosen])
        low, high = mean_interval(trials)
        return float(trials.mean()), max(low, 0.0), high

    def detected(self, d: int, a: int, kind: int) -> tuple[float, float, float]:
        """Pd in % at equal Pfa, and its interval."""
        values = np.array([np.interp(self.shift[d, a], SHIFTS, one) for one in self.pd[:, d, a, kind]]) * 100
        values = values[np.isfinite(values)]
        if not len(values):
            return (float("nan"),) * 3
        low, high = mean_interval(values)
        return float(values.mean()), max(low, 0.0), min(high, 100.0)

    def listed(self, d: int) -> Iterator[tuple[int, int]]:
        """(index, scan) of the scans of the table; what does not learn is told for the last alone."""
        learns = d < len(self.experiment.detectors) and self.experiment.detectors[d].learns
        scans = self.experiment.listed if learns else self.experiment.listed[-1:]
        yield from ((self.experiment.ages.index(scan), scan) for scan in scans)

    def alarm_rows(self) -> Iterator[Row]:
        """Real Pfa, and the offset that would bring it to the nominal one."""
        last = self.experiment.ages.index(self.experiment.listed[-1])
        learned = self.experiment.learn_scans
        for d, label in enumerate(self.names[:-1]):
            for a, scan in self.listed(d):
                wanted = None
                if label == "adaptive" and self.scene == HELD_OUT_SCENE:
                    wanted = {1: 3e-5, 120: 3e-6}.get(scan)
                name = f"{self.scene}: {label}, Pfa at the nominal setting after {learned - 1 + scan} scans"
                yield Row(name, *self.alarms(d, a), "", better="lower", wanted=wanted)
            if self.scene == HETEROGENEOUS:
                for surface, what in enumerate(SURFACES):
                    yield Row(f"{self.scene}: {label}, the same, on {what}, scan {self.experiment.listed[-1]}",
                              *self.alarms(d, last, surface), "")  # fmt: skip
            value = float(self.shift[d, last])
            yield Row(f"{self.scene}: {label}, offset needed for equal Pfa, scan {self.experiment.listed[-1]}",
                      value, value, value, "dB")  # fmt: skip

    def detection_rows(self) -> Iterator[Row]:
        """Pd at equal Pfa."""
        for kind, what in enumerate(KINDS):
            if kind == GRASS and self.scene == HOMOGENEOUS:
                continue
            for d, label in enumerate(self.names):
                for a, scan in self.listed(d):
                    asked = label == "adaptive" and kind in JUDGED and self.scene != HOMOGENEOUS
                    name = f"{self.scene}: {what}, {label}, scan {scan}"
                    yield Row(name, *self.detected(d, a, kind), "%", better="higher", wanted=88.0 if asked else None)


def _figure_4(table: _Table, experiment: CfarScenes) -> Iterator[Row]:
    """Hybrid above the clutter map with anti-masking above the one without, at the last scan."""
    last = experiment.ages.index(experiment.listed[-1])
    order = ("hybrid", "clutter map + anti-masking", "clutter map")
    for better, worse in pairwise(order):
        if better not in table.names or worse not in table.names:
            continue
        for kind in (BESIDE, EXTENDED, POINT):
            pairs = [table.detected(table.names.index(one), last, kind) for one in (better, worse)]
            gain, low, high = pairs[0][0] - pairs[1][0], pairs[0][1] - pairs[1][2], pairs[0][2] - pairs[1][1]
            name = f"figure 4: {better} above {worse} at scan {experiment.listed[-1]}, {KINDS[kind]}"
            yield Row(f"{name} (1: yes)", float(gain > 0), float(low > 0), float(high > 0), "", 1.0)


def _beside_hybrid(table: _Table, experiment: CfarScenes) -> Iterator[Row]:
    if not {"hybrid", "adaptive"} <= set(table.names):
        return
    hybrid, ours = (table.names.index(one) for one in ("hybrid", "adaptive"))
    for kind in JUDGED:
        for a, scan in table.listed(ours):
            pairs = [table.detected(d, a, kind) for d in (hybrid, ours)]
            low, high = pairs[0][1] - pairs[1][2], pairs[0][2] - pairs[1][1]
            name = f"homogeneous: adaptive below hybrid, {KINDS[kind]}, scan {scan}"
            yield Row(name, pairs[0][0] - pairs[1][0], low, high, "points", better="lower", wanted=3.0)


def _pictures(experiment: CfarScenes, first: Trial) -> Iterator[Figure]:
    kind, seen = first[f"{HETEROGENEOUS}.kind"], first[f"{HETEROGENEOUS}.seen"]
    yield Figure("The heterogeneous scene", "range cell", "azimuth", pictures=(Picture("surfaces", kind),))
    ranges = kind.shape[1]
    for d, label in enumerate(labels(experiment.detectors)):
        pictures = tuple(
            Picture(f"scan {experiment.ages[a]}", np.unpackbits(seen[d, k], axis=-1)[:, :ranges])
            for k, a in enumerate((0, -1))
        )
        note = "Detected cells at the nominal setting; compare the paper's figure 4."
        yield Figure(f"{label}: detections", "range cell", "azimuth", pictures=pictures, note=note)
