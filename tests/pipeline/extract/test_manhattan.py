"""The Manhattan extractor against brute force, OpenCV and geometry."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contracts.extract import Extractor
from pipeline.extract.manhattan import Manhattan
from pipeline.parts import PartError, build
from pipeline.state import StateError
from pipeline.tables import Plots, VideoFormat
from tests.pipeline.contracts.extract import ExtractorContract, plots_of
from tests.support.naive_front_end import m_graph_components
from tests.support.video_scenes import SMALL, packed, site, strip


class TestManhattanKeepsTheContract(ExtractorContract):
    def make(self, **setting: Any) -> Extractor:
        part: Extractor = build("extract", "manhattan", setting)
        return part


def summary(plots: Plots) -> list[tuple[int, ...]]:
    return sorted((int(p), *map(int, w)) for p, w in zip(plots.cells, plots.window, strict=True))


def expected(components: list[Any], azimuths: int) -> list[tuple[int, ...]]:
    rows = []
    for one in components:
        i, j = np.array(sorted(one)).T
        rows.append((len(one), int(i.min() % azimuths), int(np.ptp(i) + 1), int(j.min()), int(np.ptp(j) + 1)))
    return sorted(rows)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    density=st.sampled_from([0.01, 0.04, 0.1]),
    reach=st.sampled_from([(1, 1), (2, 1), (3, 2), (6, 2), (6, 4)]),
    ranges=st.sampled_from([20, 64, 70]),
)
def test_equal_to_brute_force_over_the_seam_at_north(
    seed: int, density: float, reach: tuple[int, int], ranges: int
) -> None:
    video = VideoFormat(azimuths=30, ranges=ranges, range_step_m=10.0, beamwidth_rad=0.2)
    part = Manhattan(ring_m=(0.0, 10.0 * ranges / 2 + 1), reach=reach, max_extent_turn=0.5)
    cells = np.random.default_rng(seed).random((2, 30, ranges)) < density
    state = part.start(site(video))
    plots = plots_of(part, strip(np.full(cells.shape, 7, np.uint8), video), list(cells), state)
    components = m_graph_components(cells.reshape(60, ranges), state.rule.reach[state.rule.ring_of_cell, 0])
    if max(max(i for i, _ in one) - min(i for i, _ in one) for one in components or [[(0, 0)]]) < state.limits[1] - 1:
        assert summary(plots) == expected(components, 30)
    assert plots.cells.sum() == cells.sum()


@pytest.mark.parametrize("density", [0.02, 0.2, 0.4])
def test_equal_to_opencv_where_m_is_one(density: float) -> None:
    video = VideoFormat(azimuths=300, ranges=200, range_step_m=3.0)
    cells = np.random.default_rng(8).random((1, 300, 200)) < density
    part = Manhattan(ring_m=(0.0,), reach=(1,), max_extent_turn=0.5)
    plots = plots_of(part, strip(np.full(cells.shape, 7, np.uint8), video), list(cells), part.start(site(video)))
    _, _, stats, _ = cv2.connectedComponentsWithStats(cells[0].astype(np.uint8), connectivity=4)
    wanted = sorted((int(a), int(t), int(h), int(le), int(w)) for le, t, w, h, a in stats[1:])
    assert summary(plots) == wanted


def test_m_is_the_manhattan_distance() -> None:
    video = VideoFormat(azimuths=60, ranges=40, range_step_m=1.0)
    for m in (1, 2, 3, 6):
        part = Manhattan(ring_m=(0.0,), reach=(m,))
        for di in range(m + 2):
            for dj in range(m + 2):
                if di == dj == 0:
                    continue
                cells = np.zeros((1, 60, 40), bool)
                cells[0, 20, 10] = cells[0, 20 + di, 10 + dj] = True
                plots = plots_of(
                    part, strip(np.full(cells.shape, 7, np.uint8), video), list(cells), part.start(site(video))
                )
                assert len(plots) == (1 if di + dj <= m else 2), (m, di, dj)


def rectangle(video: VideoFormat, east: float, north: float, length: float, width: float, heading: float) -> Any:
    """(1, azimuths, ranges) cells whose centre lies in the rectangle (radar at the origin, no height)."""
    row = (np.arange(video.azimuths) + 0.5) * video.azimuth_step_rad
    cell = video.first_range_m + video.range_step_m * np.arange(video.ranges)
    x = np.sin(row)[:, None] * cell - east
    y = np.cos(row)[:, None] * cell - north
    along = x * np.sin(heading) + y * np.cos(heading)
    across = x * np.cos(heading) - y * np.sin(heading)
    return ((abs(along) <= length / 2) & (abs(across) <= width / 2))[None]


@pytest.mark.parametrize("distance", [150.0, 400.0, 1000.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 77.0, 201.0])
@pytest.mark.parametrize("heading_deg", [0.0, 35.0, 90.0, 160.0])
def test_position_size_and_axis_of_a_long_target(distance: float, azimuth_deg: float, heading_deg: float) -> None:
    video = VideoFormat(range_step_m=1.0)
    east, north = distance * np.sin(np.deg2rad(azimuth_deg)), distance * np.cos(np.deg2rad(azimuth_deg))
    cells = rectangle(video, east, north, 40.0, 8.0, np.deg2rad(heading_deg))
    blocks = strip(np.full((2, *cells.shape[1:]), 90, np.uint8), video)
    part = Manhattan()
    # twice the same turn: a target across north is whole in between
    plots = plots_of(part, blocks, [cells[0], cells[0]], part.start(site(video)))
    plot = plots[plots.cells == plots.cells.max()][:1]
    # polar cells lie denser on the near side, which pulls an unweighted centroid inwards
    pull = 40.0**2 / 12 / distance
    assert np.hypot(plot.east[0] - 100 - east, plot.north[0] + 50 - north) < 1.0 + 1.2 * pull
    assert plot.length[0] == pytest.approx(40.0, abs=4.0)
    assert plot.width[0] == pytest.approx(8.0, abs=4.0)
    assert abs((plot.bearing[0] - np.deg2rad(heading_deg) + np.pi / 2) % np.pi - np.pi / 2) < 0.05
    assert 0 < plot.bearing_sd[0] < 0.2
    assert plot.range[0] == pytest.approx(np.hypot(plot.east[0] - 100, plot.north[0] + 50), abs=1e-6)


def test_slant_range_becomes_ground_range() -> None:
    video = VideoFormat()
    cells = np.zeros((1, 4096, 1024), bool)
    cells[0, 1024, 20] = True  # 60 m slant, due east
    part = Manhattan()
    plots = plots_of(
        part, strip(np.full(cells.shape, 90, np.uint8), video), list(cells), part.start(site(video, height=22.0))
    )
    assert plots.east[0] - 100 == pytest.approx(np.sqrt(60**2 - 22**2), abs=0.01)
    assert plots.range[0] == pytest.approx(60.0)


def test_amplitudes() -> None:
    video = VideoFormat(azimuths=60, ranges=70)
    cells = np.zeros((1, 60, 70), bool)
    cells[0, 10:12, 62:66] = True
    amplitude = np.random.default_rng(1).integers(0, 256, (1, 60, 70), dtype=np.uint8)
    part = Manhattan()
    plots = plots_of(part, strip(amplitude, video), list(cells), part.start(site(video)))
    assert plots.mean_amplitude[0] == pytest.approx(amplitude[cells].mean())
    assert plots.peak_amplitude[0] == amplitude[cells].max()


def test_a_small_plot_has_no_bearing() -> None:
    video = VideoFormat()
    cells = np.zeros((1, 4096, 1024), bool)
    cells[0, 500:503, 300] = True
    part = Manhattan()
    plots = plots_of(part, strip(np.full(cells.shape, 9, np.uint8), video), list(cells), part.start(site(video)))
    assert np.isnan(plots.bearing[0])
    assert np.isnan(plots.bearing_sd[0])
    assert plots.length[0] < 3.0


def test_fewer_cells_than_wanted_are_counted() -> None:
    video = VideoFormat(azimuths=60, ranges=70)
    cells = np.zeros((1, 60, 70), bool)
    cells[0, 10, 10] = cells[0, 30, 10:14] = True
    part = Manhattan(min_cells=2)
    state = part.start(site(video))
    assert len(plots_of(part, strip(np.full(cells.shape, 9, np.uint8), video), list(cells), state)) == 1
    assert state.counters["plots_below_min_cells"] == 1


def test_a_full_pool_drops_and_counts() -> None:
    video = VideoFormat(azimuths=64, ranges=64)
    cells = np.zeros((2, 64, 64), bool)
    cells[:, :, ::2] = True
    part = Manhattan(ring_m=(0.0,), reach=(1,), max_open_runs=40)
    state = part.start(site(video))
    blocks = strip(np.full(cells.shape, 9, np.uint8), video)
    plots = plots_of(part, blocks, list(cells), state)
    assert state.counters["runs_dropped"] > 0
    assert plots.cells.sum() + state.counters["runs_dropped"] == cells.sum()
    later = np.zeros((1, 64, 64), bool)
    later[0, 20, 20] = True
    again = strip(np.full((4, 64, 64), 9, np.uint8), video)[3]
    assert len(Plots.concatenate([part(again, packed(later[0]), state), part.flush(state)])) == 1


def test_an_amplitude_weighted_centroid_is_nearer_the_strong_cells() -> None:
    video = VideoFormat(azimuths=64, ranges=200, range_step_m=1.0)
    cells = np.zeros((1, 64, 200), bool)
    cells[0, 16:18, 100:104] = True
    amplitude = np.full(cells.shape, 80, np.uint8)
    amplitude[0, 16:18, 103] = 80 + 64  # 20 dB more: ten times the amplitude
    part = Manhattan()
    plot = plots_of(part, strip(amplitude, video), list(cells), part.start(site(video)))
    azimuth = (np.array([16, 17]) + 0.5) * video.azimuth_step_rad
    ground = (100 + 101 + 102 + 10 * 103) / 13
    assert plot.weighted_east[0] == pytest.approx(100 + ground * np.sin(azimuth).mean())
    assert plot.weighted_north[0] == pytest.approx(-50 + ground * np.cos(azimuth).mean())
    assert plot.range[0] == pytest.approx(101.5 * np.hypot(np.sin(azimuth).mean(), np.cos(azimuth).mean()))


def test_one_cell_alone_is_its_own_weighted_centroid() -> None:
    cells = np.zeros((1, 96, 150), bool)
    cells[0, 30, 40] = cells[0, 60, 90] = True
    part = Manhattan()
    plots = plots_of(part, strip(np.full(cells.shape, 9, np.uint8), SMALL), list(cells), part.start(site(height=30.0)))
    np.testing.assert_array_equal(plots.weighted_east, plots.east)
    np.testing.assert_array_equal(plots.weighted_north, plots.north)


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("numbers", 4, -1),
        ("numbers", 3, 10**9),
        ("numbers", 1, 2**62),
        ("runs", "parent", 60_000),
        ("runs", "next", 0),
        ("runs", "end", 200),
        ("runs", "ring", 7),
        ("runs", "row", 96),
        ("window", 1, -3),
        ("window", 2, 10**6),
        ("latest", 0, 10**6),
        ("latest", 1, 10**6),
        ("latest", 1, -1),
    ],
)
def test_a_saved_state_that_cannot_be_true_is_refused(name: str, place: Any, value: int) -> None:
    cells = np.random.default_rng(3).random((1, 96, 150)) < 0.05
    part = Manhattan()
    state = part.start(site())
    plots_of(part, strip(np.full(cells.shape, 9, np.uint8), SMALL), list(cells), state, flush=False)
    saved = state.save()
    again = part.start(site())
    again.restore(saved)
    if name == "numbers":
        saved[name][place] = value
    elif name == "runs":
        saved[name][place][saved["numbers"][3] - 1] = value
    elif name == "latest":
        saved[name][place, saved[name][0].argmax()] = value
    else:
        saved[name][saved[name][:, 0] >= 0, place] = value
    with pytest.raises(StateError):
        again.restore(saved)


@pytest.mark.parametrize(
    "setting",
    [
        {"ring_m": (0.0, 5.0), "reach": (2,)},
        {"ring_m": (1.0,), "reach": (2,)},
        {"ring_m": (0.0, 5.0), "reach": (1, 2)},
        {"reach": (6, 4, 3, 2, 0)},
        {"ring_m": (0.0, float("nan")), "reach": (2, 1)},
        {"ring_m": (0.0, 10**400), "reach": (2, 1)},
        {"ring_m": (0.0,), "reach": (float("inf"),)},
        {"max_open_runs": 10**8},
        {"min_cells": 0},
        {"max_extent_turn": 0.0},
    ],
)
def test_wrong_settings_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(PartError):
        build("extract", "manhattan", setting)
