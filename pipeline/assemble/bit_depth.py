"""Video of 1 to 16 bits brought to the 8 bits that all parts work on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_octets(values: NDArray[Any], bits: int) -> NDArray[np.uint8]:
    """Unsigned integers of `bits` bits as uint8 of the same shape: fewer bits are stretched evenly to 0..255, of more
    the upper 8 are kept. Full scale stays full scale, so that decibels of full scale keep their meaning.

    Raises ValueError when bits is not 1 to 16, when a value has more, or when values are not unsigned integers.
    """
    if not 1 <= bits <= 16:
        raise ValueError(f"bits must be 1 to 16, not {bits}")
    if values.dtype.kind != "u":
        raise ValueError(f"values must be unsigned integers, not {values.dtype}")
    if values.size and int(values.max()) >> bits:
        raise ValueError(f"there are values of more than {bits} bits")
    if bits > 8:
        return (values >> (bits - 8)).astype(np.uint8)
    top = (1 << bits) - 1
    table = np.minimum(np.arange(256), top) * 255 // top
    return np.asarray(table.astype(np.uint8)[values])
