"""The values of a recording as octets: what they are is decided by its first turn, and told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from app.ingest.recording import RecordingError
from pipeline.assemble.bit_depth import to_octets

MOST_BITS = 16
"""Integers of more are not radar video as it comes from a digitiser."""


@dataclass(frozen=True)
class Amplitudes:
    """How values become octets. bits: of integers, 0 for floats. factor: of floats. note: what is done, for people."""

    path: Path
    bits: int
    factor: float
    note: str

    @classmethod
    def of(cls, path: Path, turn: NDArray[Any], bits: int | None) -> Self:
        """As the values of the first turn say, or `bits` when it is given. Raises RecordingError."""
        if turn.dtype.kind == "f":
            if bits is not None:
                raise RecordingError(f"{path}: bits is for integers, and the values are {turn.dtype}")
            return cls._of_floats(path, turn)
        values = _integers(path, turn)
        top = int(values.max(initial=0))
        used = bits if bits is not None else _bits_for(top)
        most = min(MOST_BITS, 8 * values.dtype.itemsize)
        if not 1 <= used <= most:
            raise RecordingError(f"{path}: bits must be 1 to {most} where values are {turn.dtype}, not {used}")
        change = "" if used == 8 else ("stretched to 8" if used < 8 else "the upper 8 are kept")
        why = "" if bits is not None else f", as the greatest of the first turn is {top}; `bits` says otherwise"
        return cls(path, used, 1.0, f"values of {used} bits, {change}{why}" if change else "")

    @classmethod
    def _of_floats(cls, path: Path, turn: NDArray[Any]) -> Self:
        _check_floats(path, turn, 255.0)
        if float(turn.max(initial=0)) <= 1.0:
            return cls(path, 0, 255.0, f"values are {turn.dtype} of 0 to 1, times 255")
        return cls(path, 0, 1.0, f"values are {turn.dtype} of 0 to 255, rounded")

    def octets(self, scan: int, turn: NDArray[Any]) -> NDArray[np.uint8]:
        """Turn `scan` as uint8 of its shape. Raises RecordingError when its values do not fit those of the first."""
        where = f"{self.path}: turn {scan}"
        if not self.bits:
            _check_floats(where, turn, 255.0 / self.factor)
            return np.rint(turn * self.factor).astype(np.uint8)
        values = _integers(where, turn)
        top = int(values.max(initial=0))
        if top >> self.bits:
            raise RecordingError(f"{where} has values of more than {self.bits} bits; say `bits: {_bits_for(top)}`")
        return values.astype(np.uint8, copy=False) if self.bits == 8 else to_octets(values, self.bits)


def _bits_for(top: int) -> int:
    return 4 if top <= 15 else max(8, top.bit_length())


def _integers(where: Path | str, turn: NDArray[Any]) -> NDArray[Any]:
    """The values as unsigned integers of the machine's own byte order."""
    if turn.dtype.kind == "b":
        return turn.view(np.uint8)
    if turn.dtype.kind not in "ui":
        raise RecordingError(f"{where}: values are {turn.dtype}; integers or floats are wanted")
    if turn.dtype.kind == "i" and int(turn.min(initial=0)) < 0:
        raise RecordingError(f"{where}: has values below 0, where amplitudes are wanted")
    return turn.astype(f"u{turn.dtype.itemsize}", copy=False)


def _check_floats(where: Path | str, turn: NDArray[Any], most: float) -> None:
    low, high = float(turn.min(initial=0)), float(turn.max(initial=0))
    if not (low >= 0 and high <= most):  # NaN fails this as well
        raise RecordingError(
            f"{where}: values are {turn.dtype} from {low:g} to {high:g}; finite ones of 0 to {most:g} are wanted"
        )
