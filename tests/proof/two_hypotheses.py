"""An association for the proof that the tracker carries one that keeps two hypotheses of a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Association, Expected
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.assignment import assign_sparse
from pipeline.tables.arrays import Array, Floats


class Option(NamedTuple):
    """A row of a target (position in the order asked) takes a plot, -1 for none.

    ratio: ln of how much likelier that is than that the row missed. total: with the weight of the row.
    """

    total: float
    ratio: float
    row: int
    plot: int


@dataclass(frozen=True)
class TwoHypotheses:
    """Of each target the likeliest way on and, while it is likely enough, a second one.

    Targets share the plots out among them by their best ways, as with one hypothesis a target. Of the plots left, a
    target keeps a second in mind when it is less likely by e^ambiguous at most. The worse of two rows is given up when
    it is less likely by more than e^give_up, or takes the same plot as the better.
    Source: Blackman, Multiple hypothesis tracking for multiple target tracking (IEEE AES Magazine 19, 2004), cut to two
    hypotheses.
    """

    branching: ClassVar[bool] = True
    gate: float = 13.8
    max_gate_m: float = 150.0
    ambiguous: float = 4.0
    give_up: float = 18.0

    def __call__(self, expected: Expected, measured: Measured, tracks: Array, plots: Array) -> Association:
        gated = GlobalNearestNeighbour(self.gate, self.max_gate_m)(expected, measured, tracks, plots)
        options: dict[int, list[Option]] = {}
        for row, track in enumerate(tracks):
            own, held = options.setdefault(int(expected.target[track]), []), float(expected.log_weight[track])
            own.append(Option(held, 0.0, row, -1))
            for k in range(gated.first[row], gated.first[row + 1]):
                ratio = -0.5 * float(gated.cost[k])
                own.append(Option(held + ratio, ratio, row, int(gated.pair[k])))
        kept: list[list[Option]] = [[] for _ in tracks]
        for one in self._kept([sorted(own, reverse=True) for own in options.values()], len(measured.time)):
            kept[one.row].append(one)
        ended = np.array([row for row, ways in enumerate(kept) if not ways], np.int32)
        return gated._replace(hypotheses=_compressed(kept), ended=ended)

    def reach(self, expected: Expected, measured: Measured) -> Floats:
        return GlobalNearestNeighbour(self.gate, self.max_gate_m).reach(expected, measured)

    def _kept(self, options: list[list[Option]], plots: int) -> list[Option]:
        """One or two options of each target, given those of each in order, the best first."""
        best = _shared_out(options, plots)
        used = {one.plot for one in best if one.plot >= 0}
        made = list(best)
        for k in sorted(range(len(options)), key=lambda k: -best[k].total):
            for other in options[k]:
                if self._both(best[k], other) and (other.plot not in used or other.plot == best[k].plot):
                    made.append(other)
                    used.add(other.plot)
                    break
        return made

    def _both(self, best: Option, other: Option) -> bool:
        """Whether the other is kept beside the best."""
        less = best.total - other.total
        if other.row == best.row:
            return min(best.plot, other.plot) >= 0 and best.plot != other.plot and less <= self.ambiguous
        return (best.plot != other.plot or best.plot < 0) and less <= self.give_up


def _shared_out(options: list[list[Option]], plots: int) -> list[Option]:
    """The option of each target so that no plot serves two of them and all together are the likeliest."""
    ways = [{one.plot: one for one in reversed(own)} for own in options]  # the best with each plot
    columns = [[plot for plot in way if plot >= 0] for way in ways]
    cost = [way[-1].total - way[plot].total for way, own in zip(ways, columns, strict=True) for plot in own]
    first = np.cumsum([0] + [len(own) for own in columns]).astype(np.int32)
    chosen = np.full(len(ways), -1, np.int32)
    assign_sparse(
        first, np.array([plot for own in columns for plot in own], np.int32), np.array(cost, float), plots, chosen
    )
    return [way[int(plot)] for way, plot in zip(ways, chosen, strict=True)]


def _compressed(kept: list[list[Option]]) -> Hypotheses:
    """The options of each row; a row that is given up has a miss."""
    ways = [own or [Option(0.0, 0.0, row, -1)] for row, own in enumerate(kept)]
    flat = [one for own in ways for one in own]
    return Hypotheses(
        np.cumsum([0] + [len(own) for own in ways]).astype(np.int32),
        np.cumsum([0] + [one.plot >= 0 for one in flat]).astype(np.int32),
        np.array([one.plot for one in flat if one.plot >= 0], np.int32),
        np.array([one.ratio for one in flat], float),
    )
