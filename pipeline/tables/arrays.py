"""Names for numpy arrays in signatures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""An array whose docstring says its dtype and shape."""

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
