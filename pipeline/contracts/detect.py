"""Video to detections: each file is a detector, and this is what all of them keep to.

A detector is a frozen dataclass of settings, named by its file and given as `PART`:

* `start(video, surface=None, growth_db=None)` makes the state for one radar. surface: (azimuths, ranges) uint8 kind of
  surface of each cell (`SurfaceKind`), for detectors that draw their macro-cells from the airport map; others ignore
  it. growth_db: with it every block also gets `Detections.growth`, the cells more than growth_db above what the
  detector takes for the mean log amplitude of their clutter (never less than the detected cells).
* calling it with a block and the state gives one bit a cell and changes the state in place.
* `thresholds(sweeps, state)` gives the limits that the call would compare the block with, and changes nothing: for
  measuring false alarm rates without waiting for false alarms, and for displays; not for the hot path.

Rules, tested by `tests.pipeline.contracts.detect.DetectorContract`:

* Blocks come in order of scan and row; whole scans, sectors and single rows may be missing. The bits of a sweep do not
  depend on how the sweeps were cut into blocks, one sweep to a whole scan, only on the sweeps before it.
* The threshold of a detector with memory rests on past scans only, so that a target is never in its own first
  threshold. A detector without memory (cell averaging, ordered statistic) uses the cells about the cell under test, of
  its sweep and of earlier sweeps; its guard cells keep the target out.
* Bits past the last range cell are 0. Any cell count and azimuth count.
* A flood of false alarms is bounded by a cap on runs a turn; where it bites, `Detections.degraded` is set and the rows
  are counted, sweep by sweep, whatever the block size.
* The state keeps only arrays; `save()` (copies by name) and `restore()` (raises StateError for what does not fit) carry
  it over a restart, and the bits that follow are the same. Its `counters` tell what happened, by reason, and only grow.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.tables import Detections, Sweeps, VideoFormat


class Detector(Protocol):
    """A detector: settings in its fields, see the module for the rules."""

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> Any:
        """The state of one radar before its first sweep. Raises ValueError for a surface of the wrong shape."""

    def __call__(self, sweeps: Sweeps, state: Any) -> Detections:
        """The detections of the block; `state` is changed in place. Raises TableError, changing nothing, for a block
        that is not on the grid of the state."""

    def thresholds(self, sweeps: Sweeps, state: Any) -> NDArray[np.uint8]:
        """(n, ranges) a cell of the block is detected when its amplitude exceeds this; 255 where nothing is."""
