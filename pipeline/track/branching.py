"""Associations that keep several hypotheses of a target: each is a row of the store of its own."""

from __future__ import annotations

import numpy as np

from pipeline.contracts.measured import Hypotheses
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core
from pipeline.track.resolve import Decided
from pipeline.track.store import ENDED


def branch_hypotheses(
    core: Core, rows: Array, time: Floats, decided: Decided
) -> tuple[Array, Floats, Hypotheses, Array, Array]:
    """Make a row of each hypothesis of the tracks `rows` (k,), and weigh those of each target.

    Gives the rows with the further ones, each with its time, its one hypothesis, the first measurement of that (-1 for
    a miss) and its `origin`. Where the store has no more room, the likeliest go on.
    """
    store, hypotheses, origin = core.store, decided, decided.track
    many = np.diff(hypotheses.track_first)
    of = np.repeat(np.arange(len(rows)), many)
    order = np.lexsort((-hypotheses.log_weight, of))
    first = np.zeros(len(of), np.bool_)
    first[hypotheses.track_first[:-1]] = True
    own, further = order[first], order[~first]
    into = store.copy_rows(rows[of[further]])
    further = further[: len(into)]
    core.filter.branch(store, rows[of[further]], into)
    core.count("hypotheses_branched", len(into))
    chosen = np.concatenate([own, further])
    made = np.concatenate([rows[of[own]], into])
    store.log_weight[made] = store.log_weight[made] + hypotheses.log_weight[chosen]
    weigh_targets(core, made)
    counts = np.diff(hypotheses.plot_first)[chosen]
    starts = hypotheses.plot_first[:-1][chosen]
    plot_first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    plot = np.concatenate(
        [hypotheses.plot[a : a + c] for a, c in zip(starts, counts, strict=True)] + [hypotheses.plot[:0]]
    )
    hit = np.full(len(made), -1, np.int32)
    hit[counts > 0] = hypotheses.plot[starts[counts > 0]]
    single = Hypotheses(np.arange(len(made) + 1, dtype=np.int32), plot_first, plot, np.zeros(len(made)))
    return made, time[of[chosen]], single, hit, origin[of[chosen]]


def weigh_targets(core: Core, rows: Array) -> None:
    """The weights of all rows of the targets of `rows` sum to 1 for each."""
    store = core.store
    mine = core.alive()
    mine = mine[np.isin(store.target[mine], store.target[rows])]
    _, of = np.unique(store.target[mine], return_inverse=True)
    weight = store.log_weight[mine]
    top = np.full(of.max() + 1 if len(of) else 0, -np.inf)
    np.maximum.at(top, of, weight)
    total = np.bincount(of, np.exp(weight - top[of]))
    store.log_weight[mine] = weight - top[of] - np.log(total[of])


def end_hypotheses(core: Core, rows: Array) -> None:
    """Give up the hypotheses `rows`, where another of the same target goes on."""
    store = core.store
    for row in rows:
        same = core.alive()
        same = same[store.target[same] == store.target[row]]
        if len(same) > 1 and store.phase[row] != ENDED:
            store.phase[row] = ENDED
            core.count("hypotheses_ended")
            weigh_targets(core, same[same != row])


def likeliest(core: Core, rows: Array) -> Array:
    """Of `rows`, the likeliest of each target, in their order."""
    if not core.associate.branching or not len(rows):
        return rows
    store = core.store
    order = np.lexsort((-store.log_weight[rows], store.target[rows]))
    target = store.target[rows[order]]
    best = order[np.concatenate([[True], target[1:] != target[:-1]])]
    return np.asarray(rows[np.sort(best)])
