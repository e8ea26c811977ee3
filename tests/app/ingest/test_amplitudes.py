"""Values of any kind as octets, or a refusal that says why."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.ingest.amplitudes import Amplitudes
from app.ingest.recording import RecordingError

PATH = Path("turns.npz")
RAMP = np.linspace(0, 1, 16 * 64).reshape(16, 64)


def octets(turn: np.ndarray, bits: int | None = None) -> tuple[np.ndarray, str]:
    made = Amplitudes.of(PATH, turn, bits)
    out = made.octets(0, turn)
    assert out.dtype == np.uint8
    return out, made.note


@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2", "<i2", ">i4", "<u8"])
@pytest.mark.parametrize("bits", [4, 8, 10, 12, 16])
def test_integers_keep_their_full_scale_and_the_bits_are_told(dtype: str, bits: int) -> None:
    top = (1 << bits) - 1
    if top > np.iinfo(dtype).max:
        return
    turn = np.rint(RAMP * top).astype(dtype)
    out, note = octets(turn)
    assert (int(out.min()), int(out.max())) == (0, 255)
    assert np.abs(out - RAMP * 255).max() <= (9 if bits == 4 else 1)
    assert bool((np.diff(out.astype(int), axis=1) >= 0).all())
    assert note == "" if bits == 8 else f"values of {bits} bits" in note and f"is {top}" in note


def test_bits_that_are_given_decide() -> None:
    turn = np.rint(RAMP * 1000).astype(np.uint16)
    assert int(octets(turn, 12)[0].max()) == 1000 >> 4
    assert octets(turn, 12)[1] == "values of 12 bits, the upper 8 are kept"
    dark = np.full((16, 64), 9, np.uint8)
    assert int(octets(dark, 8)[0].max()) == 9
    assert int(octets(dark)[0].max()) == 9 * 17


def test_truth_values_are_nothing_and_full_scale() -> None:
    assert sorted(set(octets(RAMP > 0.5, 1)[0].ravel().tolist())) == [0, 255]


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<f2"])
def test_floats_are_of_0_to_1_or_of_0_to_255(dtype: str) -> None:
    for scale, words in ((1.0, "0 to 1"), (255.0, "0 to 255")):
        out, note = octets((RAMP * scale).astype(dtype))
        assert np.abs(out - RAMP * 255).max() <= 0.65
        assert words in note


@pytest.mark.parametrize(
    ("turn", "bits", "says"),
    [
        (RAMP * 300, None, "from 0 to 300"), (RAMP - 0.5, None, "from -0.5"), (RAMP * np.nan, None, "nan"),
        (RAMP + np.inf, None, "inf"), (RAMP, 8, "bits is for integers"), (RAMP.astype(complex), None, "complex"),
        ((RAMP * 9 - 5).astype(np.int16), None, "below 0"), ((RAMP * 70_000).astype(np.int32), None, "1 to 16"),
        ((RAMP * 200).astype(np.uint8), 9, "1 to 8"), ((RAMP * 200).astype(np.uint8), 0, "1 to 8"),
    ],
)  # fmt: skip
def test_what_is_no_amplitude_is_refused(turn: Any, bits: int | None, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        Amplitudes.of(PATH, turn, bits)


@pytest.mark.parametrize(
    ("first", "later", "says"),
    [
        ((RAMP * 15).astype(np.uint8), (RAMP * 16).astype(np.uint8),
         "turn 3 has values of more than 4 bits; say `bits: 8`"),
        ((RAMP * 2000).astype(np.uint16), (RAMP * 4095).astype(np.uint16), "more than 11 bits; say `bits: 12`"),
        (RAMP, RAMP * 2, "turn 3: values are float64 from 0 to 2; finite ones of 0 to 1"),
        (RAMP * 255, RAMP * 256, "0 to 255 are wanted"), (RAMP, RAMP * np.nan, "nan"),
    ],
)  # fmt: skip
def test_a_later_turn_of_other_values_is_refused(first: Any, later: Any, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        Amplitudes.of(PATH, first, None).octets(3, later)
