"""At one mark: which due tracks take which plots, which plots wait, and which are left to begin tracks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.contracts.associate import Association, Expected
from pipeline.group.enclosing import enclosing_track
from pipeline.group.split_plots import join_split_plots
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.plot_pool import add_centroid_noise

USED_WEIGHT = 0.5
"""Sum of the weights of the hypotheses in which tracks took a plot, from which it begins no track of its own."""


class Decided(NamedTuple):
    """What was decided at one mark.

    track: (d,) rows of what was expected that are decided. track_first, plot_first, plot, log_weight: their hypotheses,
    as in `Hypotheses`. left: (l,) plots of the pool that belong to no track. hit, squared: (d,) the first plot of the
    likeliest hypothesis, -1 for a miss, and its squared distance, nan where it lies outside the gate. absorbed: plots
    that lie within the extent of a track.
    """

    track: Array
    track_first: Array
    plot_first: Array
    plot: Array
    log_weight: Floats
    left: Array
    hit: Array
    squared: Floats
    absorbed: int


def resolve(
    answer: Association, tracks: Array, due: Array, plots: Array, expected: Expected, established: Array, pool: Array,
    margin: float, centroid_sd: float,
) -> Decided:  # fmt: skip
    """Take from the answer of an association, over `tracks` and `plots`, what can be decided now.

    due: (n,) mask by row of `expected` of the tracks that are decided; what the others may still take waits for them.
    established: (n,) mask of tracks whose extent may hold several plots. margin: m, about that extent. centroid_sd: of
    the centroid of an extended echo, as a fraction of its length and width: what takes a plot has it in the noise,
    while the gates of associations allow for it by the extent of the track.
    Plots that are taken or left are marked as spent in the pool; where several plots are one target, the taken one
    becomes their common centre and extent.
    """
    hypotheses, n = answer.hypotheses, len(tracks)
    many, room = len(hypotheses.log_weight), len(hypotheses.plot) + n
    track, hit, squared = np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n)
    track_first, plot_first = np.empty(n + 1, np.int32), np.empty(many + 1, np.int32)
    plot, log_weight, left = np.empty(room, np.int32), np.empty(many), np.empty(len(plots), np.int32)
    d, h, p, rest, absorbed = _resolve(
        hypotheses.track_first, hypotheses.plot_first, hypotheses.plot, hypotheses.log_weight, answer.first,
        answer.pair, answer.squared, tracks, due, plots, expected.time, expected.mean, expected.covariance,
        expected.extent, established, pool, pool["position"], pool["cells"], pool["extent"], margin,
        centroid_sd, track,
        track_first, plot_first, plot, log_weight, left, hit, squared,
    )  # fmt: skip
    return Decided(
        track[:d], track_first[: d + 1], plot_first[: h + 1], plot[:p], log_weight[:h], left[:rest], hit[:d],
        squared[:d], absorbed,
    )  # fmt: skip


@allocating
def _resolve(
    track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, first: Array, pair: Array, squared: Floats,
    tracks: Array, due: Array, plots: Array, time: Floats, mean: Floats, cov: Floats, extent: Floats,
    established: Array, pool: Array, position: Floats, cells: Array, plot_extent: Floats, margin: float,
    centroid_sd: float, out_track: Array, out_first: Array, out_plot_first: Array, out_plot: Array,
    out_weight: Floats, left: Array, out_hit: Array, out_squared: Floats,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    used, contested = _weigh(track_first, plot_first, plot, log_weight, first, pair, tracks, due, len(pool))
    owner = np.full(len(pool), -1, np.int32)
    rest, absorbed = _spend(
        used, contested, tracks, plots, time, mean, cov, extent, established, pool, margin, centroid_sd, owner, left
    )
    members = np.empty(len(plots) + 1, np.int32)
    d = h = p = 0
    out_first[0] = out_plot_first[0] = 0
    for k in range(len(tracks)):
        if not due[tracks[k]]:
            continue
        begin, end = track_first[k], track_first[k + 1]
        more = _members(owner, plots, k, members) if absorbed > 0 else 0
        nothing = plot_first[begin] == plot_first[end]
        likeliest = -np.inf
        out_hit[d], out_squared[d] = -1, np.nan
        for o in range(begin, end):
            before = p
            for q in range(plot_first[o], plot_first[o + 1]):
                out_plot[p] = plot[q]
                p += 1
            if nothing and more > 0 and o == begin:  # it missed its own, but a plot lies within its extent
                out_plot[p], members[1] = members[1], members[more]
                p += 1
                more -= 1
            if more > 0 and p == before + 1:
                members[0] = out_plot[before]
                one = pool[out_plot[before]]
                join_split_plots(
                    members[: more + 1], position, cells, plot_extent, extent[tracks[k], 2], one["position"],
                    one["extent"],
                )  # fmt: skip
            if log_weight[o] > likeliest:
                likeliest = log_weight[o]
                out_hit[d] = out_plot[before] if p > before else -1
            out_weight[h] = log_weight[o]
            h += 1
            out_plot_first[h] = p
        for o in range(first[k], first[k + 1]):
            if pair[o] == out_hit[d]:
                out_squared[d] = squared[o]
        out_track[d] = tracks[k]
        d += 1
        out_first[d] = h
    return d, h, p, rest, absorbed


@allocating
def _spend(
    used: Floats, contested: Array, tracks: Array, plots: Array, time: Floats, mean: Floats, cov: Floats,
    extent: Floats, established: Array, pool: Array, margin: float, centroid_sd: float,
    owner: Array, left: Array,
) -> tuple[int, int]:  # fmt: skip
    """Spend the plots that are taken or that nobody may still take; how many are left, and in another's extent."""
    rest = absorbed = 0
    for j in plots:
        one = pool[j]
        if used[j] >= USED_WEIGHT:
            one["spent"] = True
            add_centroid_noise(one["extent"], centroid_sd, one["noise"])
        elif not contested[j]:
            one["spent"] = True
            add_centroid_noise(one["extent"], centroid_sd, one["noise"])
            owner[j] = enclosing_track(
                tracks, established, time, mean, cov, extent, one["time"], one["position"], one["noise"],
                one["extent"][0], margin,
            )  # fmt: skip
            if owner[j] >= 0:
                absorbed += 1
            else:
                left[rest] = j
                rest += 1
    return rest, absorbed


@allocating
def _members(owner: Array, plots: Array, track: int, members: Array) -> int:
    """Write the plots within the extent of the track from members[1] on; how many."""
    made = 0
    for j in plots:
        if owner[j] == track:
            made += 1
            members[made] = j
    return made


@allocating
def _weigh(
    track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, first: Array, pair: Array, tracks: Array,
    due: Array, plots: int,
) -> tuple[Floats, Array]:  # fmt: skip
    """For each plot of the pool: the weight with which due tracks take it, and whether others may still take it."""
    used, contested = np.zeros(plots), np.zeros(plots, np.bool_)
    for k in range(len(tracks)):
        if due[tracks[k]]:
            for h in range(track_first[k], track_first[k + 1]):
                for o in range(plot_first[h], plot_first[h + 1]):
                    used[plot[o]] += np.exp(log_weight[h])
        else:
            for o in range(first[k], first[k + 1]):
                contested[pair[o]] = True
    return used, contested
