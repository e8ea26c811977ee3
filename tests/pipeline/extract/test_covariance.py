"""The covariance of plots against its definition, written out for one plot after the other."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.extract.manhattan import Manhattan
from pipeline.kernels.links import LinkRule
from pipeline.kernels.plot_shape import EDGE, GLINT, LOST, PLACED
from pipeline.tables import Plots, VideoFormat
from tests.pipeline.contracts.extract import plots_of
from tests.pipeline.extract.naive_components import linked_components
from tests.support.video_scenes import site, strip

VIDEO = VideoFormat(azimuths=400, ranges=120, first_range_m=40.0, range_step_m=3.0, beamwidth_rad=0.035)


def covariance(cells: list[tuple[int, int]], amplitude: np.ndarray, video: VideoFormat) -> np.ndarray:
    """Of the centroid of cells (row, range cell) whose amplitudes are given, radar on the ground."""
    row, cell = np.array(cells).T
    slant = video.first_range_m + video.range_step_m * cell
    azimuth = (row + 0.5) * video.azimuth_step_rad
    place = np.stack([slant * np.sin(azimuth), slant * np.cos(azimuth)])
    middle = place.mean(axis=1)
    spread = np.cov(place, bias=True) if len(row) > 1 else np.zeros((2, 2))
    ground = float(np.hypot(*middle))
    sight = middle / ground
    independent = max(1.0, len(row) * video.azimuth_step_rad / video.beamwidth_rad)
    excess_db = (amplitude.mean() - amplitude.min()) * video.db_per_step
    share = PLACED + LOST * 10 ** (-excess_db / 10) / independent**0.25
    part = (EDGE / independent**0.5 + (1 - EDGE) / len(row)) / 12
    along = video.range_step_m**2 * part + (sight @ spread @ sight / ground) ** 2 + GLINT
    across = (ground * video.beamwidth_rad) ** 2 * part + GLINT
    turned = np.array([[sight[0], -sight[1]], [sight[1], sight[0]]])
    return share * spread + turned @ np.diag([along, across]) @ turned.T


@pytest.mark.parametrize("density", [0.005, 0.03])
def test_equal_to_the_definition(density: float) -> None:
    rng = np.random.default_rng(2)
    cells = rng.random((VIDEO.azimuths, VIDEO.ranges)) < density
    for _ in range(20):
        i, j = rng.integers(5, 380), rng.integers(2, 100)
        cells[i : i + rng.integers(1, 14), j : j + rng.integers(1, 12)] = True
    amplitude = rng.integers(40, 200, (1, *cells.shape), dtype=np.uint8)
    part = Manhattan(ring_m=(0.0,), reach=(1,), max_extent_turn=0.5)
    plots = plots_of(part, strip(amplitude, VIDEO), [cells], part.start(site(VIDEO)))
    reach = LinkRule.of(np.tile([1, 0], (VIDEO.ranges, 1)))
    found = {}
    for one in linked_components(cells, reach.reach[reach.ring_of_cell]):
        at = sorted(one)
        key = (at[0][0], min(j for _, j in at), len(at))
        found[key] = covariance(at, amplitude[0][tuple(np.array(at).T)].astype(float), VIDEO)
    assert len(plots) == len(found)
    for window, many, mine in zip(plots.window, plots.cells, plots.covariance, strict=True):
        np.testing.assert_allclose(mine, found[int(window[0]), int(window[2]), int(many)], rtol=1e-6, atol=1e-9)


def test_a_plot_that_stands_out_is_surer() -> None:
    cells = np.zeros((1, VIDEO.azimuths, VIDEO.ranges), bool)
    cells[0, 100:130, 40:50] = True
    part = Manhattan()
    made = []
    for strong in (80, 160):
        amplitude = np.full(cells.shape, strong, np.uint8)
        amplitude[0, 100, 40] = 60
        made.append(plots_of(part, strip(amplitude, VIDEO), list(cells), part.start(site(VIDEO))))
    weak, loud = made
    assert isinstance(weak, Plots)
    assert np.trace(loud.covariance[0]) < 0.5 * np.trace(weak.covariance[0])
