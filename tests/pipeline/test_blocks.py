"""Blocks that are not on the grid never reach the kernels, which write at addresses made of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.parts import build
from pipeline.tables import Sweeps, TableError
from tests.support.video_scenes import SMALL


def block(first: int, ranges: int) -> Sweeps:
    row = np.arange(first, first + 3, dtype=np.int32)
    return Sweeps(0, 0, row, row / 10.0, row / 10.0, np.zeros((3, ranges), np.uint8))


@pytest.mark.parametrize(
    ("name", "setting"),
    [
        ("adaptive", {}),
        ("ca", {}),
        ("os", {"sweeps": 2}),
        ("clutter_map", {}),
        ("hybrid", {}),
        ("hybrid", {"cells": "map"}),
    ],
)
def test_a_block_that_is_not_on_the_grid_is_refused(name: str, setting: dict[str, Any]) -> None:
    part = build("detect", name, setting)
    state = part.start(SMALL)
    before = state.save()
    for wrong in (
        block(0, SMALL.ranges + 1),
        block(0, 40 * SMALL.ranges),
        block(SMALL.azimuths - 2, SMALL.ranges),
        block(-1, SMALL.ranges),
    ):
        for work in (part, part.thresholds):
            with pytest.raises(TableError):
                work(wrong, state)
    for word, array in state.save().items():
        np.testing.assert_array_equal(array, before[word])
