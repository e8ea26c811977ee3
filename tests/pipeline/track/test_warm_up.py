"""A tracker that is warmed up compiles and loads no kernel while it works."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "tables"),
    [("one_radar", "made"), ("several_radars", "decoded"), ("m_of_n", "made"), ("no_radar", "decoded")],
)
def test_no_kernel_is_compiled_or_loaded_while_it_works(case: str, tables: str) -> None:
    # in a process of its own, since this one has used kernels before
    asked = [sys.executable, "-m", "tests.pipeline.track.warmed_kernels", case, tables]
    answer = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    *late, counted = answer.stdout.splitlines()
    assert late == []
    counters = json.loads(counted)  # and all that could need a kernel was done
    wanted = {"confirmed", "ended", "report_started", "identity_stale"}
    if case != "no_radar":
        wanted |= {"absorbed", "fragments_joined", "absorbed_tracks", "plot_on_building"}
    if case != "one_radar":
        wanted |= {"node_started", "node_pulled"}
    assert wanted <= counters.keys()
