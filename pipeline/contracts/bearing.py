"""Plots to bearings: each file is an estimator of where an aircraft points, and this is what all of them keep to.

An estimator is a frozen dataclass of settings, named by its file and given as `PART`:

* `start(site)` makes what it needs for one radar (template banks); it is read only afterwards;
* calling it with a view of one target, what is expected of its heading, and that gives one estimate.

Rules, tested by `tests.pipeline.contracts.bearing.BearingContract`:

* Nothing is remembered between targets; the same view gives the same estimate.
* A view too small, empty, saturated or on any grid gives an estimate without a bearing (nan), never an error.
* `sd` is honest: the error divided by it has a second moment near 1 over ranges and target kinds.
* Bearings are true, clockwise from north, modulo pi unless `nose_known`; an expectation resolves the sense.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.sites import RadarSite


@dataclass(frozen=True, slots=True, eq=False)
class TargetView:
    """The polar video about one plot.

    amplitude: (rows, cells) uint8 log amplitude of the plot's window and a margin about it. azimuth: rad from true
    north of the first row's centre (rows follow clockwise, one azimuth step each, also across north). range_m: slant
    range of the centre of the first cell. plot: (first row, rows, first cell, cells) of the plot's own window inside.
    """

    amplitude: NDArray[np.uint8]
    azimuth: float
    range_m: float
    plot: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Expected:
    """What a track says of its heading: rad from true north (0 to 2 pi) and its standard deviation."""

    heading: float
    sd: float


@dataclass(frozen=True, slots=True)
class Bearing:
    """An estimate. bearing: rad, modulo pi unless nose_known; nan when there is none. sd: rad, or nan.

    type: ICAO type of the template that fits best; empty when the estimator has none.
    """

    bearing: float
    sd: float
    nose_known: bool = False
    type: str = ""


NO_BEARING = Bearing(float("nan"), float("nan"))


class BearingEstimator(Protocol):
    """An estimator: settings in its fields, see the module for the rules."""

    def start(self, site: RadarSite) -> Any:
        """What is needed for one radar, made once."""

    def __call__(self, view: TargetView, expected: Expected | None, state: Any) -> Bearing:
        """The bearing of one target."""
