"""Tracks are judged by the evidence for them: phases change, ids are given, tracks end."""

from __future__ import annotations

import math

import numpy as np

from pipeline.contracts.lifecycle import Evidence
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import TENTATIVE, Core
from pipeline.track.store import ENDED, NEVER

FALSE_PLOT_SHARE = 0.5
"""Fraction of its plots that a track which came to nothing leaves as false plots, at its first and at its last
place."""

NOMINAL_PERIOD_S = 1.0
"""Silence is told to lifecycles as of a sensor that speaks once in so many seconds; of slower radars in proportion."""


def judge_tracks(core: Core, rows: Array, time: Floats) -> None:
    """Have the lifecycle part decide on the tracks `rows` (k,), each at its time (k,) UTC s."""
    store, n, sensors = core.store, len(rows), core.store.evidence.shape[1]
    shape = (n, sensors)
    facts = Evidence(
        np.empty(n, np.uint8), np.empty(shape, np.uint32), np.empty(shape, np.int32), np.empty(shape, np.int32),
        np.empty(shape), len(core.radars), np.empty(n), np.empty(n, np.bool_), np.empty(n),
    )  # fmt: skip
    periods = np.array([one.period for one in core.clocks])
    invalid = _facts(
        store.rows, store.evidence, store.time, rows, time, periods, core.settings.identity.protect_for, *facts
    )
    if invalid:
        core.count("state_invalid", invalid)
    phase, ended = core.lifecycle.judge(facts)
    gone, wanting, learnt, radar = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((2 * n, 3)), np.empty(2 * n)
    g, w, many = _decide(
        store.rows, rows, phase, ended, core.numbers.last > 0, core.settings.extent.aircraft_length, gone, wanting,
        learnt, radar,
    )  # fmt: skip
    if w:
        _number_tracks(core, wanting[:w])
    if many:
        _learn_false_plots(core, learnt[:many], radar[:many])
    if g:
        end_tracks(core, gone[:g])


def _number_tracks(core: Core, rows: Array) -> None:
    """Give the tracks `rows` that have none an id and, where numbers are given, a number.

    A track for which no number was left is counted once and takes the first that becomes free. Rows of one target bear
    the same.
    """
    store = core.store
    _share(core, rows)
    fresh = rows[store.id[rows] == 0]
    many, of = _targets(core, fresh)
    core.count("confirmed", many)
    store.id[fresh] = core.numbers.new_ids(many)[of]
    if core.numbers.last:
        wanting = rows[store.number[rows] == 0]
        many, of = _targets(core, wanting)
        store.number[wanting] = core.numbers.take(many, core.time)[of]
        core.count("no_number", int((store.number[fresh] == 0).sum()))


def _targets(core: Core, rows: Array) -> tuple[int, Array]:
    """How many targets the rows are of, and which each is of, counted in the order in which they come."""
    _, first, of = np.unique(core.store.target[rows], return_index=True, return_inverse=True)
    place = np.empty(len(first), np.int64)
    place[np.argsort(first)] = np.arange(len(first))
    return len(first), place[of]


def _share(core: Core, rows: Array) -> None:
    """Rows take the id and the number that another row of their target bears."""
    if not core.associate.branching:
        return
    target, phase = core.column("target"), core.column("phase")
    for name in ("id", "number"):
        column = core.column(name)
        for row in rows[column[rows] == 0]:
            column[row] = column[(target == target[row]) & (phase != ENDED)].max()


def _learn_false_plots(core: Core, learnt: Floats, radar: Array) -> None:
    """Tracks that came to nothing were false plots of these radars (k,): places in m and how many (k, 3)."""
    for number, false_plots in enumerate(core.false_plots):
        false_plots.learn(learnt if len(core.radars) == 1 else learnt[radar == number])


def end_tracks(core: Core, rows: Array) -> None:
    """End the tracks `rows`. A number is given back with the last row of its target."""
    store = core.store
    numbers = np.empty(len(rows), np.uint16)
    if not core.associate.branching:
        many = _end(store.rows, rows, numbers)
    else:
        store.phase[rows] = ENDED
        others = core.column("target")[core.alive()]
        last = rows[~np.isin(store.target[rows], others)]
        last = last[np.unique(store.target[last], return_index=True)[1]]
        many = _end(store.rows, last, numbers)
    if many:
        core.count("ended", many)
        if core.numbers.last:
            core.numbers.give_back(numbers[:many], core.time)


@allocating
def _end(tracks: Array, rows: Array, numbers: Array) -> int:
    """End rows, and write the numbers of those that bear an id; how many."""
    k = 0
    for i in rows:
        one = tracks[i]
        one["phase"] = ENDED
        if one["id"] > 0:
            numbers[k] = one["number"]
            k += 1
    return k


@allocating
def _facts(
    tracks: Array, evidence: Array, own_time: Floats, rows: Array, time: Floats, periods: Floats, protect_for: float,
    phase: Array, history: Array, looks: Array, misses: Array, score: Floats, radars: int, silence: Floats,
    identified: Array, spread: Floats,
) -> int:  # fmt: skip
    """Fill the columns of the evidence; how many states are not numbers (their spread is not either)."""
    invalid = 0
    for k in range(len(rows)):
        i = rows[k]
        one = tracks[i]
        x, p = one["state"], one["covariance"]
        slowness = np.inf
        for s in range(evidence.shape[1]):
            seen = evidence[i, s]
            history[k, s], looks[k, s], misses[k, s], score[k, s] = (
                seen["history"], seen["looks"], seen["misses"], seen["score"],
            )  # fmt: skip
            if s < radars and seen["history"] != 0:
                slowness = min(slowness, max(periods[s], NOMINAL_PERIOD_S))
        if slowness == np.inf:
            slowness = NOMINAL_PERIOD_S
        phase[k] = one["phase"]
        silence[k] = max(time[k] - one["updated"], 0.0) / slowness
        identified[k] = one["named"] and one["report_time"] >= time[k] - protect_for
        ahead = max(time[k] - own_time[i], 0.0)
        variance = p[0, 0] + p[1, 1] + 2.0 * ahead * (p[0, 2] + p[1, 3]) + ahead * ahead * (p[2, 2] + p[3, 3])
        # a velocity not measured yet says nothing about how well the position is known
        spread[k] = math.sqrt(0.5 * variance) if one["hits"] > 1 and variance > 0.0 else 0.0
        if not math.isfinite(x[0] + x[1] + x[2] + x[3] + variance):
            spread[k] = np.nan
            invalid += 1
    return invalid


@allocating
def _decide(
    tracks: Array, rows: Array, phase: Array, ended: Array, numbered: bool, aircraft_length: float, gone: Array,
    wanting: Array, learnt: Floats, radar: Floats,
) -> tuple[int, int, int]:  # fmt: skip
    """Write the phases, and the rows that end, those that want an id or a number, and the places of false plots.

    Of tracks that radars alone saw and that came to nothing: place, number, and radar of the false plots. How many.
    """
    g = w = many = 0
    for k in range(len(rows)):
        one = tracks[rows[k]]
        one["phase"] = phase[k]
        if not ended[k]:
            if phase[k] != TENTATIVE and (one["id"] == 0 or (numbered and one["number"] == 0)):
                wanting[w] = rows[k]
                w += 1
            continue
        gone[g] = rows[k]
        g += 1
        alone = one["radar"] >= 0 and max(one["node_time"], one["report_time"]) == NEVER
        if phase[k] == TENTATIVE and alone and not one["length"] > aircraft_length:
            learnt[many, :2], learnt[many + 1, :2] = one["birthplace"], one["state"][:2]
            learnt[many : many + 2, 2] = FALSE_PLOT_SHARE * one["hits"]
            radar[many : many + 2] = one["radar"]
            many += 2
    return g, w, many
