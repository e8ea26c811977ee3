"""Every experiment runs in its short version, as a person would run it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.evaluate.choose import needs_video
from app.kernel_cache import ROOT
from pipeline.lab.evaluate import experiments
from tests.pipeline.lab.evaluate.checks import check, read_strictly


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_all_experiments_run_and_tell_what_they_found(tmp_path: Path) -> None:
    words = ["evaluate", "all", "--quick", "--jobs", "2", "--json", "all.json", "--report", ".", "--markdown", "all.md"]
    made = subprocess.run(
        [sys.executable, "-m", "app", *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr
    documents = read_strictly(tmp_path / "all.json")
    assert [one["experiment"] for one in documents] == [
        name for name, kind in experiments().items() if not needs_video(kind)
    ]
    for document in documents:
        check(document)
    assert "<svg" in (tmp_path / "all.html").read_text(encoding="utf-8")
    assert "## Summary" in (tmp_path / "all.md").read_text(encoding="utf-8")
