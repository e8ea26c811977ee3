"""Small experiments that exist in the tests alone."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipeline.lab.evaluate import Figure, Line, Picture, RecordedVideo, Row, Trial


@dataclass(frozen=True)
class Toy:
    """The mean of Rayleigh amplitudes, which is known."""

    title: str = "Mean of Rayleigh amplitudes"
    source: str = "Rayleigh 1880, <eq. 1>"
    reading: str = "amplitudes are taken & averaged | linearly"
    trials: int = 12
    draws: int = 2000
    snr_db: tuple[float, ...] = (19.5, 20.5)

    def quick(self) -> Self:
        return replace(self, trials=4, draws=200)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        clock()
        return {"mean": chance.rayleigh(size=self.draws).mean(), "number": np.array(number)}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        assert [int(one["number"]) for one in results] == list(range(self.trials))
        means = np.array([float(one["mean"]) for one in results])
        low, high = means.min(), means.max()
        measured = float(means.mean())
        return (
            Row("mean of amplitudes, <all> cells", measured, low, high, "σ", 1.2533, 0.05, "near"),
            Row("probability of detection, P1 + E2 at 20.5 dB", 93.1, 92.2, 93.9, "%", 92.0, 0.5, "higher", 88.0),
            Row("of a target | beside another", 71.0, 69.0, 73.0, "%", 90.0, 1.5, "higher", 88.0),
            Row("false alarms, held-out scene", 3.1e-7, 1e-7, 6e-7, "", None, wanted=1e-6, better="lower"),
            Row("not there", float("nan"), float("nan"), float("inf"), "m", None),
        )

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        x = np.arange(1.0, 121.0)
        lines = tuple(
            Line(name, x, fall * np.exp(-x / tau), fall * np.exp(-x / tau) - 2, fall * np.exp(-x / tau) + 2)
            for name, fall, tau in (("hybrid", 94.0, 900.0), ("clutter_map", 88.0, 60.0), ("adaptive", 92.0, 4000.0))
        )
        paper = Line("hybrid, paper", np.array([1.0, 15.0]), np.array([94.0, 92.0]), style="paper")
        bound = Line("wanted", np.array([1.0, 120.0]), np.array([88.0, 88.0]), style="bound")
        pfa = tuple(
            Line(f"detector {k}", x, 10.0 ** (-6 + 0.3 * k) * (1 + np.sin(x / (5 + k)) ** 2), style=style)
            for k, style in enumerate(("line", "points", "line", "points", "line", "line", "line", "line", "line"))
        )
        image = np.hypot(*np.mgrid[-32:32, -48:48]) % 17
        pictures = (
            Picture(
                "as the radar sees it", image, (-144.0, 144.0, -96.0, 96.0), "dB", np.array([[0.0, 0.0], [60, 30]])
            ),
            Picture("detections", image > 12, (-144.0, 144.0, -96.0, 96.0)),
        )
        return (
            Figure(
                "Detection over scans", "scan", "Pd, %", (*lines, paper, bound), note="Bands: 95 %. <Seeds> held out."
            ),
            Figure("False alarms over scans", "scan", "Pfa", pfa, log_y=True),
            Figure("The scene", "east, m", "north, m", pictures=pictures, note="Crosses: truth."),
        )


@dataclass(frozen=True)
class Failing(Toy):
    """Trial 2 fails."""

    title: str = "Fails"

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        if number == 2:
            raise ValueError("no echo came back")
        return super().trial(chance, number, clock)


@dataclass(frozen=True)
class Undrawn(Toy):
    """Its figures fail."""

    title: str = "Cannot be drawn"

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        raise ValueError("no <ink>")


@dataclass(frozen=True)
class Dying(Toy):
    """Its process ends."""

    title: str = "Dies"

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        os._exit(3)


@dataclass(frozen=True)
class Slow(Toy):
    """Takes its time."""

    title: str = "Slow"

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        time.sleep(0.5)
        return super().trial(chance, number, clock)


@dataclass(frozen=True)
class Filmed(Toy):
    """Works on a recording."""

    title: str = "Brightness of a recording"
    video: RecordedVideo | None = None

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        assert self.video is not None
        return {"mean": self.video.scans[number % len(self.video.scans)].mean(), "number": np.array(number)}


@dataclass(frozen=True)
class Circumstance(Toy):
    """What a process finds about itself."""

    title: str = "Circumstances"

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        threads, cache = os.environ.get("OMP_NUM_THREADS", ""), os.environ.get("NUMBA_CACHE_DIR", "")
        return {"threads": np.array(threads), "cache": np.array(cache), "process": np.array(os.getpid())}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        return ()


TOYS: dict[str, type[Any]] = {
    "toy": Toy,
    "failing": Failing,
    "dying": Dying,
    "slow": Slow,
    "undrawn": Undrawn,
    "filmed": Filmed,
    "circumstance": Circumstance,
}
