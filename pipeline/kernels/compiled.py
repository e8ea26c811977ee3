"""How kernels that only read and write what they are given are compiled."""

from __future__ import annotations

from functools import partial
from typing import Any

from numba import njit

kernel: Any = partial(njit, nogil=True, cache=True, _nrt=False)
"""Without numba's reference counting: handing slices to another kernel costs nothing, and an allocation in a kernel is
a compile error."""

inlined: Any = partial(kernel, forceinline=True)
"""The same for a function so small that a call would cost more than it does."""
