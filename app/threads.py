"""How many threads numeric libraries may use."""

from __future__ import annotations

import os


def one_thread_each() -> None:
    """Before numpy is imported: sums of several threads would differ from machine to machine, and measured times mean
    those of one processor."""
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
