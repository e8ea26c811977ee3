"""What every bearing estimator must do: inherit the class, say how to make the part."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.contracts.bearing import Bearing, BearingEstimator, Expected, TargetView
from tests.pipeline.bearing.scene import SITE, VIDEO, axis_error, site, view

QUARTER = VIDEO.azimuths // 4


class BearingContract:
    """Inherit and give make(). turns_deg: how far a bearing may stray when the scene is turned; least: how near to the
    truth a bright B737 is at 500 m, degrees."""

    turns_deg = 0.01
    least = 8.0

    def make(self, **setting: Any) -> BearingEstimator:
        raise NotImplementedError

    @pytest.fixture
    def part(self) -> BearingEstimator:
        return self.make()

    @pytest.fixture
    def state(self, part: BearingEstimator) -> Any:
        return part.start(SITE)

    @pytest.mark.parametrize("heading", [0.3, 1.4, 2.2, 4.0])
    def test_an_aircraft_has_its_bearing(self, part: BearingEstimator, state: Any, heading: float) -> None:
        made = part(view(heading, seed=7), None, state)
        assert abs(axis_error(made.bearing, heading)) < self.least
        assert 0 <= made.bearing < math.pi
        assert 0 < made.sd < 0.5
        assert not made.nose_known

    def test_the_same_view_gives_the_same(self, part: BearingEstimator, state: Any) -> None:
        one, other = view(1.0, seed=3), view(2.0, range_m=900.0, seed=4)
        first = part(one, None, state)
        part(other, Expected(1.0, 0.1), state)
        assert part(one, None, state) == first

    @pytest.mark.parametrize("quarters", [1, 2, 3])
    def test_a_turned_scene_turns_the_bearing(self, part: BearingEstimator, state: Any, quarters: int) -> None:
        for seed in range(3):
            here = view(0.7, seed=seed)
            there = replace(here, azimuth=(here.azimuth + quarters * math.pi / 2) % (2 * math.pi))
            a, b = part(here, None, state), part(there, None, state)
            turned = a.bearing + quarters * math.pi / 2
            assert abs(axis_error(b.bearing, turned)) <= self.turns_deg
            assert b.sd == pytest.approx(a.sd, rel=0.02)

    def test_there_is_no_seam_at_north(self, part: BearingEstimator, state: Any) -> None:
        across = view(0.8, azimuth=0.0, seed=5)
        assert across.azimuth > math.pi, "the view begins before north"
        apart = replace(across, azimuth=across.azimuth - math.pi)
        a, b = part(across, None, state), part(apart, None, state)
        assert abs(axis_error(a.bearing, b.bearing)) <= self.turns_deg
        assert abs(axis_error(a.bearing, 0.8)) < 10

    @pytest.mark.parametrize("wanted", [0.5, 0.5 + math.pi])
    def test_motion_tells_the_nose(self, part: BearingEstimator, state: Any, wanted: float) -> None:
        made = part(view(0.5, seed=7), Expected(wanted, math.radians(10)), state)
        assert made.nose_known
        assert math.cos(made.bearing - wanted) > 0.9
        assert 0 <= made.bearing < 2 * math.pi

    def test_an_expectation_that_is_not_sure_tells_nothing(self, part: BearingEstimator, state: Any) -> None:
        made = part(view(0.5, seed=7), Expected(0.5, math.radians(170)), state)
        assert not made.nose_known

    @pytest.mark.parametrize("shape", [(0, 0), (1, 1), (3, 2), (40, 20)])
    @pytest.mark.parametrize("fill", [0, 60, 255])
    def test_nothing_to_see_is_no_bearing(
        self, part: BearingEstimator, state: Any, shape: tuple[int, int], fill: int
    ) -> None:
        rows, cells = shape
        for plot in ((0, rows, 0, cells), (0, 0, 0, 0), (-5, 99, -5, 99), (rows, 4, cells, 4)):
            blank = TargetView(np.full(shape, fill, np.uint8), 6.28, 400.0, plot)
            for expected in (None, Expected(1.0, 0.1)):
                made = part(blank, expected, state)
                assert math.isnan(made.bearing)
                assert math.isnan(made.sd)

    def test_a_point_is_no_bearing(self, part: BearingEstimator, state: Any) -> None:
        amplitude = np.full((40, 20), 60, np.uint8)
        amplitude[20, 10] = 255
        assert math.isnan(part(TargetView(amplitude, 1.0, 400.0, (20, 1, 10, 1)), None, state).bearing)

    @pytest.mark.parametrize(
        ("azimuths", "ranges", "range_step"), [(512, 300, 1.0), (2048, 200, 7.5), (9000, 777, 3.0)]
    )
    def test_any_grid(self, part: BearingEstimator, azimuths: int, ranges: int, range_step: float) -> None:
        grid = VIDEO.__class__(
            azimuths=azimuths, ranges=ranges, range_step_m=range_step, beamwidth_rad=max(0.003, 6 / azimuths)
        )
        made = part(view(1.2, range_m=250.0, seed=9, video=grid), None, part.start(site(**_fields(grid))))
        assert isinstance(made, Bearing)
        assert math.isnan(made.bearing) or 0 <= made.bearing < math.pi

    def test_video_of_few_bits(self, part: BearingEstimator, state: Any) -> None:
        full = view(1.2, seed=9)
        coarse = replace(full, amplitude=(full.amplitude // 16 * 16).astype(np.uint8))
        made = part(coarse, None, state)
        assert abs(axis_error(made.bearing, 1.2)) < 10

    def test_a_view_that_cannot_be_written(self, part: BearingEstimator, state: Any) -> None:
        one = view(1.2, seed=9)
        wanted = part(one, None, state)
        one.amplitude.flags.writeable = False
        assert part(one, None, state) == wanted


def _fields(grid: Any) -> dict[str, Any]:
    return {name: getattr(grid, name) for name in ("azimuths", "ranges", "range_step_m", "beamwidth_rad")}
