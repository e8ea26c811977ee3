"""Clutter that is not Rayleigh: what false alarm probability a detector set for Rayleigh clutter then has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.lab.evaluate import Figure, Line, Row, Trial
from pipeline.lab.evaluate.cfar_cases import CLAIRVOYANT, Case, Watch, every_part, false_alarms, margins
from pipeline.lab.evaluate.cfar_law import Law
from pipeline.lab.evaluate.ground import Ground
from pipeline.lab.evaluate.statistics import mean_interval

LAWS = (
    Law(),
    *(Law("weibull", shape) for shape in (1.8, 1.6, 1.4, 1.2)),
    Law("k", 5.0),
    Law("k", 1.0),
)


@dataclass(frozen=True)
class CfarClutter:
    """Homogeneous ground of several laws of amplitude.

    detectors: which. nominal: false alarm probabilities they are set for. laws: of the clutter. beam_rows: azimuths
    that share their speckle in a further case, Rayleigh; two is usual. learn_scans: seen before it is measured.
    """

    title: str = "Pfa on Rayleigh, Weibull and K clutter"
    source: str = "Galati et al., section 3B: the expected Pfa, typically 1e-6; no figures off Rayleigh"
    reading: str = (
        "512 x 256 cells of one level, independent from scan to scan and, but for the last case, from cell to cell;"
        " shape: of the Weibull amplitude (2 is Rayleigh), order nu of K; Pfa integrated over the law, given the"
        " thresholds learned"
    )
    trials: int = 6
    detectors: tuple[Case, ...] = field(default_factory=every_part)
    nominal: tuple[float, ...] = (1e-4, 1e-6)
    laws: tuple[Law, ...] = LAWS
    beam_rows: int = 2
    learn_scans: int = 100

    def quick(self) -> Self:
        """One trial, fewer scans."""
        return replace(self, trials=1, learn_scans=40)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """pfa: (nominal, cases of clutter, detectors)."""
        grounds = self._grounds(number)
        made = np.zeros((len(self.nominal), len(grounds), len(self.detectors)))
        for k, ground in enumerate(grounds):
            scene, law = ground.build(), ground.law
            kind = np.zeros(scene.kind.shape, np.int64)
            watches = [Watch(self.detectors, scene, pfa) for pfa in self.nominal]
            for block in scene.clutter(chance, range(self.learn_scans)):
                for watch in watches:
                    watch.learn(block)
            mean = scene.mean_db(self.learn_scans)
            block = scene.sweeps(self.learn_scans, scene.amplitude(chance, mean))
            for n, watch in enumerate(watches):
                for d, (limit, _) in zip(range(len(self.detectors)), watch.measure(block, mean), strict=False):
                    made[n, k, d] = false_alarms(margins(limit, mean, kind, 1), law)
        return {"pfa": made}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Pfa; for `adaptive` on Rayleigh and Weibull also how many times it is off the nominal one."""
        pfa = self._pfa(results)
        rows: list[Row] = []
        for n, nominal in enumerate(self.nominal):
            for k, ground in enumerate(self._grounds(0)):
                for d, case in enumerate(self.detectors):
                    trials = pfa[:, n, k, d]
                    low, high = mean_interval(trials)
                    name = f"{case.label}, Pfa on {_said(ground)}, nominal {nominal:.0e}"
                    rows.append(Row(name, float(trials.mean()), max(low, 0.0), high, ""))
                    if case.label == "adaptive" and ground.law.family != "k":
                        rows.append(_times_off(f"{case.label}, times off on {_said(ground)}, nominal {nominal:.0e}",
                                               trials / nominal))  # fmt: skip
        return tuple(rows)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Pfa against the Weibull shape."""
        pfa = self._pfa(results).mean(axis=0)
        weibull = [k for k, law in enumerate(self.laws) if law.family != "k"]
        shapes = np.array([self.laws[k].shape for k in weibull])
        made = []
        for n, nominal in enumerate(self.nominal):
            lines = [
                Line(case.label, shapes, np.maximum(pfa[n, weibull, d], 1e-9)) for d, case in enumerate(self.detectors)
            ]
            ends = np.array([shapes.min(), shapes.max()])
            lines += [
                Line(f"{times:g} x nominal", ends, np.full(2, times * nominal), style="bound") for times in (1, 3)
            ]
            made.append(Figure(f"Pfa on Weibull clutter, nominal {nominal:.0e}", "shape of the amplitude (2: Rayleigh)",
                               "Pfa", tuple(lines), log_y=True,
                               note=f"The {CLAIRVOYANT} has the nominal Pfa everywhere."))  # fmt: skip
        return tuple(made)

    def _grounds(self, number: int) -> list[Ground]:
        grounds = [Ground.homogeneous(number, law) for law in self.laws]
        return [*grounds, replace(Ground.homogeneous(number), beam_rows=self.beam_rows)]

    def _pfa(self, results: Sequence[Trial]) -> NDArray[np.float64]:
        return np.stack([one["pfa"] for one in results])


EXPERIMENT = CfarClutter


def _said(ground: Ground) -> str:
    law = ground.law
    if law.family == "rayleigh":
        return "Rayleigh" if ground.beam_rows == 1 else f"Rayleigh, {ground.beam_rows} azimuths a beam"
    return f"Weibull {law.shape:g}" if law.family == "weibull" else f"K nu {law.shape:g}"


def _times_off(name: str, ratios: NDArray[np.float64]) -> Row:
    """How many times too high or too low."""
    middle = float(ratios.mean())
    low, high = mean_interval(ratios)
    ends = sorted(max(one, 1 / max(one, 1e-9)) for one in (max(low, 0.0), high))
    least = 1.0 if low <= 1 <= high else ends[0]
    return Row(name, max(middle, 1 / max(middle, 1e-9)), least, ends[1], "times", better="lower", wanted=3.0)
