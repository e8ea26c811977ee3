"""Detections to plots: each file is an extractor, and this is what all of them keep to.

An extractor is a frozen dataclass of settings, named by its file and given as `PART`:

* `start(site)` makes the state for one radar;
* calling it with a block, its detections and the state gives the plots that became complete, in order of their last
  row;
* `state.closed_row`: every plot whose cells all lie before this absolute row (scan * azimuths + row) has been
  delivered;
* `flush(state)` completes what is still open, as at the end of a recording.

Rules, tested by `tests.pipeline.contracts.extract.ExtractorContract`:

* The plots do not depend on how the sweeps were cut into blocks nor on any order of scanning inside a turn.
* The turn has no seam: a target that lies across north is one plot, at the time at which its own sweeps were made.
* Whole scans, sectors and single rows may be missing: distances count the rows of the grid, present or not.
* Work and memory are bounded: what exceeds a limit is cut and counted in `state.counters`, and a target cannot keep a
  plot open for ever.
* The state keeps only arrays; `save()` and `restore()` carry it over a restart, and the plots that follow are the same.

What two extractors share is in `pipeline.kernels.components` (runs and their components over a moving window of rows)
and `pipeline.kernels.plot_shape` (the attributes of a plot from its cells).
"""

from __future__ import annotations

from typing import Any, Protocol

from pipeline.sites import RadarSite
from pipeline.tables import Detections, Plots, Sweeps


class Extractor(Protocol):
    """An extractor: settings in its fields, see the module for the rules."""

    def start(self, site: RadarSite) -> Any:
        """The state of one radar before its first sweep."""

    def __call__(self, sweeps: Sweeps, detections: Detections, state: Any) -> Plots:
        """The plots that this block completed; `state` is changed in place."""

    def flush(self, state: Any) -> Plots:
        """The plots that were still open."""
