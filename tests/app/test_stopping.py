"""A command that is told to end: at once where it can, by force where the compiler lets no signal through."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from app.settings import ROOT

BEGIN = "from app.stopping import stop_on_signals, handle_signals, end_now; stop_on_signals()\n"

LETS_NO_SIGNAL_THROUGH = """
import ctypes, threading
library, lock = ctypes.CDLL(None), ctypes.create_string_buffer(64)
main, place = threading.get_native_id(), hex(ctypes.addressof(lock))

def say_when_it_waits():
    while place not in open(f"/proc/self/task/{main}/syscall").read():
        pass
    print("begun", flush=True)

threading.Thread(target=say_when_it_waits).start()
for _ in range(2):
    library.pthread_mutex_lock(lock)
"""
"""A mutex that is locked twice by one thread: the call never returns, and no signal ends it."""

CLEANS_UP = """
import threading
try:
    print("begun", flush=True)
    threading.Event().wait()
except KeyboardInterrupt:
    print("cleaning up", flush=True)
    threading.Event().wait()
"""

ENDS = """
import threading
threading.Thread(target=threading.Event().wait).start()
print("held in the buffer")
end_now(7)
"""

HAS_A_HANDLER = """
import signal
heard = []
handle_signals(lambda: heard.append(1))
for _ in range(3):
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGTERM)
print(len(heard))
"""


def started(script: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", BEGIN + script], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip


def line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_code_that_lets_no_signal_through_is_ended_by_force(how: signal.Signals) -> None:
    with started(LETS_NO_SIGNAL_THROUGH) as process:
        assert line(process) == "begun\n"
        process.send_signal(how)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told == "airside: stopped\n"


def test_the_first_signal_leaves_time_to_clean_up_and_the_second_ends_it_without_a_traceback() -> None:
    with started(CLEANS_UP) as process:
        assert line(process) == "begun\n"
        process.send_signal(signal.SIGINT)
        assert line(process) == "cleaning up\n"
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told == "airside: stopped\n"


def test_the_end_waits_for_no_thread_and_loses_nothing_that_was_said() -> None:
    with started(ENDS) as process:
        said, told = process.communicate(timeout=60)
    assert (process.returncode, said, told) == (7, "held in the buffer\n", "")


def test_who_handles_signals_hears_of_every_one_and_is_not_ended() -> None:
    with started(HAS_A_HANDLER) as process:
        said, told = process.communicate(timeout=60)
    assert (process.returncode, said, told) == (0, "6\n", "")
