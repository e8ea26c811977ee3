"""Of one answer: which due tracks take which plots, which plots wait, and which are left to begin tracks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.contracts.associate import Association, Expected
from pipeline.contracts.measured import Hypotheses
from pipeline.group.enclosing import OUTSIDE, farthest_within, place_within
from pipeline.group.split_plots import join_split_plots
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.clusters import Asked, Clusters
from pipeline.track.plot_pool import add_centroid_noise

USED_WEIGHT = 0.5
"""Sum of the weights of the hypotheses in which tracks took a plot, from which it begins no track of its own."""


class Decided(NamedTuple):
    """What was decided.

    track: (d,) rows of what was expected that are decided, at the marks mark (d,), as in `Asked`. track_first,
    plot_first, plot, log_weight: their hypotheses, as in `Hypotheses`. left: (l,) plots of the pool that belong to no
    track, left_mark: (l,) their marks. hit, squared: (d,) the first plot of the likeliest hypothesis, -1 for a miss,
    and its squared distance, nan where it lies outside the gate. absorbed: plots that lie within the extent of a track.
    """

    track: Array
    mark: Array
    track_first: Array
    plot_first: Array
    plot: Array
    log_weight: Floats
    left: Array
    left_mark: Array
    hit: Array
    squared: Floats
    absorbed: int


def resolve(
    answer: Association, asked: Asked, clusters: Clusters, expected: Expected, established: Array, pool: Array,
    margin: float, centroid_sd: float,
) -> Decided:  # fmt: skip
    """Take from the answer of an association to what it was `asked`, within `clusters`, what can be decided now.

    Tracks that are not due are not decided; what they may still take waits for them. established: (n,) mask of tracks
    whose extent may hold several plots. margin: m, about that extent. centroid_sd: of the centroid of an extended echo,
    as a fraction of its length and width: what takes a plot has it in the noise, while the gates of associations allow
    for it by the extent of the track.
    Plots that are taken or left are marked as spent in the pool; where several plots are one target, the taken one
    becomes their common centre and extent.
    """
    hypotheses, n, many = answer.hypotheses, len(asked.tracks), len(answer.hypotheses.log_weight)
    room = len(hypotheses.plot) + n
    track, mark, hit, squared = np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n)
    track_first, plot_first = np.empty(n + 1, np.int32), np.empty(many + 1, np.int32)
    plot, log_weight = np.empty(room, np.int32), np.empty(many)
    left, left_mark = np.empty(len(asked.plots), np.int32), np.empty(len(asked.plots), np.int32)
    d, h, p, rest, absorbed = _resolve(
        hypotheses.track_first, hypotheses.plot_first, hypotheses.plot, hypotheses.log_weight, answer.first,
        answer.pair, answer.squared, *asked, clusters.of_look, clusters.of_plot, expected.time, expected.mean,
        expected.covariance, expected.extent, established, pool, pool["position"], pool["cells"], pool["extent"],
        margin, centroid_sd, track, mark, track_first, plot_first, plot, log_weight, left, left_mark, hit, squared,
    )  # fmt: skip
    return Decided(
        track[:d], mark[:d], track_first[: d + 1], plot_first[: h + 1], plot[:p], log_weight[:h], left[:rest],
        left_mark[:rest], hit[:d], squared[:d], absorbed,
    )  # fmt: skip


def together(decided: list[Decided]) -> Decided:
    """What was decided of different clusters as one, in the order of the marks and then of the rows."""
    track, mark, left, left_mark, hit, squared = (
        np.concatenate([getattr(one, name) for one in decided])
        for name in ("track", "mark", "left", "left_mark", "hit", "squared")
    )
    plot, weight = (np.concatenate([getattr(one, name) for one in decided]) for name in ("plot", "log_weight"))
    order, rest = _order(mark, track), _order(left_mark, left)
    hypotheses = Hypotheses(
        np.empty_like(track_first := _chained([one.track_first for one in decided])),
        np.empty_like(plot_first := _chained([one.plot_first for one in decided])),
        np.empty_like(plot),
        np.empty_like(weight),
    )
    reorder(order, track_first, plot_first, plot, weight, *hypotheses)
    return Decided(
        track[order], mark[order], *hypotheses, left[rest], left_mark[rest], hit[order], squared[order],
        sum(one.absorbed for one in decided),
    )  # fmt: skip


def _order(mark: Array, rows: Array) -> Array:
    """The order of pairs by mark, then row."""
    return np.argsort((mark.astype(np.int64) << np.int64(32)) | rows)


def _chained(offsets: list[Array]) -> Array:
    """Offsets of compressed rows, one after the other."""
    made, end = [np.zeros(1, np.int32)], 0
    for one in offsets:
        made.append(one[1:] + np.int32(end))
        end += int(one[-1])
    return np.concatenate(made)


@allocating
def reorder(
    order: Array, track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, out_track: Array,
    out_first: Array, out_plot: Array, out_weight: Floats,
) -> None:  # fmt: skip
    """Write the hypotheses of tracks in another order; those of number -1 have none. order: (n,) their old numbers."""
    h = p = 0
    out_track[0] = out_first[0] = 0
    for k in range(len(order)):
        if order[k] >= 0:
            for o in range(track_first[order[k]], track_first[order[k] + 1]):
                for q in range(plot_first[o], plot_first[o + 1]):
                    out_plot[p] = plot[q]
                    p += 1
                out_weight[h] = log_weight[o]
                h += 1
                out_first[h] = p
        out_track[k + 1] = h


@allocating
def _resolve(
    track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, first: Array, pair: Array, squared: Floats,
    tracks: Array, due: Array, plots: Array, mark_of_track: Array, mark_of_plot: Array, of_look: Array, of_plot: Array,
    time: Floats, mean: Floats, cov: Floats, extent: Floats, established: Array, pool: Array, position: Floats,
    cells: Array, plot_extent: Floats, margin: float, centroid_sd: float, out_track: Array, out_mark: Array,
    out_first: Array, out_plot_first: Array, out_plot: Array, out_weight: Floats, left: Array, left_mark: Array,
    out_hit: Array, out_squared: Floats,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    used, contested = _weigh(track_first, plot_first, plot, log_weight, first, pair, tracks, due, len(pool))
    head, following, far = _by_cluster(of_look, tracks, established, extent, margin)
    owned, more_owned = np.full(len(tracks), -1, np.int32), np.full(len(plots), -1, np.int32)
    rest, absorbed = _spend(
        used, contested, head, following, far, tracks, plots, mark_of_plot, of_plot, time, mean, cov, extent, pool,
        margin, centroid_sd, owned, more_owned, left, left_mark,
    )  # fmt: skip
    members = np.empty(len(plots) + 1, np.int32)
    d = h = p = 0
    out_first[0] = out_plot_first[0] = 0
    for k in range(len(tracks)):
        if not due[tracks[k]]:
            continue
        begin, end = track_first[k], track_first[k + 1]
        more = _members(owned[k], more_owned, plots, members)
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
        out_track[d], out_mark[d] = tracks[k], mark_of_track[k]
        d += 1
        out_first[d] = h
    return d, h, p, rest, absorbed


@allocating
def _by_cluster(
    of_look: Array, tracks: Array, established: Array, extent: Floats, margin: float
) -> tuple[Array, Array, Floats]:
    """Of the established tracks (n,): the first of each cluster, and the next of the same, -1 for none; ascending.

    And the square, in m^2, of how far from its middle something may lie within the extent of each.
    """
    most = -1
    for i in tracks:
        most = max(most, of_look[i])
    head, following = np.full(most + 2, -1, np.int32), np.full(len(tracks), -1, np.int32)
    far = np.empty(len(tracks))
    for k in range(len(tracks) - 1, -1, -1):
        if established[tracks[k]]:
            cluster = of_look[tracks[k]]
            following[k], head[cluster] = head[cluster], k
            far[k] = farthest_within(extent[tracks[k]], margin) ** 2
    return head, following, far


@allocating
def _spend(
    used: Floats, contested: Array, head: Array, following: Array, far: Floats, tracks: Array, plots: Array,
    mark_of_plot: Array, of_plot: Array, time: Floats, mean: Floats, cov: Floats, extent: Floats, pool: Array,
    margin: float, centroid_sd: float, owned: Array, more_owned: Array, left: Array, left_mark: Array,
) -> tuple[int, int]:  # fmt: skip
    """Spend the plots that are taken or that nobody may still take; how many are left, and in the extent of a track.

    Of those that lie within the extent of a track, the last is written to owned (n,), the one before to more_owned.
    """
    rest = absorbed = 0
    for k in range(len(plots)):
        j = plots[k]
        one = pool[j]
        taken = used[j] >= USED_WEIGHT
        if not taken and contested[j]:
            continue
        one["spent"] = True
        add_centroid_noise(one["extent"], centroid_sd, one["noise"])
        if taken:
            continue
        owner, best = -1, OUTSIDE
        near = head[of_plot[j]] if of_plot[j] < len(head) else -1
        while near >= 0:
            i = tracks[near]
            dt = one["time"] - time[i]
            e = one["position"][0] - mean[i, 0] - dt * mean[i, 2]
            n = one["position"][1] - mean[i, 1] - dt * mean[i, 3]
            if e * e + n * n <= far[near]:
                ratio = place_within(
                    time[i], mean[i], cov[i], extent[i], one["time"], one["position"], one["noise"], one["extent"][0],
                    margin,
                )  # fmt: skip
                if ratio < best:
                    best, owner = ratio, near
            near = following[near]
        if owner >= 0:
            absorbed += 1
            more_owned[k], owned[owner] = owned[owner], k
        else:
            left[rest], left_mark[rest] = j, mark_of_plot[k]
            rest += 1
    return rest, absorbed


@allocating
def _members(last: int, more_owned: Array, plots: Array, members: Array) -> int:
    """Write the plots within the extent of a track, of which `last` is the last, from members[1] on; how many."""
    made, k = 0, last
    while k >= 0:
        made += 1
        k = more_owned[k]
    k = last
    for place in range(made, 0, -1):
        members[place] = plots[k]
        k = more_owned[k]
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
