"""How well this host keeps time, as its kernel says."""

from __future__ import annotations

import ctypes
import time
from typing import Any

_STA_UNSYNC = 0x0040
"""Bit of the status in struct timex: the clock follows no time source (linux/timex.h)."""


class _Timex(ctypes.Structure):
    """The begin of Linux' struct timex; the rest is room that the kernel fills."""

    _fields_ = [
        ("modes", ctypes.c_uint),
        *((name, ctypes.c_long) for name in ("offset", "frequency", "max_error", "estimated_error")),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_long * 32),
    ]


def clock_quality() -> dict[str, Any]:
    """utc, monotonic: s now. synchronised: the clock follows a time source. max_error_s: the bound of the kernel.

    The last two are None where the kernel does not say.
    """
    made: dict[str, Any] = {
        "utc": time.time(),
        "monotonic": time.monotonic(),
        "synchronised": None,
        "max_error_s": None,
    }
    try:
        timex = _Timex()
        if ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex)) >= 0:
            made["synchronised"] = not timex.status & _STA_UNSYNC
            made["max_error_s"] = timex.max_error * 1e-6
    except (OSError, AttributeError):
        pass  # another system than Linux: what is not known is None
    return made
