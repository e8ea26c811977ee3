from __future__ import annotations

import numpy as np
import pytest

from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.tables import TargetClass
from tests.pipeline.contracts.classify import ClassifyContract


class TestExtentSpeedContract(ClassifyContract):
    part = ExtentSpeed()

    @pytest.mark.parametrize("before", list(TargetClass))
    def test_between_the_bounds_it_stays_what_it_was(self, before: TargetClass) -> None:
        assert self.call(before, 15.0, 5.0) == before

    def test_no_car_is_that_fast(self) -> None:
        assert self.call(TargetClass.VEHICLE, 8.0, 60.0, seen=1) == TargetClass.AIRCRAFT
        assert self.call(TargetClass.VEHICLE, 8.0, 60.0, seen=0) == TargetClass.VEHICLE

    def test_the_extent_has_to_settle(self) -> None:
        assert self.call(0, 40.0, 5.0, seen=2) == TargetClass.UNKNOWN

    def test_something_short_and_quick_is_not_called_a_vehicle(self) -> None:
        assert self.call(0, 8.0, 36.0) == TargetClass.UNKNOWN
        assert self.call(0, 8.0, 35.0) == TargetClass.VEHICLE

    @pytest.mark.parametrize(
        ("length", "width", "made"),
        [
            (np.nan, 20.0, TargetClass.AIRCRAFT),
            (10.0, 20.0, TargetClass.AIRCRAFT),
            (20.0, np.nan, TargetClass.AIRCRAFT),
            (np.nan, np.nan, TargetClass.UNKNOWN),
        ],
    )
    def test_the_longer_side_counts_as_far_as_it_is_known(self, length: float, width: float, made: TargetClass) -> None:
        columns = [np.array([one]) for one in (0, 0, length, width, 5.0, 100)]
        assert self.part(*columns).tolist() == [made]


@pytest.mark.parametrize("words", [{"vehicle_length": 20.0}, {"vehicle_speed": 50.0}])
def test_classify_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        ExtentSpeed(**words)
