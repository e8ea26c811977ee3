"""What looks, hits and misses say about whether a track is a target, apart for each sensor."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.false_plots import REACH, FalsePlots, learnt_rate
from pipeline.track.plot_pool import PAVED
from pipeline.track.settings import EvidenceSettings
from pipeline.track.store import TrackStore

MEAN_SQUARED_DISTANCE = 2.0
"""The mean of a squared Mahalanobis distance in two dimensions; stands for one that is not known."""


LEAST_SCORE = -10.0
"""The score of a sensor falls no further, so that one from which a target was long hidden is soon believed again; below
what ends a track."""


def score_plots(
    rule: EvidenceSettings, store: TrackStore, rows: Array, radar: int, covariance: Floats, origin: Array,
    pool: Array, hit: Array, squared: Floats, false_plots: FalsePlots,
) -> None:  # fmt: skip
    """Add to the scores of the tracks `rows` (k,) of one radar what its plots `hit` (k,), -1 for none, say of them.

    covariance: (n, 4, 4) where tracks were expected, of which `origin` (k,) are these. squared: (k,) distances, nan
    where not known.
    """
    settings = (
        rule.detection, rule.false_on_pavement, rule.false_elsewhere, rule.max_score, rule.young_hits,
        rule.score_per_hit,
    )  # fmt: skip
    grid = (false_plots.west, false_plots.south, false_plots.step, false_plots.scale)
    _score(
        settings, rule.cell_scores, store.rows, store.evidence, rows, radar, covariance, origin, pool, hit, squared,
        grid, false_plots.rate, PAVED,
    )  # fmt: skip


def count_misses(
    store: TrackStore, rows: Array, hit: Array, radar: int, time: Floats, tolerance: float, ceiling: float
) -> None:
    """The radar looked at times (k,) and, where `hit` (k,) is -1, found nothing: it counts for tracks it could see.

    Not for those above `ceiling` m, nor where something newer than the look by more than `tolerance` s is known.
    """
    _count_misses(store.rows, store.evidence, rows, hit, radar, time, tolerance, ceiling)


@allocating
def _score(
    rule: tuple[float, float, float, float, int, float], cell_scores: tuple[float, ...], tracks: Array, evidence: Array,
    rows: Array, radar: int, covariance: Floats, origin: Array, pool: Array, hit: Array, squared: Floats,
    grid: tuple[float, float, float, float], rate: Floats, paved: Array,
) -> None:  # fmt: skip
    detection, on_pavement, elsewhere, max_score, young_hits, score_per_hit = rule
    west, south, step, scale = grid
    for k in range(len(rows)):
        one = evidence[rows[k], radar]
        if hit[k] < 0:
            if one["history"] != 0:  # a radar that has not seen the target says nothing by not seeing it
                one["score"] = max(one["score"] + math.log(1.0 - detection), LEAST_SCORE)
            continue
        plot, p = pool[hit[k]], covariance[origin[k]]
        c, place = plot["covariance"], plot["position"]
        false = on_pavement
        if not paved[plot["surface"]]:
            x, y = (place[0] - west) / step - REACH, (place[1] - south) / step - REACH
            false = max(learnt_rate(rate, x, y) / (scale * step * step), elsewhere)
        s00, s01, s11 = p[0, 0] + c[0, 0], p[0, 1] + c[0, 1], p[1, 1] + c[1, 1]
        volume = 2.0 * math.pi * math.sqrt(s00 * s11 - s01 * s01)
        cells = cell_scores[min(max(plot["cells"], 1), len(cell_scores)) - 1]
        distance = squared[k] if math.isfinite(squared[k]) else MEAN_SQUARED_DISTANCE
        log_likelihood_ratio = math.log(detection / (volume * false)) - 0.5 * distance + cells
        most = max_score - max(young_hits - tracks[rows[k]]["hits"], 0) * score_per_hit
        one["score"] = min(one["score"] + log_likelihood_ratio, max(most, one["score"]))


@allocating
def _count_misses(
    tracks: Array, evidence: Array, rows: Array, hit: Array, radar: int, time: Floats, tolerance: float,
    ceiling: float,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        track = tracks[rows[k]]
        if (
            hit[k] >= 0
            or not track["on_ground"]
            or track["altitude"] > ceiling
            or time[k] <= track["updated"] - tolerance
        ):
            continue
        one = evidence[rows[k], radar]
        one["misses"] += 1
        one["history"] = one["history"] << np.uint32(1)
        one["looks"] += 1
