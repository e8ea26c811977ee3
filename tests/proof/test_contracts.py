"""The parts of the proof keep to the contracts of their kinds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pipeline.contracts.associate import AssociateContract
from tests.pipeline.contracts.filter import FilterContract
from tests.proof.air_filter import AirFilter
from tests.proof.imm_two_models import TwoModels
from tests.proof.two_hypotheses import TwoHypotheses


class TestTwoModelsContract(FilterContract):
    part = TwoModels()


class TestAirFilterContract(FilterContract):
    part = AirFilter()


class TestTwoHypothesesContract(AssociateContract):
    part = TwoHypotheses()


@pytest.mark.parametrize("name", ["air_filter", "imm_two_models", "two_hypotheses"])
def test_a_part_is_one_short_file(name: str) -> None:
    assert len(Path(__file__).with_name(f"{name}.py").read_text().splitlines()) < 150
