"""Recorded video of a real radar: plots a scan, how steady they are, and whether what stands still stays detected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.spatial import cKDTree

from pipeline.assemble.bit_depth import to_octets
from pipeline.lab.evaluate import Figure, Line, Picture, RecordedVideo, Row, Trial
from pipeline.lab.evaluate.cfar_cases import Case, every_part
from pipeline.lab.evaluate.statistics import mean_interval, wilson
from pipeline.parts import build
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

FULL_SCALE_DB = 80.0
LEARN_TURNS = 20
APART_TURNS = 15
SEEN_TURNS = 3
"""A fixed thing counts as seen when it is in any of so many turns: echoes fluctuate."""


@dataclass(frozen=True)
class RealVideo:
    """Every detector with every extractor over a recording that is played again and again for `turns` turns.

    video: the recording. detectors, extractors (names of parts): a pair of them is a trial. pfa: nominal. least_cells:
    of the plots whose steadiness is told, and of fixed things. near_m: how near a plot must be found again. turns: of
    which 20 learn.
    """

    title: str = "A real radar's video: plots a scan and how steady they are"
    source: str = "Galati et al., section 3C, trials on recorded data; no figures"
    reading: str = (
        "video of fewer than 8 bits is stretched to 8, of more bits cut; nothing tells how many decibels a step is:"
        " full scale is taken for 80 dB (0.3125 dB an 8-bit step, the chain's own default); no map; the recording is"
        " repeated after its last turn, so a turn comes back. 20 turns learn. Found again: a plot of 4 cells or more"
        " has a plot within 15 m in the next turn; large echoes of land move their centroid more, hence the overlap of"
        " windows beside it. Fixed thing: 4 or more adjacent cells that in nine of ten turns are more than half way up"
        " from the median of the recording to its greatest; seen when any of its cells is detected in any of 3 turns"
    )
    trials: int = field(default_factory=lambda: 2 * len(every_part()))
    video: RecordedVideo | None = None
    detectors: tuple[Case, ...] = field(default_factory=every_part)
    extractors: tuple[str, ...] = ("manhattan", "hysteresis")
    pfa: float = 1e-6
    least_cells: int = 4
    near_m: float = 15.0
    turns: int = 40

    def __post_init__(self) -> None:
        if self.turns < LEARN_TURNS + APART_TURNS + SEEN_TURNS:
            raise ValueError(f"turns must be {LEARN_TURNS + APART_TURNS + SEEN_TURNS} or more")

    def quick(self) -> Self:
        """The same: the length is the recording's."""
        return self

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """Of one pair: plots (n, 8) turn, east, north, cells and window of each; degraded (turns); seen (fixed things,
        2) after learning and 15 turns later. Raises ValueError without a recording, or for one that cannot be used."""
        video = self._usable()
        octets = to_octets(video.scans, video.bits)
        site = RadarSite("recording", 0.0, 0.0, 0.0, video_format(video))
        pairs = self._pairs()
        case, method = pairs[number % len(pairs)]
        detector, extractor = case.detector(self.pfa), build("extract", method)
        detecting = detector.start(site.video, growth_db=getattr(extractor, "growth_db", None))
        extracting = extractor.start(site)
        plots, degraded = [], np.zeros(self.turns, bool)
        things, many = fixed_things(octets, self.least_cells)
        seen = np.zeros((many + 1, 2), bool)
        for turn in range(self.turns):
            block = _block(site.video, turn, octets[turn % len(octets)])
            found = detector(block, detecting)
            degraded[turn] = found.degraded
            plots.append(_columns(extractor(block, found, extracting)))
            for late in (0, 1):
                if 0 <= turn - LEARN_TURNS - late * APART_TURNS < SEEN_TURNS:
                    seen[things[found.cells(site.video.ranges)], late] = True
        plots.append(_columns(extractor.flush(extracting)))
        made: dict[str, NDArray[Any]] = {"plots": np.concatenate(plots), "degraded": degraded, "seen": seen[1:]}
        return made | ({"picture": _picture(octets)} if number == 0 else {})

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Plots a turn, their steadiness, fixed things kept, degraded turns: of each detector."""
        rows: list[Row] = []
        judged = range(LEARN_TURNS, self.turns)
        for (case, method), result in zip(self._pairs(), results, strict=False):
            plots = result["plots"]
            name = f"{case.label}, {method}"
            counts = np.array([(plots[:, 0] == turn).sum() for turn in judged])
            rows.append(_counted(f"{name}: plots a turn", counts))
            large = plots[plots[:, 3] >= self.least_cells]
            counts = np.array([(large[:, 0] == turn).sum() for turn in judged])
            rows.append(_counted(f"{name}: plots of {self.least_cells} cells or more a turn", counts))
            near, over, tries = self._again(plots, large)
            rows.append(_share(f"{name}: of these, found again within {self.near_m:g} m in the next turn", near, tries))
            rows.append(_share(f"{name}: of these, overlapped by a plot of the next turn", over, tries))
            if method != self.extractors[0]:
                continue
            seen = result["seen"]
            first = int(seen[:, 0].sum())
            rows.append(_share(f"{case.label}: fixed things of the recording seen", first, len(seen)))
            rows.append(_share(f"{case.label}: of these, still seen after {APART_TURNS} turns",
                               int(seen.all(axis=1).sum()), first))  # fmt: skip
            bad = int(result["degraded"][LEARN_TURNS:].sum())
            rows.append(Row(f"{case.label}: degraded turns of {len(judged)}", bad, bad, bad, ""))
        return tuple(rows)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """Plots over the turns, and where the last turn's lie."""
        turns = np.arange(self.turns, dtype=np.float64)
        lines, pictures = [], []
        video = self._usable()
        reach = video.first_range_m + video.range_step_m * video.scans.shape[2]
        for (case, method), result in zip(self._pairs(), results, strict=False):
            plots, name = result["plots"], f"{case.label}, {method}"
            counts = np.bincount(plots[:, 0].astype(int), minlength=self.turns)
            lines.append(Line(name, turns, counts[: self.turns].astype(np.float64)))
            marks = plots[(plots[:, 0] == self.turns - 2) & (plots[:, 3] >= self.least_cells), 1:3]
            pictures.append((name, marks))
        picture = results[0]["picture"]
        made = [Figure("Plots a turn", "turn", "plots", tuple(lines), log_y=True)]
        for name, marks in pictures:
            drawn = Picture("mean of the recording, and the plots of a late turn", picture,
                            (-reach, reach, -reach, reach), "step", marks)  # fmt: skip
            made.append(Figure(f"{name}: plots of {self.least_cells} cells or more", "east, m", "north, m",
                               pictures=(drawn,)))  # fmt: skip
        return tuple(made)

    def _pairs(self) -> list[tuple[Case, str]]:
        return [(case, method) for method in self.extractors for case in self.detectors]

    def _usable(self) -> RecordedVideo:
        if self.video is None:
            raise ValueError("this experiment works on a recording of radar video: say which (--file)")
        if self.video.scans.ndim != 3 or not len(self.video.scans) or min(self.video.scans.shape[1:]) < 16:
            raise ValueError(f"a recording is turns of 16 azimuths x 16 cells or more, not {self.video.scans.shape}")
        return self.video

    def _again(self, plots: NDArray[np.float64], large: NDArray[np.float64]) -> tuple[int, int, int]:
        """How many plots have a plot near them in the next turn; how many one whose window overlaps; of how many."""
        near = over = tries = 0
        azimuths = self._usable().scans.shape[1]
        for turn in range(LEARN_TURNS, self.turns - 2):  # the last turn's plots at its end are not all complete
            these, others = large[large[:, 0] == turn], plots[plots[:, 0] == turn + 1]
            near += int(self._near(these, others).sum())
            over += int(_overlapping(these[:, 4:], others[:, 4:], azimuths).sum())
            tries += len(these)
        return near, over, tries

    def _near(self, wanted: NDArray[np.float64], there: NDArray[np.float64]) -> NDArray[np.bool_]:
        if not len(wanted) or not len(there):
            return np.zeros(len(wanted), bool)
        apart, _ = cKDTree(there[:, 1:3]).query(wanted[:, 1:3])
        return np.asarray(apart <= self.near_m)


EXPERIMENT = RealVideo


def video_format(video: RecordedVideo) -> VideoFormat:
    """The grid of a recording, one azimuth of it taken for a beam where that is wider than 0.18 degrees."""
    _, azimuths, ranges = video.scans.shape
    steps = np.diff(video.time)
    return VideoFormat(
        azimuths=azimuths,
        ranges=ranges,
        first_range_m=video.first_range_m,
        range_step_m=video.range_step_m,
        beamwidth_rad=max(VideoFormat().beamwidth_rad, 2 * pi / azimuths),
        period_s=float(np.median(steps)) if len(steps) else 1.0,
        db_per_step=FULL_SCALE_DB / 256,
    )


def fixed_things(octets: NDArray[np.uint8], least_cells: int) -> tuple[NDArray[np.int64], int]:
    """(azimuths, ranges) number from 1 on of the fixed thing in each cell, 0 where there is none; and how many.

    The steady level of a cell is what it has at least in nine of ten turns. Adjacent cells whose steady level is more
    than half way from the median of all to the greatest are a thing; what lies across north is two.
    """
    tenth = len(octets) // 10
    steady = np.partition(octets, tenth, axis=0)[tenth]
    floor = float(np.median(steady))
    groups, _ = label(steady > (floor + float(steady.max())) / 2, structure=np.ones((3, 3)))
    counts = np.bincount(groups.ravel())
    counts[0] = 0
    number = np.zeros(len(counts), np.int64)
    large = np.flatnonzero(counts >= least_cells)
    number[large] = np.arange(1, len(large) + 1)
    return number[groups], len(large)


def _block(video: VideoFormat, turn: int, amplitude: NDArray[np.uint8]) -> Sweeps:
    row = np.arange(video.azimuths, dtype=np.int32)
    share = (row + 0.5) / video.azimuths
    return Sweeps(0, turn, row, 2 * pi * share, 1000.0 + video.period_s * (turn + share), amplitude, last=True)


def _overlapping(these: NDArray[np.float64], others: NDArray[np.float64], azimuths: int) -> NDArray[np.bool_]:
    """Which of the windows (first row, rows, first cell, cells) share a cell with any of the others."""
    ahead = (others[None, :, 0] - these[:, None, 0]) % azimuths
    rows = (ahead < these[:, None, 1]) | ((-ahead) % azimuths < others[None, :, 1])
    ends, other_ends = these[:, 2] + these[:, 3], others[:, 2] + others[:, 3]
    cells = (others[None, :, 2] < ends[:, None]) & (these[:, None, 2] < other_ends[None, :])
    return np.asarray((rows & cells).any(axis=1))


def _columns(plots: Any) -> NDArray[np.float64]:
    columns = [plots.scan, plots.east, plots.north, plots.cells, *np.asarray(plots.window).reshape(-1, 4).T]
    return np.stack(columns, axis=1).astype(np.float64)


def _picture(octets: NDArray[np.uint8], side: int = 400) -> NDArray[np.float32]:
    """(side, side) mean of the turns, from south to north."""
    mean = octets.mean(axis=0, dtype=np.float32)
    azimuths, ranges = mean.shape
    axis = (np.arange(side) + 0.5) / side * 2 - 1
    east, north = np.meshgrid(axis, axis)
    row = (np.mod(np.arctan2(east, north), 2 * pi) / (2 * pi) * azimuths).astype(int) % azimuths
    cell = (np.hypot(east, north) * ranges).astype(int)
    return np.where(cell < ranges, mean[row, np.minimum(cell, ranges - 1)], np.float32(0))


def _counted(name: str, counts: NDArray[Any]) -> Row:
    low, high = mean_interval(counts)
    return Row(name, float(counts.mean()), max(low, 0.0), high, "")


def _share(name: str, hits: int, tries: int) -> Row:
    if not tries:
        return Row(name, float("nan"), float("nan"), float("nan"), "%")
    low, high = wilson(hits, tries)
    return Row(name, 100 * hits / tries, 100 * low, 100 * high, "%", better="higher")
