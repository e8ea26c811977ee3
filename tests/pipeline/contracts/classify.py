"""What every classification has to keep to; the test of a new one inherits the suite and sets `part`."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.classify import ClassifyPart
from pipeline.tables import TargetClass


class ClassifyContract:
    part: ClassifyPart

    def call(self, before: int, length: float, speed: float, seen: int = 100, claimed: int = 0) -> int:
        columns = [np.array([one]) for one in (before, claimed, length, length / 2, speed, seen)]
        made = self.part(*columns)
        assert made.dtype == np.uint8
        return int(made[0])

    def test_nothing_seen_is_unknown(self) -> None:
        assert self.call(0, np.nan, 0.0, seen=0) == TargetClass.UNKNOWN

    def test_an_airliner_and_a_car(self) -> None:
        assert self.call(0, 40.0, 10.0) == TargetClass.AIRCRAFT
        assert self.call(0, 6.0, 10.0) == TargetClass.VEHICLE

    @pytest.mark.parametrize("claim", [TargetClass.AIRCRAFT, TargetClass.VEHICLE])
    def test_what_it_says_of_itself_goes_first(self, claim: TargetClass) -> None:
        assert self.call(0, 40.0, 10.0, claimed=claim) == claim
        assert self.call(0, 6.0, 10.0, claimed=claim) == claim
