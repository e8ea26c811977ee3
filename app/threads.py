"""How many threads numeric libraries may use."""

from __future__ import annotations

import os


def one_thread_each() -> None:
    """Have numeric libraries use one thread; to be called before numpy is imported.

    Sums of several threads would differ from machine to machine, and measured times are those of one processor.
    """
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
