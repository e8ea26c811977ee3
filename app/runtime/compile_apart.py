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
from collections.abc import Mapping
from typing import Any

from app.assembly import FRONT_END, chain_of
from pipeline import parts
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat

log = logging.getLogger(__name__)

LIMIT_S = 300.0

_known: set[str] = set()


def compile_apart(chosen: Mapping[str, Mapping[str, Any]]) -> None:
    """Compile what these parts need, once for each combination. Never raises: what fails is compiled here later.

    chosen: of each verb its name and settings, as JSON could carry them.
    """
    # numbers do not change what is compiled
    key = json.dumps({verb: [v for v in one.values() if isinstance(v, str | bool)] for verb, one in chosen.items()})
    if key in _known:
        return
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            input=json.dumps(chosen),
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        if done.returncode:
            log.warning("the kernels were not compiled apart: %s", done.stderr.strip()[-500:])
    except (OSError, subprocess.SubprocessError) as error:
        log.warning("the kernels were not compiled apart: %s", error)
    _known.add(key)


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
