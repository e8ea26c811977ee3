"""How a command ends when it is told to, by Ctrl-C or by SIGTERM: soon, in words, without a traceback."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import NoReturn

STOPPED = 130
"""Exit status of what was stopped before it was done: 128 and the number of SIGINT, as shells have it."""

PATIENCE_S = 1.5
"""How long a compiler, or other code that lets no signal through, may go on after the signal."""

SIGNALS = (signal.SIGINT, signal.SIGTERM)

_taken = threading.Event()


def stop_on_signals() -> None:
    """From now on the first signal raises KeyboardInterrupt in the main thread; a second one ends the process at once.

    So does the first when the main thread does not take it in PATIENCE_S, as within the compiler of the kernels. To be
    called by the main thread.
    """
    heard, told = os.pipe()
    os.set_blocking(told, False)
    for one in SIGNALS:
        signal.signal(one, _interrupt)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(heard,), name="signals", daemon=True).start()


def handle_signals(handler: Callable[[], None]) -> None:
    """From now on every signal calls this in the main thread, and does nothing else."""
    signal.set_wakeup_fd(-1)
    for one in SIGNALS:
        signal.signal(one, lambda *_: handler())


def end_now(status: int) -> NoReturn:
    """End the process without waiting for its threads, some of which may be in the compiler for a minute."""
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # nobody reads it any more
            stream.flush()
    os._exit(status)


def _interrupt(*_: object) -> None:
    if not _taken.is_set():
        _taken.set()
        raise KeyboardInterrupt


def _watch(heard: int) -> None:
    """Wait for signals as the interpreter writes them there, whatever the main thread does."""
    _await_signal(heard)
    if _taken.wait(PATIENCE_S):
        _await_signal(heard)
    print("airside: stopped", file=sys.stderr)
    end_now(STOPPED)


def _await_signal(heard: int) -> None:
    while os.read(heard, 1)[0] not in SIGNALS:
        pass
