"""Compiling the kernels of parts in a process of their own, so that the compiler never stops the threads of the feed.

The kernels come back through the cache on disk. `python -m app.runtime.compile_apart` is that process; it reads the
parts as JSON, and works with little priority.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from app.assembly import FRONT_END, chain_of
from app.contract import Refused
from pipeline import parts
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

log = logging.getLogger(__name__)

LIMIT_S = 300.0


class CompilerApart:
    """Starts that process, once for each combination of parts, and ends it with the service. Any thread may call.

    command: of the process.
    """

    def __init__(self, command: Sequence[str] = (sys.executable, "-m", __name__)) -> None:
        self._command = command
        self._known: set[str] = set()
        self._running: set[subprocess.Popen[str]] = set()
        self._lock = threading.Lock()
        self._over = False

    def __call__(self, chosen: Mapping[str, Mapping[str, Any]]) -> None:
        """Compile what these parts need. What fails is compiled here later. Raises Refused when the service ends.

        chosen: of each verb its name and settings, as JSON could carry them.
        """
        # numbers do not change what is compiled
        key = json.dumps({verb: [v for v in one.values() if isinstance(v, str | bool)] for verb, one in chosen.items()})
        if key not in self._known:
            told = self._run(json.dumps(chosen))
            if told:
                log.warning("the kernels were not compiled apart: %s", told)
            self._known.add(key)
        if self._over:
            raise Refused("the service ends")

    def stop(self) -> None:
        """End what compiles, and compile no more."""
        with self._lock:
            self._over = True
            for process in self._running:
                process.kill()

    def _run(self, chosen: str) -> str:
        """Why it failed, in words; empty when it did not."""
        pipe = subprocess.PIPE
        with self._lock:
            if self._over:
                return ""
            try:
                process = subprocess.Popen(
                    self._command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, errors="replace"
                )
            except OSError as error:
                return str(error)
            self._running.add(process)
        try:
            _, told = process.communicate(chosen, timeout=LIMIT_S)
        except (OSError, subprocess.SubprocessError) as error:
            process.kill()
            process.communicate()
            return str(error)
        finally:
            with self._lock:
                self._running.discard(process)
        return "" if self._over or not process.returncode else told.strip()[-500:] or f"exit {process.returncode}"


def main() -> None:
    """Read the parts from standard input and compile what they need."""
    os.nice(10)
    chosen = json.load(sys.stdin)
    made = {}
    for verb in FRONT_END:
        settings = {name: value for name, value in chosen[verb].items() if name != "name"}
        made[verb] = parts.build(verb, chosen[verb]["name"], settings)
    site = RadarSite("compile", 0.0, 0.0, 20.0, VideoFormat(azimuths=64, ranges=80))
    chain_of(site, 0, made, None).warm()


if __name__ == "__main__":
    main()
