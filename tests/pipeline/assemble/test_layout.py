"""A turn that lies the wrong way round is seen; what tells nothing is not accused."""

import numpy as np
import pytest

from pipeline.assemble.layout import looks_transposed
from tests.support.sweeps import closed_turn


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shape", [(128, 96), (64, 400), (400, 64)])
def test_a_transposed_turn_is_seen(seed: int, shape: tuple[int, int]) -> None:
    turn = closed_turn(seed, *shape)
    assert not looks_transposed(turn)
    assert looks_transposed(turn.T)
    assert looks_transposed(turn.T.astype(np.uint16) * 257)
    assert looks_transposed(turn.T / 255.0)


def test_where_nothing_tells_nothing_is_said() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (64, 40))
    stripes = np.tile(np.arange(40) * 6, (64, 1))
    for turn in (noise, noise * 0, noise * 0 + 9, stripes, np.eye(64) * 200, noise[:2], (noise > 250) * 200):
        assert not looks_transposed(turn)
        assert turn is stripes or not looks_transposed(turn.T)


def test_a_turn_that_is_half_swept_is_not_taken_for_transposed() -> None:
    turn = closed_turn(0)
    turn[64:] = 0
    assert not looks_transposed(turn)
